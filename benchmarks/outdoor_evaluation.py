"""Who arrives on rough ground: planners on the mesh against a flat map of slopes and against the straight line.

    python benchmarks/outdoor_evaluation.py [--quick] [--json] [--workers 2] [--data ../shared/data] [--replays DIR]

Seeded terrains of rising difficulty (fractal hills that get steeper and rougher, boulders, a pair of ruts) and, with
the data folder, crops of a real 1 m survey. On each, a simulated Husky drives from one corner to the other, once per
method: same controller on the mesh, pure pursuit on the flat map. ``feasible`` terrains are those where a way exists
whose ground, seen over the robot's length, stays below 25 degrees with half a metre of room on both sides; rates are
over these. Failures are of the planner (no plan), of physics (tipped over, stuck, high-centred) or of the controller
(the rest), or an error before the start; ``--replays`` drives one of each class again and keeps everything to look at.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from scipy import ndimage

from mbf_abstract.geometry import Path, quaternion_from_yaw
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.plugins import MeshPlanner
from terrain.heightfield import Heightfield
from terrain.runner import RunOptions, run_scenario
from terrain.scenario import SHIPPED, PlanarPose, Scenario
from terrain.scenario_places import coordinates
from terrain.scenario_stage import WORLD_STREAM
from terrain.scenario_world_types import GeneratedWorld, HeightfieldWorld
from terrain.slope_map import cell_slopes
from terrain.sweep import SweepRun, run_all

ROUGH = {"mesh_map.height_diff.radius": "0.35", "mesh_map.height_diff.threshold": "0.35"}  # slopes are no boulders
METHODS = {
    "mesh any_angle": {"planner": "any_angle", **ROUGH},
    "mesh cvp": {"planner": "cvp", **ROUGH},
    "mesh heading_astar": {"planner": "heading_astar", **ROUGH},
    "mesh dijkstra, slope only": {"planner": "dijkstra", "mesh_map.default_layer": "steepness", **ROUGH},
    "flat A*": {"backend": "costmap", "planner": "astar"},
    "straight line": {"planner": "outdoor_evaluation:StraightLinePlanner", **ROUGH},
}
CONFIGS = {name: SHIPPED / "config" / f"outdoor_{name}.yaml" for name in ("mesh", "costmap")}
PLANNER_OUTCOMES = set(GetPathOutcome.__members__) - set(ExePathOutcome.__members__)
PHYSICS = {"tipped_over", "stuck", "high_centred"}
FEASIBLE_SLOPE, ROOM, CELL = 25.0, 0.5, 0.25
CROPS = {"kootenai_1m.npz": [(0.0, 24.0, 0.0, 18.0), (24.0, 48.0, 0.0, 18.0), (0.0, 24.0, 18.0, 36.0)]}


class StraightLinePlanner(MeshPlanner):
    """Projects the straight line from start to goal onto the surface, whatever is in the way."""

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Answer at once."""
        start, goal = (np.array(pose.position) for pose in (request.start, request.goal))
        points = np.linspace(start, goal, max(2, int(np.linalg.norm(goal - start) / 0.2)))
        for _ in range(20):  # the nearest surface point of the nearest surface point ... is straight below
            points[:, 2] = self.mesh_map.locate(points, np.inf).points[:, 2]
        heading = np.tile(quaternion_from_yaw(float(np.arctan2(*(goal - start)[1::-1]))), (len(points), 1))
        return PlanResult(0, "straight ahead", Path(points, heading, request.start.frame_id))


def scenario_in(name: str, world: GeneratedWorld | HeightfieldWorld, corner: tuple[float, ...]) -> Scenario:
    """A drive from one corner of a world to the other; ``corner`` is x_min, x_max, y_min, y_max."""
    x_min, x_max, y_min, y_max = corner
    yaw = float(np.arctan2(y_max - y_min, x_max - x_min))
    return Scenario(
        name=name,
        proves="A robot crosses rough ground.",
        backend="mesh",
        navigation=CONFIGS,
        world=world,
        robot="husky",
        start=PlanarPose(x=x_min + 2.5, y=y_min + 2.5, yaw=yaw),
        goals=(PlanarPose(x=x_max - 2.5, y=y_max - 2.5, yaw=yaw),),
        time_limit=150.0,
    )


def generated(difficulty: float, size: tuple[float, float]) -> Scenario:
    """Ground of a difficulty from 0 to 1."""
    boulders = {"type": "boulders", "density": 1.0 + 4.0 * difficulty, "radius_min": 0.2, "radius_max": 0.8}
    ruts = {"type": "ruts", "points": ((0.0, 0.6 * size[1]), (size[0], 0.4 * size[1])), "depth": 0.1 + 0.1 * difficulty}
    world = GeneratedWorld(
        type="generated",
        size=size,
        median_slope=4.0 + 14.0 * difficulty,
        roughness=0.02 * difficulty,
        features=(ruts, boulders),  # type: ignore[arg-type]
    )
    return scenario_in(f"difficulty {difficulty:.2f}", world, (0.0, size[0], 0.0, size[1]))


