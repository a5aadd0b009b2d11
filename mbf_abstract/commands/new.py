"""``mbf new``: a small installable package with a plugin that works and a test that checks its contract.

The core knows no map, so the templates are data of the map's own package: the folder ``templates`` beside its server
holds ``<kind>.py.txt`` and ``test_<kind>.py.txt`` with ``$name`` and ``$class_name``. A new backend gets this command
by adding such a folder. Kinds that are the same on every map have their template here.
"""

from __future__ import annotations

import keyword
from importlib.metadata import entry_points
from importlib.resources import files
from pathlib import Path
from string import Template

import typer

from mbf_abstract.commands.reporting import readable_errors

GROUPS = {"planner": "planners", "controller": "controllers", "recovery": "recoveries", "layer": "{map}_layers"}
"""Kind of a plugin -> last word of its entry-point group."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("new")(new)


def new(
    kind: str = typer.Argument(..., help=f"One of {', '.join(GROUPS)}."),
    name: str = typer.Argument(..., help="Name of the package and of the type in a configuration, e.g. my_planner."),
    map_name: str = typer.Option(..., "--map", help="The map it works on: mesh, costmap or another installed backend."),
    out: Path = typer.Option(Path("."), "--out", help="Folder to put the package's folder into."),
) -> None:
    """Write a plugin package: pyproject.toml with its entry point, a module that works, a test that passes."""
    with readable_errors():
        package = write_package(kind, name.replace("-", "_"), map_name, out)
    typer.echo(f"wrote {package}")
    typer.echo(f"next: pip install -e '{package}[test]' && pytest {package}")


def write_package(kind: str, name: str, map_name: str, out: Path) -> Path:
    """Write the package ``out/name`` and return its folder.

    Raises
    ------
    ValueError
        No such kind or map, the map has no template of this kind, or the name is no lower-case module name.
    FileExistsError
        The folder is there already; nothing is overwritten.
    """
    texts = {
        f"{name}.py": plugin_source(kind, name, map_name),
        f"tests/test_{name}.py": _fill(_package_of(map_name), f"templates/test_{kind}.py.txt", kind, name, map_name),
        "pyproject.toml": _fill("mbf_abstract", "commands/templates/pyproject.toml.txt", kind, name, map_name),
    }
    package = out / name
    package.mkdir(parents=True)
    (package / "tests").mkdir()
    for file, text in texts.items():
        (package / file).write_text(text, encoding="utf-8")
    return package


def plugin_source(kind: str, name: str, map_name: str) -> str:
    """Return the text of the plugin's module; raises ValueError as ``write_package`` does."""
    if kind not in GROUPS:
        raise ValueError(f"no kind {kind!r}; known: {', '.join(GROUPS)}")
    if not name.isidentifier() or name != name.lower() or keyword.iskeyword(name):
        raise ValueError(f"{name!r} is no name for a module: lower-case letters, digits and underscores")
    package, template = _package_of(map_name), f"{kind}.py.txt"
    if files("mbf_abstract").joinpath(f"commands/templates/{template}").is_file():
        return _fill("mbf_abstract", f"commands/templates/{template}", kind, name, map_name)
    return _fill(package, f"templates/{template}", kind, name, map_name)


def class_name(name: str) -> str:
    """Turn a module name into a class name: ``my_planner`` -> ``MyPlanner``."""
    return "".join(word.capitalize() for word in name.split("_"))


def _package_of(map_name: str) -> str:
    """Top-level package of an installed map server."""
    servers = {point.name: point.module for point in entry_points(group="mbf.servers")}
    if map_name not in servers:
        raise ValueError(f"no map {map_name!r} is installed; known: {', '.join(sorted(servers))}")
    return servers[map_name].partition(".")[0]


def _fill(package: str, path: str, kind: str, name: str, map_name: str) -> str:
    """Fill in a template that is data of ``package``."""
    source = files(package).joinpath(path)
    if not source.is_file():
        raise ValueError(f"package {package} has no template {path}")
    return Template(source.read_text(encoding="utf-8")).substitute(
        name=name,
        class_name=class_name(name),
        kind=kind,
        map=map_name,
        group=GROUPS[kind].format(map=map_name),
    )
