"""``mbf check``: list all mistakes of a configuration, without driving.

Other packages check files and folders of their own, such as scenarios and maps of tiles, by an entry point of the
group ``mbf.checks``: a function ``check(file, load)`` that returns ``Checked``, raises ConfigError with all findings,
or returns None for what it does not know.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

import typer

from mbf_abstract.commands.reporting import readable_errors

CHECKS_GROUP = "mbf.checks"
ROBOT_SUFFIXES = {".urdf", ".xacro"}


@dataclass(frozen=True)
class Checked:
    """A file without mistakes: what is in it, in a line, and what its user should know."""

    summary: str
    notes: tuple[str, ...] = ()


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("check")(check)


def check(
    config: Path = typer.Argument(
        ..., help="Configuration, a scenario (a file, or the name of a shipped one), a map, or a folder of tiles."
    ),
    load: bool = typer.Option(
        True, "--load/--no-load", help="Also build the world, read the map files and construct the plugins."
    ),
) -> None:
    """Check a configuration or a scenario: all mistakes at once, exit code 2 if there is any.

    Prints what was found in the maps. A bare map is checked with the configuration of mbf plan, a scenario with its
    world and the configurations of all its backends.
    """
    with readable_errors():
        points = sorted(entry_points(group=CHECKS_GROUP), key=lambda point: point.name)
        answers = (point.load()(config, load) for point in points)
        checked = next((answer for answer in answers if answer is not None), None) or check_config(config, load)
    for note in checked.notes:
        typer.echo(f"note: {note}")
    typer.echo(f"{config}: good; {checked.summary}")


def check_config(file: Path, load: bool) -> Checked:
    """Check a configuration, or a bare map with the default one, and, to ``load`` it, its maps and plugins.

    Raises ConfigError with all findings.
    """
    from mbf_abstract.config.findings import ConfigError, Finding
    from mbf_abstract.server.standing_server import read_config_or_map, standing_server

    if file.is_dir():
        expected = "a configuration, a scenario, or a folder of tiles (mbf map tile)"
        raise ConfigError([Finding(str(file), 1, "", expected, "a folder of something else")])
    if file.suffix.lower() in ROBOT_SUFFIXES:
        hint = f"mbf robot show {file.name} prints what is found in it"
        raise ConfigError([Finding(str(file), 1, "", "a configuration, a scenario or a map", "a robot", hint)])
    cls, config, of_map = read_config_or_map(file)
    notes = tuple(of_map)
    if load:
        with standing_server(cls, config) as server:
            notes += tuple(server.notes)
    plugins = ", ".join(f"{spec.name} ({spec.type_name})" for spec in config.plugins) or "none"
    return Checked(f"backend {config.backend}, plugins: {plugins}", notes)
