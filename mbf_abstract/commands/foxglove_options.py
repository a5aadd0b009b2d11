"""The options ``--foxglove...`` of all commands that can serve a robot live."""

from __future__ import annotations

import typer

FOXGLOVE = typer.Option(False, "--foxglove", help="Serve it live to Foxglove's app; see docs/foxglove.md.")
AT = typer.Option(
    "127.0.0.1:8765", "--foxglove-at", metavar="HOST:PORT", help="Where; the next free port. Not encrypted."
)
TOKEN = typer.Option(
    True, "--foxglove-token/--no-foxglove-token", help="A token in the address, without which access is refused."
)
READ_ONLY = typer.Option(False, "--foxglove-read-only", help="Watching only, no steering.")
ORIGIN = typer.Option([], "--foxglove-origin", help="Origin of another web app that may connect; repeatable.")
NAMES = ("foxglove_at", "foxglove_token", "foxglove_read_only", "foxglove_origin")
"""Of the parameters that go with ``--foxglove`` only."""


def refuse_without(context: typer.Context, needed: str, *names: str) -> None:
    """Raise BadParameter where one of these parameters is given on the command line, without the option it needs."""
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise typer.BadParameter(f"it goes with {needed} only", param_hint=f"--{name.replace('_', '-')}")
