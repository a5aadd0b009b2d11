"""The command ``mbf bench table1``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from mbf_abstract.commands.reporting import FAILURE, readable_errors

WAREHOUSE = (
    Path(__file__).parent / "environments" / "warehouse.yaml"
)  # also in environments.world, which is slow to import


def register(bench: typer.Typer) -> None:
    """Add the command to the group ``mbf bench``."""
    bench.command("table1")(table1)


def table1(
    seeds: str = typer.Option("0:10", "--seeds", help="First and one past the last seed, 0:10, or a list, 1,5,9."),
    world: Path = typer.Option(
        WAREHOUSE, "--world", help="World file (format: terrain/experiments/table1/environments/warehouse.yaml)."
    ),
    outdoor: bool = typer.Option(False, "--outdoor", help="On a mesh of rough ground among unmapped rocks."),
    ablations: bool = typer.Option(False, "--ablations", help="Run the ablations too."),
    workers: int = typer.Option(2, "--workers", min=1, help="Worker processes."),
    out: Path = typer.Option(Path("runs/table1"), "--out", help="Folder for results; runs that it holds are kept."),
) -> None:
    """Compare a behaviour tree with move_base's fixed state machine, as Table I of the Move Base Flex paper did."""
    with readable_errors(out):
        from rich.console import Console

        from terrain.experiments.table1.campaign import Campaign, Job
        from terrain.experiments.table1.environments.outdoor_environment import OUTDOOR
        from terrain.experiments.table1.environments.world import load_world
        from terrain.experiments.table1.experiment import ChecksFailed, run_experiment, tracks
        from terrain.experiments.table1.picture import draw_tracks
        from terrain.experiments.table1.report import show, write_result
        from terrain.sweeps.command import parse_seeds

        chosen, console = parse_seeds(seeds), Console()
        campaign = Campaign(out, OUTDOOR if outdoor else world, workers)

        def show_row(job: Job, row: Mapping[str, Any]) -> None:
            time = sum(leg["time"] for leg in row["tally"]["legs"])
            console.print(f"{job.name}: {time:.0f} s simulated in {row['wall_time']:.0f} s", highlight=False)

        try:
            result = run_experiment(campaign, chosen, ablations, show_row)
        except ChecksFailed as closed:
            console.print(f"the main run was not begun: {closed}", markup=False, soft_wrap=True)
            raise typer.Exit(FAILURE) from closed
        loaded = None if outdoor else load_world(world)
        name = "outdoor" if loaded is None else loaded.name
        file, picture = out / f"table1_{name}.json", out / f"table1_{name}.png"
        write_result(file, result)
        draw_tracks(picture, loaded, tracks(campaign, chosen))
        console.print(show(result))
        console.print(f"results in {file}, {picture}", soft_wrap=True)