def real(data: FilePath) -> list[Scenario]:
    scenarios = []
    for name, crops in CROPS.items():
        for number, crop in enumerate(crops):
            file = data / "terrain" / "dem" / name
            if file.is_file():
                world = HeightfieldWorld(type="heightfield", file=file, crop=crop, spacing=CELL)
                scenarios.append(scenario_in(f"{file.stem} {number}", world, crop))
    return scenarios


def ground(scenario: Scenario, seed: int) -> Heightfield:
    """The very ground that a run with this seed drives on."""
    clear = coordinates((scenario.start, *scenario.goals))
    return scenario.world.heightfield(np.random.default_rng([seed, WORLD_STREAM]), clear)  # type: ignore[union-attr]


def is_feasible(scenario: Scenario, seed: int) -> bool:
    """Whether gentle ground, wide enough for the robot, connects start and goal."""
    terrain = ground(scenario, seed)
    gentle = cell_slopes(terrain, CELL) < FEASIBLE_SLOPE
    wide = ndimage.distance_transform_edt(np.pad(gentle, 1))[1:-1, 1:-1] * CELL > ROOM
    regions, _ = ndimage.label(wide, np.ones((3, 3)))
    ends = ((coordinates((scenario.start, *scenario.goals)) - (terrain.x0, terrain.y0)) / CELL).astype(int)
    (start, goal) = (regions[iy, ix] for ix, iy in ends.tolist())
    return bool(start == goal != 0)


def failure_class(row: dict[str, Any]) -> str:
    if row["success"]:
        return ""
    if "time_s" not in row:
        return "error"  # it could not even begin
    if PHYSICS & set(row.get("mishaps", ())):
        return "physics"
    return "planner" if row["outcome"] in PLANNER_OUTCOMES else "controller"


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures of one method over its feasible terrains."""
    feasible = [row for row in rows if row["feasible"]]
    arrived = [row for row in feasible if row["success"]]
    share = 100.0 / max(1, len(feasible))
    return {
        "runs": len(rows),
        "feasible": len(feasible),
        "success_percent": round(share * len(arrived), 1),
        "tip_over_percent": round(share * sum("tipped_over" in row.get("mishaps", ()) for row in feasible), 1),
        "slip_percent": round(share * sum("slipping" in row.get("mishaps", ()) for row in feasible), 1),
        "energy_j_per_m": round(float(np.mean([r["energy_j"] / r["path_length_m"] for r in arrived])), 1)
        if arrived
        else None,
        "failures": dict(Counter(failure_class(row) for row in feasible if not row["success"])),
    }


def evaluate(plan: list[tuple[Scenario, list[int]]], workers: int, replays: FilePath | None) -> dict[str, Any]:
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in METHODS}
    kept: set[tuple[str, str]] = set()
    for scenario, seeds in plan:
        feasible = {seed: is_feasible(scenario, seed) for seed in seeds}
        runs = {(seed, name): SweepRun(seed, settings) for seed in seeds for name, settings in METHODS.items()}
        names = {run.key(""): name for (_, name), run in runs.items()}
        for run, metrics in run_all(scenario, list(runs.values()), workers):
            name = names[run.key("")]
            rows[name].append({**metrics, "feasible": feasible[run.seed]})
            failure = failure_class(metrics)
            print(f"{scenario.name:18} seed {run.seed:3} {name:26} {metrics['outcome']:22} {failure}", flush=True)
            if replays is not None and failure and (name, failure) not in kept:
                kept.add((name, failure))
                keep_replay(scenario, run, replays / f"{name} {failure}".replace("*", "star").replace(" ", "_"))
    return {name: summarise(of_method) for name, of_method in rows.items()}


def keep_replay(scenario: Scenario, run: SweepRun, folder: FilePath) -> None:
    settings = dict(run.settings)
    run_scenario(scenario, RunOptions(folder, settings.pop("backend", None), run.seed, settings=settings))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two small terrains instead of 200")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=20, help="terrains of each of the ten difficulties")
    parser.add_argument("--data", type=FilePath, default=FilePath("../shared/data"))
    parser.add_argument("--replays", type=FilePath, help="folder for one replay of each class of failure")
    arguments = parser.parse_args()
    if arguments.quick:
        plan = [(generated(0.4, (16.0, 14.0)), [1, 2])]
    else:
        plan = [(generated(level / 9.0, (30.0, 24.0)), list(range(arguments.seeds))) for level in range(10)]
        plan += [(scenario, [0]) for scenario in real(arguments.data)]
    figures = evaluate(plan, arguments.workers, arguments.replays)
    for name, line in figures.items():
        print(f"{name:26} {line}")
    if arguments.json:
        flat = max(figures["flat A*"]["success_percent"], 1.0)
        ratio = {"mesh_over_flat_success": round(figures["mesh any_angle"]["success_percent"] / flat, 2)}
        print(json.dumps({"figures": figures, "ratios": ratio}))


if __name__ == "__main__":
    main()
