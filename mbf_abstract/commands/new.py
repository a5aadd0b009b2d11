"""``mbf new``: a small installable package with a plugin or an executive that works, and a test that passes.

The core knows no map, so templates for a map are data of the map's own package: the folder ``templates`` beside its
server holds ``<kind>.py.txt`` and ``test_<kind>.py.txt`` with ``$name`` and ``$class_name``. A new backend gets this
command by adding such a folder. What runs on every map has its templates here, in ``templates/any_map``.
"""

from __future__ import annotations

import keyword
import shlex
import shutil
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template

import typer

from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.config.installed_plugins import installed_points
from mbf_abstract.whole_files import write_whole

GROUPS = {
    "planner": "planners",
    "controller": "controllers",
    "recovery": "recoveries",
    "refiner": "refiners",
    "layer": "{map}_layers",
}
"""Kind of a plugin -> last word of its entry-point group."""
EXECUTIVE = "executive"
KINDS = (*GROUPS, EXECUTIVE)
ANY_MAP = "commands/templates/any_map"

ENTRY_POINT = """\
# The name before "=" is the type that a configuration {where} writes: {{name: ..., type: {name}}}
[project.entry-points."mbf.{group}"]
"{type_name}" = "{name}:{class_name}"
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("new")(new)


def new(
    kind: str = typer.Argument(..., help=f"One of {', '.join(KINDS)}."),
    name: str = typer.Argument(..., help="Name of the package and of the type in a configuration, e.g. my_planner."),
    map_name: str = typer.Option(
        "", "--map", help="The map it works on: mesh, costmap or another installed backend; without it, every map."
    ),
    out: Path = typer.Option(Path("."), "--out", help="Folder to put the package's folder into."),
) -> None:
    """Write a package: pyproject.toml with its entry point, a module that works, a test that passes.

    A planner and a layer need a map. An executive runs on every one; a controller, a recovery and a refiner may.
    """
    with readable_errors(out):
        package = write_package(kind, name.replace("-", "_"), map_name, out)
    typer.echo(f"wrote {package}")
    typer.echo(f"next: pip install -e {shlex.quote(f'{package}[test]')} && pytest {shlex.quote(str(package))}")


def write_package(kind: str, name: str, map_name: str, out: Path) -> Path:
    """Write the package ``out/name`` and return its folder.

    Raises
    ------
    ValueError
        No such kind or map, the kind does not go with the map, or the name is no lower-case module name, or taken.
    FileExistsError
        The folder is there already; nothing is overwritten.
    """
    texts = {
        f"{name}.py": plugin_source(kind, name, map_name),
        f"tests/test_{name}.py": _fill(*_place(f"test_{kind}.py.txt", map_name), name),
        "pyproject.toml": _project(kind, name, map_name),
    }
    if taken := _taken(kind, name, map_name, out):
        raise ValueError(f"the name {name!r} is taken by {taken}: choose another one")
    package = out / name
    package.mkdir(parents=True)
    try:
        (package / "tests").mkdir()
        for file, text in texts.items():
            write_whole(package / file, text)
    except OSError:  # the disk is full: the next try would find the folder taken
        shutil.rmtree(package, ignore_errors=True)
        raise
    return package


def plugin_source(kind: str, name: str, map_name: str = "") -> str:
    """Return the text of the package's module; raises ValueError as ``write_package`` does."""
    if kind not in KINDS:
        raise ValueError(f"no kind {kind!r}; known: {', '.join(KINDS)}")
    if not name.isidentifier() or name != name.lower() or keyword.iskeyword(name):
        raise ValueError(f"{name!r} is not a valid module name: lower-case letters, digits and underscores")
    template = f"{kind}.py.txt"
    on_any_map = files("mbf_abstract").joinpath(ANY_MAP, template).is_file()
    if kind == EXECUTIVE and map_name:
        raise ValueError(f"an executive runs on every map: leave out --map {map_name}")
    if not map_name and not on_any_map:
        raise ValueError(f"a {kind} needs a map: --map {' or --map '.join(_maps_with(template))}")
    package, path = _place(template, map_name)
    if map_name and on_any_map and not files(package).joinpath(path).is_file():
        package, path = _place(template, "")  # such as a recovery: its test is not the same on every map
    return _fill(package, path, name)


def _taken(kind: str, name: str, map_name: str, out: Path) -> str:
    """What has a name already: a module, which the package would replace or be hidden by, or a type of plugins."""
    found = find_spec(name)
    origin = found.origin if found is not None else None
    if origin is not None and not Path(origin).resolve().is_relative_to(out.resolve()):
        return f"the module {origin}"
    if kind == EXECUTIVE:
        return ""
    type_name = f"{map_name}.{name}" if map_name else name
    points = installed_points(f"mbf.{GROUPS[kind].format(map=map_name)}")
    return next((f"the plugin {point.value}" for point in points if point.name == type_name), "")


def class_name(name: str) -> str:
    """Turn a module name into a class name: ``my_planner`` -> ``MyPlanner``."""
    return "".join(word.capitalize() for word in name.split("_"))


def _project(kind: str, name: str, map_name: str) -> str:
    """Text of ``pyproject.toml``; an executive needs no entry point, ``--executive`` takes module and function."""
    entry_point = ""
    if kind != EXECUTIVE:
        entry_point = ENTRY_POINT.format(
            where=f'of "backend: {map_name}"' if map_name else "of any backend",
            name=name,
            group=GROUPS[kind].format(map=map_name),
            type_name=f"{map_name}.{name}" if map_name else name,
            class_name=class_name(name),
        )
    description = f"{kind.capitalize()} for mbf-flex on {f'the {map_name} map' if map_name else 'every map'}"
    return _fill(
        "mbf_abstract", "commands/templates/pyproject.toml.txt", name, entry_point=entry_point, description=description
    )


def _place(template: str, map_name: str) -> tuple[str, str]:
    """Package and path of a template: of a map's own package, or of those for every map."""
    return (
        (_servers_package(map_name), f"templates/{template}") if map_name else ("mbf_abstract", f"{ANY_MAP}/{template}")
    )


def _servers() -> dict[str, str]:
    """Top-level package of each installed map server."""
    return {point.name: point.module.partition(".")[0] for point in installed_points("mbf.servers")}


def _servers_package(map_name: str) -> str:
    servers = _servers()
    if map_name not in servers:
        raise ValueError(f"no map {map_name!r} is installed; known: {', '.join(sorted(servers))}")
    return servers[map_name]


def _maps_with(template: str) -> list[str]:
    """Names of the maps whose package has a template, one for each package."""
    names: dict[str, str] = {}
    for name, package in sorted(_servers().items()):
        if files(package).joinpath("templates", template).is_file():
            names.setdefault(package, name)
    return list(names.values())


def _fill(package: str, path: str, name: str, **values: str) -> str:
    """Fill in a template that is data of ``package``."""
    source = files(package).joinpath(path)
    if not source.is_file():
        raise ValueError(f"package {package} has no template {path}")
    return Template(source.read_text(encoding="utf-8")).substitute(name=name, class_name=class_name(name), **values)
