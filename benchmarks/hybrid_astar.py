"""Hybrid A* on real maps: how many routes are solved, how long it takes, and how far from the least cost they are.

    python benchmarks/hybrid_astar.py [--quick] [--json] [--pairs 20] [--seed 14] [--naive] [--data ../shared/data]

Ten maps, 20 random pairs of poses on each (``--quick``: three), at which the car of ``terrain`` fits, headings and all:
0.92 m x 0.58 m, turning circle of 1.06 m, costs inflated to 0.75 m. A pair that not even a point can drive between is
drawn again. Every path is looked at by rules of its own: no lethal cell under the outline (drawn in by a third of a
cell, as the planner looks at points), poses at most a cell apart, no turn tighter than the circle.

A path that holds proves that its pair can be reached. For every other pair the naive search is asked: uniform cost over
all bins of cell and heading, the same six arcs, no heuristic, from the start only, no limit of states, and from every
state within three metres of the goal a free curve to it. ``--naive`` asks it about the solved ones, too (half a minute
a pair on the large maps), for the ratio of the costs.

Times are CPU times of the whole call, the first one on a map included; kernels are compiled before, on another map.
"""

from __future__ import annotations

import argparse
import heapq
import json
import math
from collections.abc import Callable
from pathlib import Path
from time import thread_time

import numpy as np
from numba import types
from numba.typed import Dict

from mbf_abstract.compiling.decorators import kernel
from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_abstract.time.program_end import interruptible
from mbf_costmap_nav.files.map_io import load_image, load_map
from mbf_costmap_nav.grid.collision import footprint_costs
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.car.curves import curve_between
from mbf_costmap_nav.kernels.car.ground import driven_cost, fitting_cost, ground_of
from mbf_costmap_nav.kernels.car.motion_primitives import (
    MOTIONS,
    Car,
    change_of,
    curve_cost,
    direction_of,
    sample_arc,
    steering_of,
    weight_of,
)
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from mbf_costmap_nav.plugins import CostmapContext

CAR = Footprint([[0.75, 0.29], [-0.17, 0.29], [-0.17, -0.29], [0.75, -0.29]])
RADIUS = 1.06
HEADINGS = 72
NEAR = 3.0
"""Distance [m] of the goal from which the naive search tries curves."""
KEEP_OUT = 254


class StandingClock:
    """Time that stands still."""

    def now(self) -> float:
        """Return zero."""
        return 0.0


def movingai(file: Path, resolution: float, times: int = 1) -> Costmap:
    """Map of the MovingAI set, each of its cells as ``times`` x ``times`` cells of ``resolution`` [m]."""
    rows = file.read_text().split("map\n", 1)[1].splitlines()
    cells = np.array([[0 if c in ".G" else 254 for c in row] for row in rows if row], dtype=np.uint8)
    cells = cells[::-1].repeat(times, axis=0).repeat(times, axis=1)
    return Costmap(np.ascontiguousarray(cells), resolution)


def maps(data: Path) -> dict[str, Callable[[], Costmap]]:
    """The ten maps by name, each read when it is called."""
    nav2, tests, willow = (data / "maps" / name for name in ("nav2_bringup", "nav2_system_tests", "willow_garage"))
    return {
        "depot": lambda: load_map(nav2 / "depot.yaml").to_costmap(),
        "tb3_sandbox": lambda: load_map(nav2 / "tb3_sandbox.yaml").to_costmap(),
        "warehouse": lambda: load_map(nav2 / "warehouse.yaml").to_costmap(),
        "system_tests": lambda: load_image(tests / "map.pgm", 0.05).to_costmap(),
        "map_circular": lambda: load_map(tests / "map_circular.yaml").to_costmap(),
        "willow_0.05": lambda: load_image(willow / "willow-full-0.05.pgm", 0.05).to_costmap(),
        "willow_0.1": lambda: load_image(willow / "willow-full.pgm", 0.1).to_costmap(),
        "turtlebot3": lambda: load_map(data / "maps/turtlebot3/map.yaml").to_costmap(),
        "64room": lambda: movingai(data / "movingai/rooms/64room_000.map", 0.5, 2),
        "maze32": lambda: movingai(data / "movingai/mazes/maze512-32-0.map", 0.1),
    }


