"""The group of commands ``mbf bench``."""

from __future__ import annotations

import typer

from terrain.experiments.evaluation import command as evaluation
from terrain.experiments.table1 import command as table1
from terrain.experiments.table1.main_run import command as table1_main


def register(app: typer.Typer) -> None:
    """Add the group ``bench`` to the application ``mbf``."""
    bench = typer.Typer(help="Experiments that take minutes: judge your planner, or the package.", no_args_is_help=True)
    bench.callback()(_group)
    evaluation.register(bench)
    table1.register(bench)
    table1_main.register(bench)
    app.add_typer(bench, name="bench")


def _group() -> None:
    """Run experiments that take minutes: judge your planner, or the package."""
