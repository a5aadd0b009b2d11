"""One robot of ours among people and robots that cross its way and wait for it, on both maps, steep ground included.

    python benchmarks/moving_traffic.py --quick
    python benchmarks/moving_traffic.py --seeds 0:10 --maps costmap mesh steep --json results.jsonl
    python benchmarks/moving_traffic.py --robots drawn --people blind --seeds 0:10 --maps costmap mesh

A hall of 16 m x 8 m with two pillars; the robot drives through it and back, with the tree that asks who is in its way.
Two people cross, two robots drive to and fro along the hall; they stop while it is just ahead of them. A seed draws
places and speeds. ``mesh`` is the same floor, level; ``slope`` and ``steep`` rise along it by 0.1 and 0.3 of the way.

``--robots drawn`` has another robot for each seed: size, shape, drive, speeds, inertia, delays, noise and controller,
see ``moving_fleets.py``; the hall is larger for larger ones. With ``--people blind`` nobody stops for it.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

import moving
import numpy as np
import yaml
from moving_fleets import Fleet, drawn_fleet, stretched, write_configuration
from moving_worlds import cut, floor
from seeds import seed_list

from mbf_abstract.time.program_end import interruptible
from terrain.scenarios.actors import OtherRobot, Walker
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import Scenario
from terrain.session.runner import RunOptions, run_scenario

RISES = {"slope": 0.1, "steep": 0.3}
MAPS = ("costmap", "mesh", *RISES)
PEOPLE = ("polite", "blind")


def scenario_of(seed: int, folder: Path, on: str, fleet: Fleet | None = None, is_blind: bool = False) -> Scenario:
    """Write the hall into a folder and return its scenario on one of ``MAPS``; of a fleet, its first robot drives."""
    rng = np.random.default_rng(seed)
    stretch = 1.0 if fleet is None else fleet.stretch
    free = floor(17.0, 9.0)
    cut(free, 0.5, 16.5, 0.5, 8.5)
    for x, y in ((6.0, 3.0), (10.0, 5.5)):
        cut(free, x, x + 0.6, y, y + 0.6, is_free=False)
    free = stretched(free, stretch)
    y = rng.uniform(2.0, 7.0, size=4).tolist()
    people = [
        Walker(
            type="walker",
            route=((stretch * x, stretch * 1.2), (stretch * x, stretch * 7.8)),
            speed=float(rng.uniform(0.4, 0.9)),
            start=float(rng.uniform(0.0, 10.0)),
            blind=is_blind,
        )
        for x in (float(rng.uniform(4.5, 5.5)), float(rng.uniform(11.5, 12.5)))
    ]
    robots = [
        OtherRobot(
            type="robot",
            route=((stretch * 2.5, stretch * across), (stretch * 14.5, stretch * across)),
            speed=0.4,
            start=float(rng.uniform(0.0, 20.0)),
            blind=is_blind,
        )
        for across in y[2:]
    ]
    backend = "costmap" if on == "costmap" else "mesh"
    near, far = {"x": stretch * 1.5, "y": stretch * y[0]}, {"x": stretch * 15.5, "y": stretch * y[1]}
    scenario = Scenario(
        name="traffic",
        proves="The robot gets through and touches nobody.",
        backend=backend,
        navigation={backend: Path(__file__).with_name(moving.SETTINGS[backend]).resolve()},
        world=moving.slope_of(free, folder, RISES[on]) if on in RISES else moving.floor_of(free, folder),
        robot="turtlebot",
        start={**near, "yaw": 0.0},
        goals=[{**far, "yaw": 0.0}, {**near, "yaw": 3.0}],
        sensors=(Sensor(max_range=8.0),),
        actors=(*people, *robots),
        physics="kinematic",
        time_limit=moving.TIME_LIMIT,
    )
    return scenario if fleet is None else _with_robot(scenario, fleet, folder)


def _with_robot(scenario: Scenario, fleet: Fleet, folder: Path) -> Scenario:
    """The scenario with the first robot of a fleet, and a configuration of its own in a folder."""
    (robot, *_), ((backend, base),) = fleet.robots, scenario.navigation.items()
    file = write_configuration(robot, fleet, base, folder / "robot.yaml")
    limit = moving.TIME_LIMIT * fleet.patience
    return scenario.model_copy(update={**robot.parts(), "navigation": {backend: file}, "time_limit": limit})


def run(seed: int, on: str, is_drawn: bool = False, is_blind: bool = False) -> dict[str, Any]:
    """Drive one seed; legs lost, contacts, calls."""
    fleet = drawn_fleet("traffic", seed, 1, on) if is_drawn else None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenario = scenario_of(seed, folder, on, fleet, is_blind)
        (source,) = scenario.navigation.values()
        recoveries = [*yaml.safe_load(source.read_text())["recovery_behaviors"], {"name": "wait", "type": "wait"}]
        recoveries.append({"name": "move_away", "type": "move_away"})
        settings = {"recovery_behaviors": json.dumps(recoveries)}
        options = RunOptions(folder / "run", seed=seed, executive="navigation", settings=settings)
        result = run_scenario(scenario, options)
    found = result.metrics
    return {
        "map": on,
        "seed": seed,
        "robot": "turtlebot" if fleet is None else str(fleet.robots[0]),
        "people": PEOPLE[is_blind],
        "legs": 2,
        "lost": 2 - len(found["arrivals"]),
        "contacts": found["collisions"],
        "contacts_while_moving": found["collisions_while_moving"],
        "planner_calls": found["planner_calls"],
        "recoveries": found["recoveries"],
        "time_s": round(found["time_s"], 1),
        "verdict": str(result.verdict),
        "digest": found["digest"],
    }


def main() -> None:
    """Run what the command line asks for and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--seeds", type=seed_list, default="0:5", help="first and one past the last, or a list")
    parser.add_argument("--maps", nargs="*", choices=MAPS, default=list(MAPS))
    parser.add_argument(
        "--robots", choices=moving.ROBOTS, default=moving.ROBOTS[0], help="the usual one, or drawn ones"
    )
    parser.add_argument("--people", choices=PEOPLE, default=PEOPLE[0], help="whether they stop for the robot")
    parser.add_argument("--json", type=Path, help="append one line for each run to this file")
    asked = parser.parse_args()
    rows = []
    for seed, on in product([0] if asked.quick else asked.seeds, asked.maps):
        rows.append(row := run(seed, on, asked.robots == "drawn", asked.people == "blind"))
        print(f"{on} seed {seed}: {row['time_s']} s, {row['recoveries']} recoveries; {row['verdict']}", flush=True)
        if asked.json is not None:
            with asked.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    for on in asked.maps:
        own = [row for row in rows if row["map"] == on]
        sums = {key: sum(row[key] for row in own) for key in ("legs", "lost", "contacts", "contacts_while_moving")}
        print(
            f"{on:8} legs {sums['legs']}, lost {sums['lost']}, contacts {sums['contacts']}, of them our robot moved in "
            f"{sums['contacts_while_moving']}, median time {float(np.median([row['time_s'] for row in own])):.0f} s"
        )


if __name__ == "__main__":
    with interruptible():
        main()
