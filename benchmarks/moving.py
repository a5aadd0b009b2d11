"""Robots of our own in each other's way: how many runs end with all of them at their goals, and none stuck.

    python benchmarks/moving.py --quick
    python benchmarks/moving.py --seeds 0:50 --cases bay wide crossing --executive navigation --json results.jsonl
    python benchmarks/moving.py --pairs 100 --first-seed 1000

Cases: ``bay`` is a corridor of one robot's width with a pull-out place, ``dead_end`` one of which one robot comes out
while the other one wants to its closed end, ``wide`` one in which two robots can pass, all with two robots head on;
``crossing`` has four robots that come from four sides; ``warehouse_N`` N robots on drawn ways
between racks. A seed draws places, goals and headings, for each case by its name, so that a new case leaves the worlds
of the others as they are; runs up to 6e66dfa had other worlds for the same seeds. Parameters were chosen on seeds 100
to 199; report others.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from terrain.scenarios.places import PlanarPose
from terrain.scenarios.robots import OwnRobot, Sensor
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.world_types import MapWorld
from terrain.session.runner import RunOptions, run_scenario
from terrain.sweeps.command import parse_seeds

RESOLUTION = 0.05  # m
NAMES = ("anna", "ben", "carla", "dora", "emil", "fritz", "greta", "hans", "ida", "jan")
TIME_LIMIT = 240.0  # s for each goal
QUICK_SEEDS = "0:2"
PAIRS = ("bay", "dead_end")  # head on where only one can pass

Place = tuple[float, float, float]
Case = tuple[NDArray[np.bool_], list[tuple[Place, Place]]]


def floor(width: float, height: float) -> NDArray[np.bool_]:
    """A floor without any free place; row 0 at y = 0."""
    return np.zeros((round(height / RESOLUTION), round(width / RESOLUTION)), dtype=bool)


def cut(free: NDArray[np.bool_], x0: float, x1: float, y0: float, y1: float, is_free: bool = True) -> None:
    """Make a rectangle [m] free, or not."""
    columns, rows = (slice(round(a / RESOLUTION), round(b / RESOLUTION)) for a, b in ((x0, x1), (y0, y1)))
    free[rows, columns] = is_free


def corridor(rng: np.random.Generator, width: float, bay: bool) -> Case:
    """Two rooms joined by a corridor of 10 m; two robots change rooms."""
    free = floor(20.0, 6.0)
    cut(free, 0.5, 5.0, 0.5, 5.5)
    cut(free, 15.0, 19.5, 0.5, 5.5)
    cut(free, 5.0, 15.0, 3.0 - 0.5 * width, 3.0 + 0.5 * width)
    if bay:
        x = float(rng.uniform(6.5, 12.5))
        cut(free, x, x + 1.1, 3.0, 4.7)
    left, right = (2.0 + float(rng.uniform(-1.0, 1.5)), 18.0 - float(rng.uniform(-1.0, 1.5)))
    offsets = rng.uniform(-1.5, 1.5, size=4).tolist()
    west, east = (left, 3.0 + offsets[0], 0.0), (right, 3.0 + offsets[1], float(np.pi))
    return free, [(west, (right, 3.0 + offsets[2], 0.0)), (east, (left, 3.0 + offsets[3], float(np.pi)))]


def dead_end(rng: np.random.Generator) -> Case:
    """A room with a corridor of 0.9 m that ends after 8 m: one robot comes out, the other one goes in."""
    free = floor(14.0, 6.0)
    cut(free, 0.5, 5.0, 0.5, 5.5)
    cut(free, 5.0, 13.0, 2.55, 3.45)
    outside, offsets = 2.0 + float(rng.uniform(-1.0, 1.5)), rng.uniform(-1.5, 1.5, size=2).tolist()
    inside = 12.0 + float(rng.uniform(-1.0, 0.5))
    going_in = ((outside, 3.0 + offsets[0], 0.0), (inside, 3.0, 0.0))
    return free, [going_in, ((inside, 3.0, float(np.pi)), (outside, 3.0 + offsets[1], float(np.pi)))]


def crossing(rng: np.random.Generator) -> Case:
    """Two corridors of 1.4 m that cross; four robots, each goes straight on."""
    free = floor(14.0, 14.0)
    cut(free, 0.5, 13.5, 6.3, 7.7)
    cut(free, 6.3, 7.7, 0.5, 13.5)
    ways = []
    for angle in np.arange(4) * 0.5 * np.pi:
        c, s = float(np.cos(angle)), float(np.sin(angle))
        start, end = 4.5 + float(rng.uniform(0.0, 1.0)), 5.2 + float(rng.uniform(0.0, 0.6))
        side = 0.35  # those that come stand beside those that have arrived
        begin = (7.0 - start * c + side * s, 7.0 - start * s - side * c, float(angle))
        ways.append((begin, (7.0 + end * c + side * s, 7.0 + end * s - side * c, float(angle))))
    return free, ways


def warehouse(rng: np.random.Generator, robots: int) -> Case:
    """Rows of racks with aisles of 1.6 m; starts and goals are drawn, all 1.2 m apart from each other."""
    free = floor(20.0, 14.0)
    cut(free, 0.5, 19.5, 0.5, 13.5)
    for row in range(4):
        for x0, x1 in ((2.5, 8.7), (11.0, 17.3)):
            y = 2.1 + 2.6 * row
            cut(free, x0, x1, y, y + 1.0, is_free=False)
    places: list[Place] = []
    while len(places) < 2 * robots:
        x, y = float(rng.uniform(1.2, 18.8)), float(rng.uniform(1.2, 12.8))
        rows, columns = (slice(round((v - 0.5) / RESOLUTION), round((v + 0.5) / RESOLUTION)) for v in (y, x))
        if free[rows, columns].all() and all(np.hypot(x - a, y - b) > 1.2 for a, b, _ in places):
            places.append((x, y, float(rng.uniform(-np.pi, np.pi))))
    return free, list(zip(places[::2], places[1::2], strict=True))


CASES: dict[str, Callable[[np.random.Generator], Case]] = {
    "bay": lambda rng: corridor(rng, 0.9, True),
    "dead_end": dead_end,
    "wide": lambda rng: corridor(rng, 1.8, False),
    "crossing": crossing,
    "warehouse_2": lambda rng: warehouse(rng, 2),
    "warehouse_5": lambda rng: warehouse(rng, 5),
    "warehouse_10": lambda rng: warehouse(rng, 10),
}


def scenario_of(case: str, seed: int, folder: Path) -> Scenario:
    """Write the map of a case into a folder and return its scenario."""
    free, ways = CASES[case](np.random.default_rng([seed, zlib.crc32(case.encode())]))
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(folder / "floor.png")
    header = f"image: floor.png\nresolution: {RESOLUTION}\norigin: [0.0, 0.0, 0.0]\n"
    (folder / "floor.yaml").write_text(header + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    robots = tuple(
        OwnRobot(name=name, start=_pose(start), goals=(_pose(goal),))
        for name, (start, goal) in zip(NAMES, ways, strict=False)
    )
    return Scenario(
        name=case,
        proves="All robots arrive.",
        backend="costmap",
        navigation={"costmap": Path(__file__).with_suffix(".yaml").resolve()},
        world=MapWorld(type="map", file=folder / "floor.yaml"),
        robot="turtlebot",
        robots=robots,
        sensors=(Sensor(max_range=8.0),),
        physics="kinematic",
        time_limit=TIME_LIMIT,
    )


def _pose(place: Place) -> PlanarPose:
    x, y, yaw = place
    return PlanarPose(x=x, y=y, yaw=yaw)


def run(case: str, seed: int, executive: str) -> dict[str, Any]:
    """Run one case with one seed; who arrived, contacts and recoveries."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result = run_scenario(
            scenario_of(case, seed, folder), RunOptions(folder / "run", seed=seed, executive=executive)
        )
    robots = result.metrics["robots"]
    return {
        "case": case,
        "seed": seed,
        "executive": executive,
        "robots": len(robots),
        "arrived": sum(one["outcome_code"] == 0 for one in robots.values()),
        "contacts": len(result.metrics["contacts_between_robots"]),
        "contacts_while_moving": result.metrics["collisions_while_moving"],
        "recoveries": result.metrics["recoveries"],
        "planner_calls": result.metrics["planner_calls"],
        "time_s": round(result.metrics["time_s"], 1),
        "verdict": str(result.verdict),
        "digest": result.metrics["digest"],
    }


