"""The command line of a run, as its folder records it: what was given, without the folders of this machine."""

from __future__ import annotations

import shlex
from enum import Enum
from pathlib import Path
from typing import Any

import typer


def command_line(context: typer.Context) -> str:
    """Return the present command with the arguments and options that were given, quoted for a shell.

    Of an absolute path only the last part is kept, also of one behind the equals sign of ``--set KEY=VALUE``.
    """
    words = ["mbf", *(context.command_path.split()[1:] or [context.info_name or ""])]  # a group's name, too
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            words += _words(parameter, context.params[name])
    return shlex.join(words)


def _words(parameter: Any, value: Any) -> list[str]:
    if isinstance(value, bool):
        return [parameter.opts[0] if value else parameter.secondary_opts[0]]
    values = [_without_folders(item) for item in (value if isinstance(value, list | tuple) else [value])]
    if parameter.param_type_name == "argument":
        return values
    return [word for item in values for word in (parameter.opts[0], item)]


def _without_folders(value: Any) -> str:
    value = value.value if isinstance(value, Enum) else value
    key, equals, text = str(value).rpartition("=")
    return f"{key}{equals}{Path(text).name if Path(text).is_absolute() else text}"
