"""The commands ``mbf bench outdoor``, ``indoor``, ``moving`` and ``all``."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mbf_abstract.commands.reporting import readable_errors
from terrain.commands.command_line import command_line

if TYPE_CHECKING:
    from terrain.experiments.evaluation.bench import Asked

QUICK_SEEDS = "0:1"
MOST_LEVELS = 10

PLANNER = typer.Option("", "--planner", help="Planner to judge: a type, module:Class or an installed plugin's name.")
CONTROLLER = typer.Option(
    "", "--controller", help="Controller to judge, likewise; the first of the protocol if not given."
)
NAME = typer.Option("", "--name", help="Name of your entry in the table; what you judge if not given.")
SETTINGS = typer.Option([], "--set", help="KEY=VALUE: a dotted path of the configuration, for your entry; repeatable.")
BESIDE = typer.Option(
    [], "--beside", help="Drive this shipped entry too, or all; or rows of another results.json; repeatable."
)
SEEDS = typer.Option("0:2", "--seeds", help="First and one past the last seed of every level, 0:16, or a list, 1,5,9.")
LEVELS = typer.Option("0:10", "--levels", help="Levels of difficulty, likewise; 0 is the easiest, 9 the hardest.")
QUICK = typer.Option(False, "--quick", help=f"One world of every level: --seeds {QUICK_SEEDS}.")
SURVEYS = typer.Option(
    None, "--surveys", help="Folder with the four surveys, for 40 crops of real ground beside the generated worlds."
)
WORKERS = typer.Option(2, "--workers", min=1, help="Worker processes.")
TIME_LIMIT = typer.Option(
    600.0, "--time-limit", min=1.0, help="Wall time in seconds after which a run counts as hung; compiling counts."
)
AS_JSON = typer.Option(False, "--json", help="Print one JSON object instead of the table.")


class People(str, Enum):
    """Part of the moving evaluation."""

    YIELDING = "yielding"
    BLIND = "blind"


def register(bench: typer.Typer) -> None:
    """Add the commands to the group ``mbf bench``."""
    bench.command("outdoor")(outdoor)
    bench.command("indoor")(indoor)
    bench.command("moving")(moving)
    bench.command("all")(everything)


def outdoor(
    context: typer.Context,
    planner: str = PLANNER,
    controller: str = CONTROLLER,
    backend: str = typer.Option("mesh", "--backend", help="Map of your entry: mesh or costmap."),
    name: str = NAME,
    settings: list[str] = SETTINGS,
    beside: list[str] = BESIDE,
    seeds: str = SEEDS,
    levels: str = LEVELS,
    quick: bool = QUICK,
    surveys: Path | None = SURVEYS,
    workers: int = WORKERS,
    time_limit: float = TIME_LIMIT,
    as_json: bool = AS_JSON,
    out: Path = typer.Option(
        Path("runs/bench_outdoor"), "--out", help="Folder for results; runs that it holds are kept."
    ),
) -> None:
    """Judge your planner or controller on rough ground, beside the shipped ones."""
    asked = _asked(context)
    with readable_errors(out):
        from terrain.experiments.evaluation.bench import bench
        from terrain.experiments.evaluation.outdoor import outdoor as protocol

        bench(protocol(_seeds(seeds, quick), _levels(levels), surveys), asked)


def indoor(
    context: typer.Context,
    planner: str = PLANNER,
    controller: str = CONTROLLER,
    backend: str = typer.Option("costmap", "--backend", help="Map of your entry: costmap or mesh."),
    name: str = NAME,
    settings: list[str] = SETTINGS,
    beside: list[str] = BESIDE,
    seeds: str = SEEDS,
    levels: str = LEVELS,
    quick: bool = QUICK,
    workers: int = WORKERS,
    time_limit: float = TIME_LIMIT,
    as_json: bool = AS_JSON,
    out: Path = typer.Option(
        Path("runs/bench_indoor"), "--out", help="Folder for results; runs that it holds are kept."
    ),
) -> None:
    """Judge your planner or controller among posts that only a lidar sees, beside the shipped ones."""
    asked = _asked(context)
    with readable_errors(out):
        from terrain.experiments.evaluation.bench import bench
        from terrain.experiments.evaluation.indoor import indoor as protocol

        bench(protocol(_seeds(seeds, quick), _levels(levels)), asked)


def moving(
    context: typer.Context,
    planner: str = PLANNER,
    controller: str = CONTROLLER,
    backend: str = typer.Option("costmap", "--backend", help="Map of your entry: costmap or mesh."),
    name: str = NAME,
    settings: list[str] = SETTINGS,
    beside: list[str] = BESIDE,
    seeds: str = SEEDS,
    levels: str = LEVELS,
    quick: bool = QUICK,
    people: People = typer.Option(
        People.YIELDING, "--people", help="People who yield, or blind ones; a table of its own for each."
    ),
    workers: int = WORKERS,
    time_limit: float = TIME_LIMIT,
    as_json: bool = AS_JSON,
    out: Path = typer.Option(
        Path("runs/bench_moving"), "--out", help="Folder for results; runs that it holds are kept."
    ),
) -> None:
    """Judge your planner or controller among people who walk, beside the shipped ones."""
    asked = _asked(context)
    with readable_errors(out):
        from terrain.experiments.evaluation.bench import bench
        from terrain.experiments.evaluation.moving import moving as protocol

        bench(protocol(_seeds(seeds, quick), _levels(levels), people.value), asked)


def everything(
    context: typer.Context,
    planner: str = PLANNER,
    controller: str = CONTROLLER,
    backend: str = typer.Option("mesh", "--backend", help="Map of your entry in all sets: mesh or costmap."),
    name: str = NAME,
    settings: list[str] = SETTINGS,
    beside: list[str] = typer.Option([], "--beside", help="all: drive the shipped entries of every set, too."),
    seeds: str = SEEDS,
    levels: str = LEVELS,
    quick: bool = QUICK,
    surveys: Path | None = SURVEYS,
    workers: int = WORKERS,
    time_limit: float = TIME_LIMIT,
    as_json: bool = AS_JSON,
    out: Path = typer.Option(Path("runs/bench_all"), "--out", help="Folder for results; runs that it holds are kept."),
) -> None:
    """Judge your planner or controller in all of them: on rough ground, among posts, among people of both kinds."""
    if beside not in ([], ["all"]):
        text = f"expected all, as the sets have entries of their own, got {' '.join(beside)!r}"
        raise typer.BadParameter(text, param_hint="--beside")
    asked = _asked(context)
    with readable_errors(out):
        from terrain.experiments.evaluation import indoor as posts
        from terrain.experiments.evaluation import moving as people
        from terrain.experiments.evaluation import outdoor as ground
        from terrain.experiments.evaluation.all_sets import bench_all

        worlds = _seeds(seeds, quick), _levels(levels)
        walking = [people.moving(*worlds, kind.value) for kind in People]
        bench_all([ground.outdoor(*worlds, surveys), posts.indoor(*worlds), *walking], asked)


def _seeds(text: str, quick: bool) -> list[int]:
    from terrain.sweeps.command import parse_seeds

    return parse_seeds(QUICK_SEEDS if quick else text)


def _levels(text: str) -> list[int]:
    from terrain.sweeps.command import parse_seeds

    levels = parse_seeds(text, "--levels")
    if max(levels) >= MOST_LEVELS:
        raise typer.BadParameter(f"expected levels from 0 to {MOST_LEVELS - 1}, got {text!r}", param_hint="--levels")
    return levels


def _asked(context: typer.Context) -> Asked:
    """What the options ask for that all parts have."""
    from terrain.commands.run import settings_of
    from terrain.experiments.evaluation.bench import Asked, is_results_file

    given = context.params
    chosen = settings_of(given["settings"], planner=given["planner"], controller=given["controller"])
    if not chosen and not given["beside"]:
        raise typer.BadParameter("nothing to judge: give --planner, --controller, --set or --beside")
    for name in given["beside"]:
        if is_results_file(name) and not Path(name).is_file():
            text = f"expected a results.json or the name of a shipped entry, got {name!r}: there is no such file"
            raise typer.BadParameter(text, param_hint="--beside")
    shared = {name: given[name] for name in ("backend", "name", "beside", "workers", "time_limit", "as_json")}
    return Asked(chosen, **shared, out=Path(given["out"]), command=command_line(context))
