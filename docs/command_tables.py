"""The reference of the command line: a section for every command of ``mbf``, from the functions behind the commands."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import typer
from typer.models import ArgumentInfo, OptionInfo

from mbf_abstract.cli import make_app

INTRODUCTION = """\
# Commands

<!-- Written by docs/generate_reference.py from the commands; do not edit. -->

Every command of `mbf`, as `mbf COMMAND --help` describes it. Exit codes of all commands: 0 success, 1 the run was no
success or no path was found, 2 bad arguments or a bad file, 130 Ctrl-C before the end (a command that runs until Ctrl-C
ends with 0), 143 SIGTERM. `mbf --install-completion` lets the shell complete names of commands, options, scenarios and
plugins.
"""


def commands_page() -> str:
    """Return the text of ``commands.md``."""
    return "\n".join([INTRODUCTION, *(_section(name, function) for name, function in _commands(make_app(), "mbf"))])


def _commands(app: typer.Typer, name: str) -> Iterator[tuple[str, Any]]:
    """Full names and functions of the commands of an application, then those of its groups, in their order."""
    for command in app.registered_commands:
        function = command.callback
        if function is not None and not command.hidden:
            yield f"{name} {command.name or function.__name__.replace('_', '-')}", function
    for group in app.registered_groups:
        if isinstance(group.typer_instance, typer.Typer):
            yield from _commands(group.typer_instance, f"{name} {group.name or group.typer_instance.info.name}")


def _section(name: str, function: Any) -> str:
    """What a command does and the table of its arguments and options."""
    declared = [(one.name, one.default) for one in inspect.signature(function).parameters.values()]
    shown = [(key, info) for key, info in declared if isinstance(info, ArgumentInfo | OptionInfo) and not info.hidden]
    places = [info.metavar or key.upper() for key, info in shown if isinstance(info, ArgumentInfo)]
    paragraphs = [_one_line(part) for part in (inspect.getdoc(function) or "").split("\n\n")]
    rows = [f"| {_names(key, info)} | {_default(info)} | {_one_line(info.help or '')} |" for key, info in shown]
    table = ["| argument, option | default | meaning |", "|---|---|---|", *rows] if rows else []
    return "\n".join([f"## {' '.join([name, *places])}\n", *(f"{part}\n" for part in paragraphs), *table, ""])


def _names(key: str, info: ArgumentInfo | OptionInfo) -> str:
    """The name of an argument, or all names of an option with what it takes."""
    if isinstance(info, ArgumentInfo):
        return f"`{info.metavar or key.upper()}`"
    names = [one for one in info.param_decls or () if one.startswith("-")] or [f"--{key.replace('_', '-')}"]
    if info.default is True and "/" not in names[0]:
        names.append(f"--no-{names[0].removeprefix('--')}")
    return ", ".join(f"`{f'{one} {info.metavar}' if info.metavar else one}`" for one in names)


def _default(info: ArgumentInfo | OptionInfo) -> str:
    """The default as one would write it; nothing for flags that are off and for what need not be given."""
    value = info.default.value if isinstance(info.default, Enum) else info.default
    if value is ...:
        return "**required**"
    if value is True:
        return "on"
    if value is False or value == "" or not isinstance(value, str | int | float | Path):
        return ""
    return f"`{value.name if isinstance(value, Path) and value.is_absolute() else value}`"


def _one_line(text: str) -> str:
    """Text on one line, without what a table, Markdown or HTML would take for its own."""
    return " ".join(text.replace("``", "`").replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").split())
