"""The command ``mbf bench table1-main``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from mbf_abstract.commands.reporting import readable_errors

UNSEEN = "4000:4040"


def register(bench: typer.Typer) -> None:
    """Add the command to the group ``mbf bench``."""
    bench.command("table1-main")(table1_main)


def table1_main(
    seeds: str = typer.Option(UNSEEN, "--seeds", help="First and one past the last seed, or a list, 1,5,9."),
    depot: Path | None = typer.Option(
        None, "--depot", help="World file of the third building, such as tests/system/table1_depot.yaml."
    ),
    rows: Path = typer.Option(
        Path("docs/results/table1_main.jsonl"), "--rows", help="File of rows; trials that it holds are not run again."
    ),
    workers: int = typer.Option(1, "--workers", min=1, help="Worker processes."),
    report: bool = typer.Option(False, "--report", help="Run nothing; judge the rows that are there."),
) -> None:
    """Compare four executives in three buildings on seeds that nobody tuned for: the main run of Table I."""
    with readable_errors():
        from rich.console import Console

        from terrain.experiments.table1.main_run import table
        from terrain.experiments.table1.main_run.picture import draw_curves
        from terrain.experiments.table1.main_run.run import known_rows, run_missing, trials
        from terrain.experiments.table1.report import write_result
        from terrain.sweeps.command import parse_seeds

        console = Console()
        depot = None if depot is None else depot.absolute()
        asked = trials(parse_seeds(seeds), depot)
        if not report:
            for trial, row in run_missing(rows, asked, workers):
                console.print(_line(trial.building, trial.seed, trial.condition, row), highlight=False)
        groups = table.grouped(known_rows(rows, asked), depot)
        judged = table.result(groups)
        write_result(rows.with_suffix(".json"), table.to_json(judged))
        if groups:
            draw_curves(rows.with_suffix(".png"), groups)
        console.print(table.show(judged))
        console.print(f"results in {rows}, {rows.with_suffix('.json')}, {rows.with_suffix('.png')}", soft_wrap=True)


def _line(building: str, seed: int, condition: str, row: dict[str, Any]) -> str:
    time = sum(leg[1] for leg in row["legs"])
    lost = sum(leg[0] != "reached" for leg in row["legs"])
    calls = sum(row["planner"].values())
    recoveries = sum(row["recoveries"].values())
    contacts = row["contacts"] or "none"
    return (
        f"{building}/{seed}/{condition}: {time:.0f} s simulated in {row['seconds']:.0f} s, {lost} lost, {calls} plans, "
        f"{recoveries} recoveries, contacts {contacts}"
    )
