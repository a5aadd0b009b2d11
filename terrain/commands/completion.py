"""What a shell offers for the scenarios of commands; see ``mbf_abstract.commands.completion``."""

from __future__ import annotations

import typer

from mbf_abstract.commands.completion import starting_with
from terrain.scenarios.library import shipped_scenarios


def complete_scenario(incomplete: str) -> list[str]:
    """Names of the shipped scenarios; where none begins so, the shell offers files."""
    return starting_with(incomplete, shipped_scenarios())


SCENARIO = typer.Argument(
    ..., help="Name of a shipped scenario (see mbf scenarios), or a YAML file.", autocompletion=complete_scenario
)
"""The argument of commands that drive a scenario."""
