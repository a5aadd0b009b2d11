"""The verdict on a run in a terminal: one line, green for a success, yellow for an arrival with failures, else red."""

from __future__ import annotations

import typer

from mbf_abstract.event_values import well_formed
from terrain.recording.verdict import Level, Verdict

TERMINAL_COLOURS = {Level.SUCCESS: "green", Level.ARRIVED: "yellow", Level.FAILED: "red"}


def print_verdict(verdict: Verdict, before: str = "") -> None:
    """Print the verdict after the text ``before``; in colour where the output is a terminal."""
    typer.secho(well_formed(f"{before}{verdict}"), fg=TERMINAL_COLOURS[verdict.level])
