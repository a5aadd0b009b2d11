"""The command ``mbf sweep``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mbf_abstract.commands.reporting import readable_errors
from terrain.commands.command_line import command_line
from terrain.commands.completion import SCENARIO
from terrain.commands.counted import counted

if TYPE_CHECKING:
    from rich.console import Console

    from terrain.sweeps.sweep import SweepRun


def register(app: typer.Typer) -> None:
    """Add the command to the application ``mbf``."""
    app.command("sweep")(sweep)


def sweep(
    context: typer.Context,
    scenario: str = SCENARIO,
    seeds: str = typer.Option("0:10", "--seeds", help="First and one past the last seed, 0:20, or a list, 1,5,9."),
    settings: list[str] = typer.Option(
        [], "--set", help="KEY=VALUE,VALUE: planner, controller, backend, world.KEY, or a path of the configuration."
    ),
    workers: int = typer.Option(1, "--workers", min=1, help="Worker processes."),
    scheduler: str | None = typer.Option(
        None, "--scheduler", help="Address of a Dask scheduler, whose workers are used instead of own processes."
    ),
    keep: bool = typer.Option(
        False, "--keep", help="Keep the folder of every run, with its replay, below --out; the page then links to it."
    ),
    out: Path = typer.Option(
        ..., "--out", help="Folder for the results; runs that it holds are not run again, with --keep only if kept."
    ),
) -> None:
    """Run a scenario with many seeds and variants: tables, medians with their spread, tests, figures.

    With several variants each pair of them is tested seed by seed, in success and in every metric; p is corrected
    for the number of all these tests (Holm). Exit code 0 once all runs are done, whatever became of them; 2 if no
    setting lets any begin.
    """
    with readable_errors(out):
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import track

        from mbf_abstract.cluster import run_on_cluster
        from mbf_abstract.event_values import well_formed
        from terrain.scenarios.scenario import load_scenario
        from terrain.sweeps.log import SweepLog
        from terrain.sweeps.report import write_tables
        from terrain.sweeps.sweep import hash_of, is_done, plan_sweep, run_once, run_unless_refused
        from terrain.sweeps.worker_pool import run_in_workers

        loaded = load_scenario(scenario)
        planned = plan_sweep(parse_seeds(seeds), parse_settings(settings))
        hashed, console = hash_of(loaded), Console()
        with SweepLog(out / "runs.jsonl") as log:
            left = [run for run in planned if not is_done(log.rows.get(run.key(hashed)), keep)]
            console.print(f"{counted(len(planned), 'run')}, {len(planned) - len(left)} of them done before")
            for run in left:
                log.forget(run.key(hashed))
            jobs = [(loaded, run) for run in left]
            do = partial(run_once, keep_in=out.resolve() if keep else None, command=command_line(context))
            if scheduler is None:
                spread = partial(run_in_workers, do, workers=workers)
            else:
                spread = partial(run_on_cluster, do, address=scheduler)
            known = [log.rows[run.key(hashed)] for run in planned if run.key(hashed) in log.rows]
            finished = run_unless_refused(jobs, known, spread)
            for (_, run), metrics in track(
                finished, escape(well_formed(loaded.name)), len(left), console=console, disable=not console.is_terminal
            ):
                log.append(run.key(hashed), {**metrics, "seed": run.seed, "variant": run.variant})
                _print_verdict(console, run, metrics)
            rows = [log.rows[run.key(hashed)] for run in planned]
        files = write_tables(f"{loaded.name}: {loaded.proves}", rows, out)
        _print_tables(console, rows)
        names = ", ".join(file.name for file in files)
        console.print(f"results in {out}: {names}", soft_wrap=True, markup=False)
        if all(row.get("refused") for row in rows):
            raise typer.Exit(2)


def _print_verdict(console: Console, run: SweepRun, metrics: Mapping[str, Any]) -> None:
    from mbf_abstract.event_values import well_formed
    from terrain.commands.verdict_line import TERMINAL_COLOURS
    from terrain.recording.verdict import Level

    text = well_formed(f"{f'seed {run.seed} {run.variant}'.rstrip()}: {metrics['verdict']}")
    style = TERMINAL_COLOURS[Level(metrics["level"])]
    console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def _print_tables(console: Console, rows: list[dict[str, Any]]) -> None:
    from mbf_abstract.event_values import well_formed
    from terrain.sweeps.terminal_tables import comparison_table, letters_of, summary_table

    for variant, letter in letters_of(rows).items():
        console.print(f"{letter}  {well_formed(variant) or 'as written'}", markup=False, highlight=False)
    console.print(summary_table(rows))
    if (tests := comparison_table(rows)) is not None:
        console.print(tests)


def parse_seeds(text: str, option: str = "--seeds") -> list[int]:
    """Return the numbers of ``0:20`` or ``1,5,9``; ``option`` is named where they are wrong."""
    try:
        if ":" in text:
            first, end = text.split(":")
            seeds = list(range(int(first), int(end)))
        else:
            seeds = [int(part) for part in text.split(",")]
    except ValueError:
        seeds = []
    if not seeds or min(seeds) < 0 or len(set(seeds)) < len(seeds):
        raise typer.BadParameter(
            f"expected 0:20 or 1,5,9, each number once and none below 0, got {text!r}", param_hint=option
        )
    return seeds


def parse_settings(texts: list[str]) -> dict[str, list[str]]:
    """Return the values of each key of ``KEY=VALUE,VALUE``."""
    settings: dict[str, list[str]] = {}
    for text in texts:
        key, _, values = text.partition("=")
        parts = values.split(",")
        if not key or not all(parts) or len(set(parts)) < len(parts):
            raise typer.BadParameter(f"expected KEY=VALUE,VALUE, each value once, got {text!r}", param_hint="--set")
        if key in settings:
            raise typer.BadParameter(f"expected each key once, with all its values, got {text!r}", param_hint="--set")
        settings[key] = parts
    return settings
