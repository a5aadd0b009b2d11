"""The command line ``mbf``: plan on a map, write and check configurations, list plugins; other packages add commands.

A package adds commands by an entry point of the group ``mbf.commands`` whose function takes the typer application, as
``terrain`` does with ``mbf run``. Every command imports what it needs when it is called, so that ``mbf --help`` is
there at once.

Exit codes: 0 success, 1 the run was no success or no path was found, 2 bad arguments or a bad file, 130 Ctrl-C.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings
from collections.abc import Callable
from importlib.metadata import EntryPoint, version
from typing import Any

import typer

from mbf_abstract.commands import check, doctor, new, plan, plugins, starters
from mbf_abstract.commands.command_group import CommandGroup
from mbf_abstract.config.installed_plugins import DISTRIBUTION, installed_points

COMMANDS_GROUP = "mbf.commands"
YOUNG_OBJECTS = 50_000
"""New objects between two collections of garbage. What a thousand imported modules define is no garbage; looking at it
takes 80 ms of ``mbf plan`` with Python's own 700, and 40 ms with this."""
BLAS_THREADS = "OPENBLAS_NUM_THREADS"
"""Set to 1 unless it is set: nothing here calls BLAS, whose waiting threads take 0.2 s of CPU of each start."""


def make_app() -> typer.Typer:
    """Build the application with the commands of all installed packages."""
    app = typer.Typer(
        name="mbf",
        cls=CommandGroup,
        help="Map-independent navigation for mobile robots, on 2D costmaps and 3D triangle meshes.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # plain text: markup would take a unit such as [m] for its own, and rich costs 0.1 s
    )
    app.callback()(_options)
    for command in (plan, check, starters, plugins, new, doctor):
        command.register(app)
    for point in sorted(installed_points(COMMANDS_GROUP), key=lambda point: point.name):
        _add_commands(app, point)
    for group in app.registered_groups:
        group.cls = CommandGroup
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"{DISTRIBUTION} {version(DISTRIBUTION)}")
        raise typer.Exit


def _options(
    show_version: bool = typer.Option(
        False, "--version", help="Print the version and end.", is_eager=True, callback=_print_version
    ),
) -> None:
    """Map-independent navigation for mobile robots, on 2D costmaps and 3D triangle meshes."""


def _add_commands(app: typer.Typer, point: EntryPoint) -> None:
    """Let a package add its commands; one that cannot be imported costs its own commands, not the others."""
    try:
        point.load()(app)
    except Exception as error:
        typer.echo(f"warning: the commands of {point.value} are missing: {type(error).__name__}: {error}", err=True)


def main() -> None:
    """Run the command line."""
    os.environ.setdefault(BLAS_THREADS, "1")  # numpy reads it when it is imported, which commands do
    warnings.showwarning = _print_warning
    gc.set_threshold(YOUNG_OBJECTS, *gc.get_threshold()[1:])
    app = make_app()
    if not any(name.startswith("_") and name.endswith("_COMPLETE") for name in os.environ):  # a shell asks for words
        keep_parameters_of(app, sys.argv[1] if len(sys.argv) > 1 else "")
    app()


def _print_warning(message: Warning | str, *_where: Any, **_text: Any) -> None:
    """Print a warning as a line: where in the code it comes from says nothing to who has typed a command."""
    typer.echo(f"warning: {message}", err=True)


def keep_parameters_of(app: typer.Typer, wanted: str) -> None:
    """Take the parameters from all commands of ``app`` but the one called ``wanted``.

    typer works them out for every command from its signature, with their types, which takes a third of ``mbf --help``,
    and help needs the names and the first sentences only. Groups keep those of all of their commands if ``wanted`` is
    their name.
    """
    for command in app.registered_commands:
        if command.name != wanted and command.callback is not None:
            command.callback, command.cls = _without_parameters(command.callback), None
    for group in app.registered_groups:
        if group.name != wanted and group.typer_instance is not None:
            keep_parameters_of(group.typer_instance, "")


def _without_parameters(callback: Callable[..., Any]) -> Callable[[], None]:
    """A function with the name and the text of another one."""

    def described() -> None:
        raise AssertionError("a command that was not called")

    described.__name__, described.__doc__ = callback.__name__, callback.__doc__
    return described
