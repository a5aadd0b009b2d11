"""Robots of our own in each other's way: how many runs end with all of them at their goals, and none stuck.

    python benchmarks/moving.py --quick
    python benchmarks/moving.py --seeds 0:50 --cases bay wide crossing --executive navigation --json results.jsonl
    python benchmarks/moving.py --pairs 100 --first-seed 1000 --json results.jsonl
    python benchmarks/moving.py --pairs 100 --first-seed 1000 --json results.jsonl --without
    python benchmarks/moving.py --cases warehouse_2 warehouse_5 warehouse_10 warehouse_20 --seeds 6000:6004
    python benchmarks/moving.py --map slope --seeds 0:4 --cases bay wide --executive navigation
    python benchmarks/moving.py --robots drawn --pairs 40 --first-seed 2156 --json results.jsonl

Cases: ``head_on`` are two robots in a short corridor of one robot's width, with a bay, without, or closed at one end;
``bay`` is a corridor of one robot's width with a pull-out place, ``dead_end`` one of which one robot comes out
while the other one wants to its closed end, ``wide`` one in which two robots can pass, all with two robots head on;
``crossing`` has four robots that come from four sides; ``warehouse_N`` N robots on drawn ways
between racks. A seed draws places, goals and headings, for each case by its name, so that a new case leaves the worlds
of the others as they are; runs up to 6e66dfa had other worlds for the same seeds. Parameters were chosen on seeds 100
to 199; report others.

``--without`` runs the same robots without ``right_of_way_behavior``. ``--map`` is what they drive on: a costmap, a mesh
of the same floor, or a mesh of the same floor on ground that rises along x by a tenth of the way (``slope``). Runs that
the file of ``--json`` holds are not run again.

``--robots drawn`` has fleets whose robots are not alike, see ``moving_fleets.py``; ``--map both`` lets each of them
have a map of its own kind, drawn like the rest. Their worlds are those of the seed, larger for larger robots.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from moving_fleets import Fleet, commands_beyond, drawn_fleet, stretched, write_configuration
from moving_worlds import CASES, RESOLUTION, Place
from numpy.typing import NDArray
from PIL import Image
from seeds import seed_list

from mbf_abstract.time.program_end import interruptible
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.robots import OwnRobot, Sensor
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.world_types import HeightfieldWorld, MapWorld
from terrain.session.runner import RunOptions, run_scenario

NAMES = (
    "anna", "ben", "carla", "dora", "emil", "fritz", "greta", "hans", "ida", "jan",
    "karl", "lena", "max", "nora", "otto", "paula", "ralf", "sina", "tom", "uta",
)  # fmt: skip
TIME_LIMIT = 240.0  # s for each goal
QUICK_SEEDS = [0, 1]

MAPS, BOTH = ("costmap", "mesh", "slope"), "both"
ROBOTS = ("equal", "drawn")
SETTINGS = {"costmap": "moving.yaml", "mesh": "moving_mesh.yaml"}
RISE, WALL_HEIGHT = 0.1, 1.0  # of the slope along x, as a share, and of the walls on it [m]

Row = dict[str, Any]
IDENTITY = ("map", "case", "seed", "executive", "right_of_way", "fleet")
"""Keys of a row that say which run it is of."""


def scenario_of(case: str, seed: int, folder: Path, on: str = "costmap", fleet: Fleet | None = None) -> Scenario:
    """Write the map of a case into a folder and return its scenario on one of ``MAPS``."""
    free, ways = CASES[case](np.random.default_rng([seed, zlib.crc32(case.encode())]))
    if fleet is not None:
        free = stretched(free, fleet.stretch)
    backend = "mesh" if on in ("mesh", "slope") else "costmap"
    scenario = Scenario(
        name=case,
        proves="All robots arrive.",
        backend=backend,
        navigation={backend: Path(__file__).with_name(SETTINGS[backend]).resolve()},
        world=slope_of(free, folder) if on == "slope" else floor_of(free, folder),
        robot="turtlebot",
        robots=tuple(
            OwnRobot(name=name, start=_pose(start, fleet), goals=(_pose(goal, fleet),))
            for name, (start, goal) in zip(NAMES[: len(ways)], ways, strict=True)
        ),
        sensors=(Sensor(max_range=8.0),),
        physics="kinematic",
        time_limit=TIME_LIMIT,
    )
    return scenario if fleet is None else _with_fleet(scenario, fleet, folder)


def _with_fleet(scenario: Scenario, fleet: Fleet, folder: Path) -> Scenario:
    """The scenario with the robots of a fleet, and configurations of their own in a folder."""
    robots = []
    for own, robot in zip(scenario.robots, fleet.robots, strict=True):
        base = Path(__file__).with_name(SETTINGS[robot.backend])
        file = write_configuration(robot, fleet, base, folder / f"{own.name}.yaml")
        robots.append(own.model_copy(update={**robot.parts(), "navigation": {robot.backend: file}}))
    return scenario.model_copy(update={"robots": tuple(robots), "time_limit": TIME_LIMIT * fleet.patience})


def floor_of(free: NDArray[np.bool_], folder: Path) -> MapWorld:
    """Write a floor into a folder, as a building."""
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(folder / "floor.png")
    header = f"image: floor.png\nresolution: {RESOLUTION}\norigin: [0.0, 0.0, 0.0]\n"
    (folder / "floor.yaml").write_text(header + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return MapWorld(type="map", file=folder / "floor.yaml")


def slope_of(free: NDArray[np.bool_], folder: Path, rise: float = RISE) -> HeightfieldWorld:
    """Write a floor into a folder, as open ground that rises along x, with blocks where the walls are."""
    stride = 2  # every second cell: a mesh of all would be slow to plan on
    cells = free[::stride, ::stride]
    heights = rise * stride * RESOLUTION * np.arange(cells.shape[1]) + np.where(cells, 0.0, WALL_HEIGHT)
    np.savez(folder / "slope.npz", z=heights[::-1], dx=stride * RESOLUTION, dy=stride * RESOLUTION)
    return HeightfieldWorld(type="heightfield", file=folder / "slope.npz")


def _pose(place: Place, fleet: Fleet | None) -> PlanarPose:
    (x, y, yaw), stretch = place, 1.0 if fleet is None else fleet.stretch
    return PlanarPose(x=stretch * x, y=stretch * y, yaw=yaw)


def run(
    case: str, seed: int, executive: str, right_of_way: bool = True, on: str = "costmap", is_drawn: bool = False
) -> Row:
    """Run one case with one seed; who arrived, contacts and recoveries."""
    settings = {} if right_of_way else {"right_of_way_behavior": '""'}
    fleet = drawn_fleet(case, seed, len(CASES[case](np.random.default_rng(0))[1]), on) if is_drawn else None
    beyond = 0

    def count_commands(folder: Path, recordings: Mapping[str, Recording], verdict: Verdict) -> tuple[str, ...]:
        nonlocal beyond
        if fleet is not None:
            beyond = commands_beyond(fleet, [one.commands for one in recordings.values()])
        return ()

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = RunOptions(
            folder / "run", seed=seed, executive=executive, settings=settings, write_joint_views=count_commands
        )
        result = run_scenario(scenario_of(case, seed, folder, on, fleet), options)
    robots = result.metrics["robots"]
    return {
        "map": on,
        "case": case,
        "seed": seed,
        "executive": executive,
        "right_of_way": right_of_way,
        "fleet": ROBOTS[is_drawn],
        "robots": len(robots),
        "arrived": sum(one["outcome_code"] == 0 for one in robots.values()),
        "contacts": len(result.metrics["contacts_between_robots"]),
        "contacts_while_moving": result.metrics["collisions_while_moving"],
        "commands_beyond": beyond,
        "recoveries": result.metrics["recoveries"],
        "planner_calls": result.metrics["planner_calls"],
        "time_s": round(result.metrics["time_s"], 1),
        "verdict": str(result.verdict),
        "digest": result.metrics["digest"],
    }


def summary(rows: list[Row]) -> Iterator[str]:
    """One line for each case, executive and arm: runs in which all arrived, legs lost, contacts."""
    for arm in dict.fromkeys(_arm(row) for row in rows):
        own = [row for row in rows if _arm(row) == arm]
        on, case, executive, right_of_way, fleet = arm
        resolved = sum(row["arrived"] == row["robots"] for row in own)
        lost, legs = sum(row["robots"] - row["arrived"] for row in own), sum(row["robots"] for row in own)
        contacts, moving = sum(row["contacts"] for row in own), sum(row["contacts_while_moving"] for row in own)
        arm_text = "" if right_of_way else "without right of way, "
        arm_text += "" if fleet == "equal" else f"{fleet} robots, commands beyond limits {_beyond(own)}, "
        yield (
            f"{on:8} {case:14} {executive:12} {arm_text}resolved {resolved} of {len(own)}, lost legs {lost} of {legs}, "
            f"contacts between robots {contacts}, contacts in which a robot moved {moving}, median time "
            f"{float(np.median([row['time_s'] for row in own])):.0f} s"
        )


def _arm(row: Row) -> tuple[str, str, str, bool, str]:
    return row["map"], row["case"], row["executive"], row["right_of_way"], row["fleet"]


def _beyond(rows: list[Row]) -> int:
    return sum(row["commands_beyond"] for row in rows)


def recorded(file: Path | None) -> dict[tuple[Any, ...], Row]:
    """Rows of a file by what run they are of; none if there is no such file yet."""
    lines = file.read_text(encoding="utf-8").splitlines() if file is not None and file.exists() else []
    rows = [{"map": "costmap", "fleet": "equal", **json.loads(line)} for line in lines]
    return {tuple(row[key] for key in IDENTITY): row for row in rows}


def main() -> None:
    """Run what the command line asks for and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two seeds of bay and crossing")
    parser.add_argument("--seeds", type=seed_list, default="0:10", help="first and one past the last, or a list")
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--executive", nargs="*", default=["move_base", "navigation"])
    parser.add_argument("--map", choices=[*MAPS, BOTH], default=MAPS[0], help="what they drive on")
    parser.add_argument("--robots", choices=ROBOTS, default=ROBOTS[0], help="whether they are alike")
    parser.add_argument("--pairs", type=int, help="so many pairs of head_on, instead of --cases")
    parser.add_argument("--first-seed", type=int, default=0, help="of --pairs")
    parser.add_argument("--without", action="store_true", help="the same robots without right_of_way_behavior")
    parser.add_argument("--json", type=Path, help="append one line for each run to this file, unless it holds it")
    asked = parser.parse_args()
    if asked.map == BOTH and asked.robots != "drawn":
        parser.error("--map both needs --robots drawn: robots that are alike have maps of one kind")
    cases, seeds = (["bay", "crossing"], QUICK_SEEDS) if asked.quick else (asked.cases, asked.seeds)
    if asked.pairs is not None:
        cases, seeds = ["head_on"], range(asked.first_seed, asked.first_seed + asked.pairs)
    known, rows = recorded(asked.json), []
    for seed, case, executive in product(seeds, cases, asked.executive):
        row = known.get((asked.map, case, seed, executive, not asked.without, asked.robots))
        if row is None:
            row = run(case, seed, executive, not asked.without, asked.map, asked.robots == "drawn")
            print(f"{case} {executive} seed {seed}: {row['arrived']} of {row['robots']}; {row['verdict']}", flush=True)
            if asked.json is not None:
                with asked.json.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
        rows.append(row)
    for line in summary(rows):
        print(line)


if __name__ == "__main__":
    with interruptible():
        main()
