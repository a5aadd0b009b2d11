"""The command ``mbf scenarios``."""

from __future__ import annotations

from pathlib import Path

import typer

from mbf_abstract.commands.reporting import readable_errors


def scenarios(
    copy: str = typer.Option("", "--copy", metavar="NAME", help="Copy this scenario with its configurations."),
    to: Path = typer.Option(Path(), "--to", help="With --copy: the folder to copy to."),
) -> None:
    """List the scenarios that come with the package, and what each of them proves."""
    with readable_errors():
        from terrain.scenarios.library import shipped_scenarios
        from terrain.scenarios.scenario import copy_scenario, load_scenario

        if copy:
            for file in copy_scenario(copy, to):
                typer.echo(file)
            return
        for name in shipped_scenarios():
            loaded = load_scenario(name)
            typer.echo(f"{name:16} {loaded.proves}  [{', '.join(loaded.navigation)}]")