def inflated(static: Costmap) -> LayeredCostmap:
    """The map as a server would hold it."""
    layers = [{"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"}]
    parameters = CostmapParameters(
        track_unknown_space=True, footprint=CAR.vertices.tolist(), footprint_padding=0.0, layers=layers
    )
    blocks = {"inflation": {"inflation_radius": 0.75, "cost_scaling_factor": 3.0}}
    costmap = build_layered_costmap(parameters, blocks, static_map=static)
    costmap.update(None, 0.0)
    return costmap


def planner_on(costmap: LayeredCostmap) -> HybridAStarPlanner:
    """The planner with its defaults but for the car."""
    parameters = HybridAStarPlanner.Parameters(min_turning_radius=RADIUS, allow_unknown=False)
    rng = np.random.default_rng(0)
    return HybridAStarPlanner(CostmapContext("benchmark", parameters, StandingClock(), rng, None, costmap))


def random_pose(costmap: Costmap, rng: np.random.Generator) -> np.ndarray:
    """A pose at which the car fits."""
    ground = ground_for(costmap)
    extent = np.array([costmap.width, costmap.height]) * costmap.resolution
    while True:
        place = (costmap.origin_x, costmap.origin_y) + rng.uniform(size=2) * extent
        pose = np.append(place, rng.uniform(-math.pi, math.pi))
        if fitting_cost(ground, pose) >= 0:
            return pose


def ground_for(costmap: Costmap):
    """The map and the car as the kernels take them."""
    geometry = np.array([costmap.resolution, costmap.origin_x, costmap.origin_y])
    return ground_of(costmap.cells, KEEP_OUT, geometry, FootprintCheck(CAR, costmap.resolution).samples)


def fault_of(costmap: Costmap, result: PlanResult, goal: np.ndarray) -> str:
    """What is wrong with a path, by rules of its own; "" if it can be driven."""
    path = result.path
    points, yaws = path.positions[:, :2], np.unwrap([pose.yaw for pose in path])
    steps, turns = np.hypot(*np.diff(points, axis=0).T), np.abs(np.diff(yaws))
    outline = CAR.padded(-0.3 * costmap.resolution)
    if not np.allclose(points[-1], goal[:2], atol=1e-6) or abs(math.remainder(yaws[-1] - goal[2], 2 * math.pi)) > 1e-6:
        return "does not end at the goal"
    if steps.max(initial=0.0) > costmap.resolution + 1e-6:
        return "poses are more than a cell apart"
    if (turns > 1.02 * steps / RADIUS + 1e-6).any():
        return "turns tighter than the car"
    if any(footprint_costs(costmap, outline, x, y, yaw).lethal for (x, y), yaw in zip(points, yaws, strict=True)):
        return "runs into an obstacle"
    return ""


@kernel
def naive_cost(ground, car, start, goal, best):
    """Least cost of a way by trying everything; inf if there is none. ``best`` is an empty Dict of int64 to float64."""
    resolution = ground.geometry[0]
    arc, found = np.empty((car.pieces, 3)), np.inf
    queue = [(0.0, start[0], start[1], start[2], 0.0)]
    pose = np.empty(3)
    while len(queue) > 0 and queue[0][0] < found:
        g, pose[0], pose[1], pose[2], before = heapq.heappop(queue)
        if np.hypot(pose[0] - goal[0], pose[1] - goal[1]) < NEAR:
            word = curve_between(pose, goal, car.radius, car.reversing)
            found = min(found, g + curve_cost(ground, car, pose, word, before, 0.0, found - g))
        for motion in range(MOTIONS):
            sample_arc(pose, motion, 1.0, car, arc)
            reached, direction = arc[car.pieces - 1], direction_of(motion)
            heading = int(np.floor(reached[2] / (2.0 * np.pi) * HEADINGS + 0.5)) % HEADINGS
            ix = int((reached[0] - ground.geometry[1]) / resolution)
            iy = int((reached[1] - ground.geometry[2]) / resolution)
            key = (iy * ground.cells.shape[1] + ix) * HEADINGS + heading
            weight = car.step * weight_of(car, steering_of(motion), direction)
            g_new = g + weight + change_of(car, before, direction)
            if key in best and best[key] <= g_new:
                continue
            cost = driven_cost(ground, pose, arc)
            g_new += weight * car.cost_factor * cost / 252.0
            if cost < 0.0 or (key in best and best[key] <= g_new):
                continue
            best[key] = g_new
            heapq.heappush(queue, (g_new, reached[0], reached[1], reached[2], direction))
    return found


