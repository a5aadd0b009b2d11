"""The options ``--foxglove...`` of all commands that can serve a robot live."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from mbf_abstract.access.foxglove import FoxgloveOptions

FOXGLOVE = typer.Option(False, "--foxglove", help="Serve it live to Foxglove's app; see docs/foxglove.md.")
AT = typer.Option(
    "127.0.0.1:8765", "--foxglove-at", metavar="HOST:PORT", help="Where; the next free port. Not encrypted."
)
TOKEN = typer.Option(
    True, "--foxglove-token/--no-foxglove-token", help="A token in the address, without which access is refused."
)
READ_ONLY = typer.Option(False, "--foxglove-read-only", help="Watching only, no steering.")
ORIGIN = typer.Option([], "--foxglove-origin", help="Origin of another web app that may connect; repeatable.")

IS_ORIGIN = r"[A-Za-z][\w+.-]*://[^/]*"
"""A scheme and a host, without a path."""


def foxglove_of(context: typer.Context) -> FoxgloveOptions | None:
    """Return what these options of a command ask for, None without ``--foxglove``; raises ValueError."""
    given = context.params
    if not given["foxglove"]:
        refuse_without(context, "--foxglove", *(name for name in given if name.startswith("foxglove_")))
        return None
    from mbf_abstract.access.foxglove import FoxgloveOptions, parsed_address

    token, read_only, origins = (given[f"foxglove_{name}"] for name in ("token", "read_only", "origin"))
    for origin in origins:
        if not re.fullmatch(IS_ORIGIN, origin):
            text = f"expected an origin as a browser sends it, such as http://localhost:8080, got {origin!r}"
            raise typer.BadParameter(text, param_hint="--foxglove-origin")
    return FoxgloveOptions(*parsed_address(given["foxglove_at"]), token, read_only, tuple(origins))


def refuse_without(context: typer.Context, needed: str, *names: str) -> None:
    """Raise BadParameter where one of these parameters is given on the command line, without the option it needs."""
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise typer.BadParameter(f"it goes with {needed} only", param_hint=f"--{name.replace('_', '-')}")
