"""One robot of ours behind a slower one in a hall, on both maps: how long it takes, and whom it touches.

    python benchmarks/overtaking.py --quick
    python benchmarks/overtaking.py --seeds 0:20 --maps costmap mesh --json results.jsonl

A hall of 24 m; the other robot, ahead, goes the same way, on a line up to 0.5 m beside ours. A seed draws the hall's
width, both lines, and the speed of the other one, from a fifth of ours to equally fast. ``free`` is the time without
the other one; ``behind`` is how long it takes to follow it to the goal. Who passes needs little more than the first;
nobody should need more than the second by much.
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
from moving_worlds import cut, floor
from seeds import seed_list

from mbf_abstract.time.program_end import interruptible
from terrain.scenarios.actors import OtherRobot
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import Scenario
from terrain.session.runner import RunOptions, run_scenario

CONTROLLERS = {"costmap": ("regulated_pure_pursuit", "dwa", "mppi"), "mesh": ("path_follower", "mppi")}
EXECUTIVES = ("move_base", "navigation")
SPEED = 0.5  # m/s, of our robot
SUMMED = ("lost", "contacts_while_moving", "time", "free", "behind", "planner_calls", "recoveries")
START, GOAL = 1.5, 20.5  # m, along the hall


def scenario_of(seed: int, folder: Path, on: str, alone: bool) -> tuple[Scenario, float]:
    """Write the hall into a folder and return its scenario, and how long [s] the other one takes to our goal."""
    rng = np.random.default_rng(seed)
    width, speed, gap = (float(rng.uniform(*limits)) for limits in ((1.6, 7.0), (0.1, SPEED), (1.2, 4.0)))
    low, high = 1.1, width - 0.1
    ours = float(rng.uniform(low, high))
    others, end = (float(np.clip(ours + rng.uniform(-0.5, 0.5), low, high)) for _ in range(2))
    free = floor(25.0, width + 1.0)
    cut(free, 0.5, 24.5, 0.5, width + 0.5)
    settings = Path(__file__).with_name("moving.yaml" if on == "costmap" else "moving_mesh.yaml").resolve()
    other = OtherRobot(type="robot", route=((START + gap, others), (23.5, others)), speed=speed, start=0.0)
    scenario = Scenario(
        name="overtaking",
        proves="The robot passes who is slower.",
        backend=on,
        navigation={on: settings},
        world=moving.floor_of(free, folder),
        robot="turtlebot",
        start=PlanarPose(x=START, y=ours, yaw=0.0),
        goals=(PlanarPose(x=GOAL, y=end, yaw=0.0),),
        sensors=(Sensor(max_range=8.0),),
        actors=() if alone else (other,),
        physics="kinematic",
        time_limit=moving.TIME_LIMIT,
    )
    return scenario, (GOAL - START - gap) / speed


def run(seed: int, on: str, controller: str, executive: str) -> dict[str, Any]:
    """Drive one seed without and with the other robot."""
    row: dict[str, Any] = {"map": on, "controller": controller, "executive": executive, "seed": seed}
    for alone in (True, False):
        with tempfile.TemporaryDirectory() as name:
            scenario, behind = scenario_of(seed, Path(name), on, alone)
            (source,) = scenario.navigation.values()
            own = yaml.safe_load(source.read_text())
            own["controllers"][0]["type"] = controller
            recoveries = [*own["recovery_behaviors"], {"name": "wait", "type": "wait"}]
            recoveries.append({"name": "move_away", "type": "move_away"})
            settings = {"recovery_behaviors": json.dumps(recoveries), "controllers": json.dumps(own["controllers"])}
            options = RunOptions(Path(name) / "run", seed=seed, executive=executive, settings=settings)
            result = run_scenario(scenario, options)
        found = result.metrics
        if alone:
            row |= {"free": round(found["time_s"], 1)}
            continue
        row |= {
            "behind": round(max(behind, row["free"]), 1),
            "time": round(found["time_s"], 1),
            "lost": 1 - len(found["arrivals"]),
            "contacts": found["collisions"],
            "contacts_while_moving": found["collisions_while_moving"],
            "planner_calls": found["planner_calls"],
            "recoveries": found["recoveries"],
            "verdict": str(result.verdict),
            "digest": found["digest"],
        }
    return row


def main() -> None:
    """Run what the command line asks for and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--seeds", type=seed_list, default="0:5", help="first and one past the last, or a list")
    parser.add_argument("--maps", nargs="*", choices=tuple(CONTROLLERS), default=list(CONTROLLERS))
    parser.add_argument("--controllers", nargs="*", help="of these only")
    parser.add_argument("--executives", nargs="*", choices=EXECUTIVES, default=list(EXECUTIVES))
    parser.add_argument("--json", type=Path, help="append one line for each run to this file")
    asked = parser.parse_args()
    kinds = [
        (on, controller)
        for on in asked.maps
        for controller in CONTROLLERS[on]
        if not asked.controllers or controller in asked.controllers
    ]
    rows = []
    for seed, kind, executive in product([0] if asked.quick else asked.seeds, kinds, asked.executives):
        rows.append(row := run(seed, *kind, executive))
        times = f"{row['time']} s (free {row['free']}, behind {row['behind']})"
        print(f"{' '.join(kind)}, {executive}, seed {seed}: {times}; {row['verdict']}", flush=True)
        if asked.json is not None:
            with asked.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    for kind, executive in product(kinds, asked.executives):
        own = [row for row in rows if (row["map"], row["controller"], row["executive"]) == (*kind, executive)]
        sums = {key: sum(row[key] for row in own) for key in SUMMED}
        print(
            f"{' '.join(kind):30} {executive:10} legs {len(own)}, lost {sums['lost']}, our robot moved in a contact "
            f"{sums['contacts_while_moving']} times, {sums['time']:.0f} s; free {sums['free']:.0f} s, "
            f"behind {sums['behind']:.0f} s; {sums['planner_calls']} plans, {sums['recoveries']} recoveries"
        )


if __name__ == "__main__":
    with interruptible():
        main()
