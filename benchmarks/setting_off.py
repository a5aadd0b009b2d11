"""Our robot passes others that load and set off again, on Table I's own layers and controllers, and touches nobody.

    python benchmarks/setting_off.py --quick
    python benchmarks/setting_off.py --seeds 0:40 --json rows.jsonl

A hall of 20 m. Along it shuttles go to and fro between two bays each, and stand in each of them for 5 s. They stop for
what is near ahead of them and where they turn, and see nothing beside them. Our robot goes to the other end of the hall
and back, past all of them, twice. A seed draws width, bays and speeds. A contact is ours if our robot moved.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from moving_worlds import RESOLUTION, cut, floor
from seeds import seed_list

from mbf_abstract.geometry import Pose
from mbf_abstract.time.program_end import interruptible
from terrain.experiments.table1 import repetition
from terrain.experiments.table1.conditions import Surroundings
from terrain.experiments.table1.environments.warehouse_environment import WarehouseEnvironment
from terrain.experiments.table1.main_run.conditions import CONDITIONS
from terrain.experiments.table1.main_run.trial import NAVIGATION
from terrain.worlds.occupancy import OccupancyGrid

LENGTH, SHUTTLES, LEGS = 20.0, 5, 4
WIDTHS, HEAD_START = (2.1, 3.2), (5.0, 60.0)  # m, s
EXECUTIVES = ("move_base", "full_tree")
WORLD_STREAM = 7  # beside those of the environment


@dataclass(frozen=True)
class LoadingBays:
    """The hall of a seed."""

    width: float
    routes: tuple[tuple[tuple[float, float], ...], ...]

    @property
    def start(self) -> tuple[float, float, float]:
        """Where our robot starts: x, y [m], yaw [rad]."""
        return 1.5, 0.5 + 0.5 * self.width, 0.0

    def grid(self) -> OccupancyGrid:
        """Return the floor."""
        free = floor(LENGTH + 1.0, self.width + 1.0)
        cut(free, 0.5, LENGTH + 0.5, 0.5, self.width + 0.5)
        return OccupancyGrid(~free, free, RESOLUTION)

    def goals(self) -> list[Pose]:
        """Return the ends of the hall by turns."""
        middle = 0.5 + 0.5 * self.width
        return [Pose.planar(*((LENGTH - 0.5, middle, 0.0) if leg % 2 == 0 else self.start)) for leg in range(LEGS)]


def draw(rng: np.random.Generator) -> LoadingBays:
    """Each shuttle has its own part of the hall, with one bay beside each wall or both beside one."""
    width = float(rng.uniform(*WIDTHS))
    part = (LENGTH - 5.0) / SHUTTLES
    routes = []
    for k in range(SHUTTLES):
        xs = 3.0 + part * k + rng.uniform(0.5, part - 0.5, 2)
        ys = 0.5 + rng.choice([0.5, width - 0.5], 2) + rng.uniform(-0.05, 0.05, 2)
        routes.append(tuple(zip(xs.tolist(), ys.tolist(), strict=True)))
    return LoadingBays(width, tuple(routes))


def run(seed: int, executive: str, blind: bool) -> dict[str, Any]:
    """Drive one seed."""
    rng = np.random.default_rng([seed, WORLD_STREAM])
    world, ahead = draw(rng), float(rng.uniform(*HEAD_START))
    with WarehouseEnvironment(
        world, Surroundings(robots=SHUTTLES, polite=not blind), seed, NAVIGATION, ahead
    ) as environment:
        tally = repetition.drive(environment, CONDITIONS[executive].executive(environment.navigator), 0.0).tally
    return {
        "seed": seed,
        "executive": executive,
        "blind": blind,
        "times": [leg.time for leg in tally.legs],
        "lost": sum(leg.end != "reached" for leg in tally.legs),
        "contacts": tally.contacts,
    }


def main() -> None:
    """Run what the command line asks for and print a line for each run and each executive."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--seeds", type=seed_list, default="0:10", help="first and one past the last, or a list")
    parser.add_argument("--executives", nargs="*", choices=EXECUTIVES, default=list(EXECUTIVES))
    parser.add_argument("--blind", action="store_true", help="the others stop for nobody")
    parser.add_argument("--json", type=Path, help="append one line for each run to this file")
    asked = parser.parse_args()
    rows = []
    for seed in [0] if asked.quick else asked.seeds:
        for executive in asked.executives:
            rows.append(row := run(seed, executive, asked.blind))
            print(row, flush=True)
            if asked.json is not None:
                with asked.json.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    for executive in asked.executives:
        own = [row for row in rows if row["executive"] == executive]
        ours = sum(row["contacts"].get("robot/we", 0) for row in own)
        time = sum(sum(row["times"]) for row in own)
        legs, lost = sum(len(row["times"]) for row in own), sum(row["lost"] for row in own)
        print(f"{executive:10} legs {legs}, lost {lost}, our robot moved in a contact {ours} times, {time:.0f} s")


if __name__ == "__main__":
    with interruptible():
        main()
