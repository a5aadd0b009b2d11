"""BARN worlds: local planning among cylinders, per controller, beside the published DWA run.

    python benchmarks/barn.py [--quick] [--json] [--controllers mppi,...] [--every N] [--workers N] [--results FILE]

The whole stack drives: the costmap server of ``barn.yaml`` on simulated time, one move_base goal a world, replanning
and recoveries as any robot has them; ``barn_world.py`` is the robot and says how a run ends. Footprint (padding 0.1 m),
inflation radius 0.30 m and speed limits 0.5 m/s, 1.57 rad/s are those of the published run. Score of a run as in the
challenge: success * t_opt / clip(t, 4 t_opt, 8 t_opt), t_opt = reference length / 2 m/s; the best is 0.25.

``--results`` keeps every finished run as a JSON line; a run that is in the file with the same settings is not repeated.
The published run's 50 worlds are compared on those of them that the data holds.
``planner`` is whether Theta* finds a path with 0.25 m clearance to all cylinders, and how long it is.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path as FilePath

import numpy as np
from barn_world import GOAL, START, World, drive, warm_up
from scipy.spatial import cKDTree

from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.program_end import interruptible
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.plugins import CostmapContext

CONFIGURATION = FilePath(__file__).with_name("barn.yaml")
DATA = FilePath(__file__).resolve().parents[2] / "shared" / "data"
CONTROLLERS = ("regulated_pure_pursuit", "mppi", "dwa")
OUTCOMES = ("success", "collision", "timeout")
CLEARANCE, RESOLUTION, ORIGIN, SIZE = 0.25, 0.05, (-7.0, -1.0), (340, 200)


@dataclass(frozen=True)
class Run:
    """One drive through one world; ``settings`` is a hash of the configuration it was driven with."""

    controller: str
    world: str
    settings: str
    outcome: str
    time: float
    message: str = ""

    def score(self, world: World) -> float:
        """Score of the challenge."""
        best = world.reference_length / 2.0
        return (self.outcome == "success") * best / min(max(self.time, 4.0 * best), 8.0 * best)


def load_worlds(data: FilePath) -> dict[str, World]:
    """All worlds of the data, by number."""
    barn = json.loads((data / "barn" / "barn240.json").read_text())
    return {
        number: World(np.array(world["cylinders"], dtype=float), barn["radius"], float(world["reference_length"]))
        for number, world in barn["worlds"].items()
    }


def published_runs(data: FilePath) -> list[Run]:
    """The published DWA run, ten drives a world."""
    rows = np.loadtxt(data / "barn" / "dwa_out.txt")
    outcomes = [OUTCOMES[int(np.argmax(row[1:4]))] for row in rows]
    return [Run("published", str(int(row[0])), "", o, float(row[4])) for row, o in zip(rows, outcomes, strict=True)]


# --------------------------------------------------------------------------------------------------- driving
def drive_all(
    worlds: Mapping[str, World], controllers: Sequence[str], workers: int, results: FilePath | None
) -> Iterator[Run]:
    """Every controller in every world, the finished runs of the results file first."""
    settings = hashlib.sha256(CONFIGURATION.read_bytes()).hexdigest()[:12]
    wanted = [(controller, number) for controller in controllers for number in worlds]
    done = [run for run in _finished(results, settings) if (run.controller, run.world) in wanted]
    yield from done
    missing = [pair for pair in wanted if pair not in {(run.controller, run.world) for run in done}]
    with ProcessPoolExecutor(workers, initializer=warm_up, initargs=(CONFIGURATION,)) as pool:
        futures = [pool.submit(_drive, controller, number, worlds[number], settings) for controller, number in missing]
        for future in as_completed(futures):
            run = future.result()
            if results is not None:
                with results.open("a") as file:
                    file.write(json.dumps(asdict(run)) + "\n")
            if run.outcome != "success":
                print(
                    f"  {run.controller}, world {run.world}: {run.outcome}, {run.time:.1f} s {run.message}", flush=True
                )
            yield run


def _drive(controller: str, number: str, world: World, settings: str) -> Run:
    return Run(controller, number, settings, *drive(world, CONFIGURATION, controller, seed=int(number)))


def _finished(results: FilePath | None, settings: str) -> list[Run]:
    if results is None or not results.exists():
        return []
    runs = [Run(**json.loads(line)) for line in results.read_text().splitlines()]
    return [run for run in runs if run.settings == settings]


def summary(runs: Iterable[Run], worlds: Mapping[str, World]) -> dict[str, float]:
    """Shares of the outcomes, mean time of the successes and mean score of the runs in ``worlds``."""
    chosen = [run for run in runs if run.world in worlds]
    times = [run.time for run in chosen if run.outcome == "success"]
    shares = {outcome: float(np.mean([run.outcome == outcome for run in chosen])) for outcome in OUTCOMES}
    score = float(np.mean([run.score(worlds[run.world]) for run in chosen]))
    return {"runs": len(chosen), **shares, "time": float(np.mean(times)) if times else math.nan, "score": score}


# ------------------------------------------------------------------------------------------ the planner alone
class GivenMap(LayeredCostmap):
    """A costmap without layers that shows one grid."""

    def __init__(self, grid: Costmap) -> None:
        super().__init__(grid.geometry, [], Footprint([]))
        self.grid = grid

    def snapshot(self) -> Costmap:
        """Return the grid."""
        return self.grid


def planner_results(worlds: Mapping[str, World]) -> dict[str, float]:
    """Worlds with a Theta* path at the clearance, and the largest excess [m] over the published length."""
    found, excess = 0, -math.inf
    for world in worlds.values():
        grid = Costmap(np.zeros(SIZE, dtype=np.uint8), RESOLUTION, *ORIGIN)
        iy, ix = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        distances, _ = cKDTree(world.cylinders).query(grid.cells_to_world(np.column_stack([ix.ravel(), iy.ravel()])))
        grid.cells[(distances < world.radius + CLEARANCE).reshape(SIZE)] = 254
        costmap = GivenMap(grid)
        parameters = ThetaStarPlanner.Parameters(cost_factor=0.0)
        rng = np.random.default_rng(0)
        context = CostmapContext("barn", parameters, SimClock(), rng, None, costmap)
        plan = ThetaStarPlanner(context).make_plan(PlanRequest(START, GOAL))
        if plan.success:
            found += 1
            excess = max(excess, plan.path.length - world.reference_length)
    return {"worlds": len(worlds), "found": found, "largest_excess": excess}


# --------------------------------------------------------------------------------------------------- printing
def print_row(name: str, result: Mapping[str, float]) -> None:
    """One line of the table."""
    shares = " ".join(f"{result[outcome]:9.3f}" for outcome in OUTCOMES)
    print(f"{name:42s} {result['runs']:5.0f} {shares} {result['time']:7.2f} {result['score']:6.3f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="six worlds, without DWA")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    parser.add_argument("--controllers", default="", help=f"some of {','.join(CONTROLLERS)}")
    parser.add_argument("--every", type=int, default=0, help="take every n-th world (default 1, quick 40)")
    parser.add_argument("--workers", type=int, default=1, help="processes that drive")
    parser.add_argument("--results", type=FilePath, help="JSON lines of finished runs, read and appended")
    parser.add_argument("--data", type=FilePath, default=DATA)
    arguments = parser.parse_args()
    every = arguments.every or (40 if arguments.quick else 1)
    worlds = dict(list(load_worlds(arguments.data).items())[::every])
    chosen = arguments.controllers.split(",") if arguments.controllers else CONTROLLERS[: 2 if arguments.quick else 3]
    runs = list(drive_all(worlds, chosen, arguments.workers, arguments.results))

    published = published_runs(arguments.data)
    shared = {number: worlds[number] for number in sorted({run.world for run in published} & worlds.keys(), key=int)}
    print(f"{'controller':42s}  runs   success collision   timeout    time  score   (time: mean of the successes [s])")
    results: dict[str, object] = {"published_dwa": summary(published, shared)}
    print_row(f"published DWA run, {len(shared)} worlds", summary(published, shared))
    for name in chosen:
        own = [run for run in runs if run.controller == name]
        results[name] = summary(own, worlds)
        print_row(f"{name}, the same worlds", summary(own, shared))
        print_row(f"{name}, all {len(worlds)} worlds", summary(own, worlds))
    planner = results["planner"] = planner_results(worlds)
    print(
        f"Theta*, {CLEARANCE} m clearance: {planner['found']} of {planner['worlds']} worlds,"
        f" at most {planner['largest_excess']:.2f} m over the published path"
    )
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    with interruptible():
        main()