def summary(rows: list[dict[str, Any]]) -> Iterator[str]:
    """One line for each case and executive: runs in which all arrived, legs lost, contacts."""
    for case, executive in dict.fromkeys((row["case"], row["executive"]) for row in rows):
        own = [row for row in rows if (row["case"], row["executive"]) == (case, executive)]
        resolved = sum(row["arrived"] == row["robots"] for row in own)
        lost, legs = sum(row["robots"] - row["arrived"] for row in own), sum(row["robots"] for row in own)
        contacts, moving = sum(row["contacts"] for row in own), sum(row["contacts_while_moving"] for row in own)
        yield (
            f"{case:14} {executive:12} resolved {resolved} of {len(own)}, lost legs {lost} of {legs}, contacts between "
            f"robots {contacts}, contacts in which a robot moved {moving}, median time "
            f"{float(np.median([row['time_s'] for row in own])):.0f} s"
        )


def main() -> None:
    """Run what the command line asks for and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two seeds of bay and crossing")
    parser.add_argument("--seeds", default="0:10", help="first and one past the last, or a list")
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--executive", nargs="*", default=["move_base", "navigation"])
    parser.add_argument("--pairs", type=int, help=f"so many pairs of {' and '.join(PAIRS)} each, instead of --cases")
    parser.add_argument("--first-seed", type=int, default=0, help="of --pairs")
    parser.add_argument("--json", type=Path, help="append one line for each run to this file")
    asked = parser.parse_args()
    cases, seeds = (["bay", "crossing"], QUICK_SEEDS) if asked.quick else (asked.cases, asked.seeds)
    if asked.pairs is not None:
        cases, seeds = list(PAIRS), f"{asked.first_seed}:{asked.first_seed + asked.pairs}"
    rows = []
    for seed in parse_seeds(seeds):
        for case in cases:
            for executive in asked.executive:
                row = run(case, seed, executive)
                rows.append(row)
                print(
                    f"{case} {executive} seed {seed}: {row['arrived']} of {row['robots']}; {row['verdict']}", flush=True
                )
                if asked.json is not None:
                    with asked.json.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
    for line in summary(rows):
        print(line)


if __name__ == "__main__":
    main()
