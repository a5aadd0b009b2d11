"""``mbf check``: list all mistakes of a configuration, without driving."""

from __future__ import annotations

from pathlib import Path

import typer

from mbf_abstract.commands.reporting import readable_errors


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("check")(check)


def check(
    config: Path = typer.Argument(..., help="Configuration file."),
    load: bool = typer.Option(True, "--load/--no-load", help="Also read the map files and construct the plugins."),
) -> None:
    """Check a configuration: all mistakes at once, exit code 2 if there is any. Prints what was found in its map."""
    with readable_errors():
        from mbf_abstract.commands.standing_server import standing_server
        from mbf_abstract.server.factory import read_config

        cls, checked = read_config(config)
        if load:
            with standing_server(cls, checked) as server:
                for note in server.notes:
                    typer.echo(f"note: {note}")
    plugins = ", ".join(f"{spec.name} ({spec.type_name})" for spec in checked.plugins) or "none"
    typer.echo(f"{config}: good; backend {checked.backend}, plugins: {plugins}")