def ask_naive(costmap: Costmap, start: np.ndarray, goal: np.ndarray) -> float:
    """Cost of the naive search's way, inf without one."""
    step = max(1.5 * costmap.resolution, 2.0 * math.pi / HEADINGS * RADIUS)
    pieces = math.ceil(step / costmap.resolution - 1e-9)
    car = Car(RADIUS, True, 2.0, 2.0, 1.05, 0.3, costmap.resolution, step, pieces)
    return naive_cost(ground_for(costmap), car, start, goal, Dict.empty(types.int64, types.float64))


def routes_on(name: str, costmap: LayeredCostmap, pairs: int, seed: int, naive: bool) -> list[dict]:
    """Plan between random pairs; a record of each."""
    rng, planner, grid, records = np.random.default_rng(seed), planner_on(costmap), costmap.snapshot(), []
    while len(records) < pairs:
        start, goal = random_pose(grid, rng), random_pose(grid, rng)
        request = PlanRequest(Pose.planar(*start), Pose.planar(*goal))
        begin = thread_time()
        result = planner.make_plan(request)
        seconds = thread_time() - begin
        if "not even for a robot that is a point" in result.message:
            continue
        fault = fault_of(grid, result, goal) if result.success else ""
        least = ask_naive(grid, start, goal) if naive or not result.success or fault else None
        records.append(
            {
                "map": name,
                "seconds": seconds,
                "solved": bool(result.success) and not fault,
                "reachable": bool(result.success and not fault) or bool(least is not None and math.isfinite(least)),
                "cost": result.cost if result.success else None,
                "least": least,
                "fault": fault or ("" if result.success else result.message),
            }
        )
    return records


def line_of(name: str, records: list[dict]) -> str:
    """One line on some routes."""
    times = np.array([record["seconds"] for record in records])
    reachable, solved = (sum(record[key] for record in records) for key in ("reachable", "solved"))
    ratios = [record["cost"] / record["least"] for record in records if record["solved"] and record["least"]]
    text = f"{name:13s} {len(records):4d} pairs, {reachable:4d} reachable, {solved:4d} solved;"
    text += (
        f" median {1e3 * np.median(times):6.1f} ms, 99 % {np.quantile(times, 0.99):5.2f} s, max {times.max():5.2f} s"
    )
    return text + (f"; cost / least: median {np.median(ratios):.3f}, max {max(ratios):.2f}" if ratios else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three pairs a map")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    parser.add_argument("--pairs", type=int, default=20, help="on each map")
    parser.add_argument("--seed", type=int, default=14)
    parser.add_argument("--naive", action="store_true", help="ask the naive search about solved pairs, too")
    parser.add_argument("--maps", nargs="*", help="only these")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    arguments = parser.parse_args()
    warm = inflated(Costmap(np.zeros((60, 60), dtype=np.uint8), 0.1))
    planner_on(warm).make_plan(PlanRequest(Pose.planar(1.5, 1.5), Pose.planar(4.0, 4.0, 2.0)))
    records = []
    for name, read in maps(arguments.data).items():
        if arguments.maps and name not in arguments.maps:
            continue
        pairs = 3 if arguments.quick else arguments.pairs
        of_map = routes_on(name, inflated(read()), pairs, arguments.seed, arguments.naive)
        print(line_of(name, of_map), flush=True)
        records += of_map
    print(line_of("all", records))
    reachable = [record for record in records if record["reachable"]]
    print(line_of("reachable", reachable))
    for record in records:
        if record["reachable"] and not record["solved"]:
            print(f"missed on {record['map']}: {record['fault']}")
    if arguments.json:
        print(json.dumps(records))


if __name__ == "__main__":
    with interruptible():
        main()
