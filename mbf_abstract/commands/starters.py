"""``mbf config``: a configuration to start from, for a map and a typical robot.

Starters are data of the map's own package: files ``<name>.yaml`` in the folder ``starters`` beside its server, with
``$map_file`` where the map goes, if they have one. Their first line says in a sentence whose they are. A new backend
gets this command by adding such a folder.
"""

from __future__ import annotations

import errno
import json
import os
import shlex
from importlib.resources import files
from pathlib import Path
from string import Template

import typer

from mbf_abstract.commands.completion import starting_with
from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.config.installed_plugins import installed_points
from mbf_abstract.whole_files import write_whole

PLACEHOLDER = "$map_file"


def complete_starter(incomplete: str) -> list[str]:
    """Names of the starters, for the shell."""
    return starting_with(incomplete, starters())


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("config")(config)


def config(
    name: str = typer.Argument(
        "", help="Name of a starter; without one they are listed.", autocompletion=complete_starter
    ),
    map_file: Path | None = typer.Option(
        None, "--map", help="The map: a map_server map, a mesh, or a folder of tiles."
    ),
    out: Path | None = typer.Option(None, "--out", help="File to write it to; printed if not given."),
) -> None:
    """Write a configuration to start from: one that passes mbf check, for a map and a typical robot."""
    with readable_errors(out):
        if not name:
            typer.echo(listing())
            return
        text = starter_text(name, map_file, out)
        if out is None:
            typer.echo(text, nl=False)
            return
        if out.exists():
            raise FileExistsError(errno.EEXIST, "there is such a file already; nothing is overwritten", str(out))
        write_whole(out, text)
    typer.echo(f"wrote {out}")
    typer.echo(f"next: set speeds, outline and sensors to those of your robot, then mbf check {shlex.quote(str(out))}")


def starters() -> dict[str, str]:
    """Return the names and texts of all starters of the installed packages, by name."""
    packages = {point.module.partition(".")[0] for point in installed_points("mbf.servers")}
    folders = [files(package).joinpath("starters") for package in packages]
    found = [file for folder in folders if folder.is_dir() for file in folder.iterdir()]
    texts = {file.name.removesuffix(".yaml"): file.read_text("utf-8") for file in found if file.name.endswith(".yaml")}
    return dict(sorted(texts.items()))


def listing() -> str:
    """Return a line for each starter: its name, and whose it is."""
    texts = starters()
    indent = max(map(len, texts), default=0) + 2
    return "\n".join(f"{name:{indent}}{_summary(text)}" for name, text in texts.items())


def starter_text(name: str, map_file: Path | None = None, out: Path | None = None) -> str:
    """Return the text of a starter with the path of its map, relative to the folder of ``out`` if that is given.

    Raises
    ------
    ValueError
        There is no such starter, it has a map and none is given, or it has none and one is given, or one of a kind that
        other servers read.
    FileNotFoundError
        There is no such map.
    """
    texts = starters()
    if name not in texts:
        raise ValueError(f"no starter {name!r}; known: {', '.join(texts)}")
    text = texts[name]
    if PLACEHOLDER not in text:
        if map_file is not None:
            raise ValueError(f"{name} has no map: leave out --map {map_file}")
        return text
    if map_file is None:
        raise ValueError(f"{name} needs a map: --map FILE")
    if not map_file.exists():
        raise FileNotFoundError(f"--map {map_file}: no such file")
    _refuse_other_maps(text, map_file)
    place = map_file if out is None else Path(os.path.relpath(map_file, out.parent))
    return Template(text).substitute(map_file=json.dumps(place.as_posix(), ensure_ascii=False))


def _refuse_other_maps(text: str, map_file: Path) -> None:
    """Raise ValueError for a map whose ending only servers of other backends know; an unknown one is checked later."""
    points = installed_points("mbf.map_files")
    reading = [point.value for point in points if map_file.is_file() and f".{point.name}" == map_file.suffix.lower()]
    backends = {point.value: point.name for point in installed_points("mbf.servers")}
    backend = next(line.split()[1] for line in text.splitlines() if line.startswith("backend:"))
    if reading and backend not in (others := [backends[value] for value in reading if value in backends]):
        raise ValueError(f"--map {map_file}: expected a map of the backend {backend}, got one of {', '.join(others)}")


def _summary(text: str) -> str:
    return text.partition("\n")[0].removeprefix("#").strip()
