"""The buildings of the main run: the warehouse, Nav2's depot, and a family of drawn floor plans."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.geometry import Pose
from terrain.experiments.table1.environments.world import WAREHOUSE, World, load_world
from terrain.experiments.table1.main_run import floor_plans
from terrain.experiments.table1.main_run.floor_plans import PlanarPoint, PlanarPose, draw_world, has_detours
from terrain.worlds.occupancy import OccupancyGrid

HEAD_START = (30.0, 240.0)  # s; for so long the others have been driving when a run begins
HEAD_START_STREAM = 5  # beside the streams of the environment and of the floor plans
LEGS = 3  # of the six waypoints of a world a seed drives the first three or the last three
WITH, WITHOUT = "with detours", "without"


def head_start(seed: int) -> float:
    """How long [s] the others have been driving when the run of a seed begins."""
    rng = np.random.default_rng([seed, HEAD_START_STREAM])
    return float(rng.uniform(*HEAD_START))


@dataclass(frozen=True)
class HalfRound:
    """A world of which the first or the last ``LEGS`` waypoints are driven to: more seeds for the same time."""

    whole: World
    second: bool

    @property
    def start(self) -> PlanarPose:
        """Where our robot starts: x, y [m], yaw [rad]."""
        if not self.second:
            return self.whole.start
        last = self.whole.goals()[LEGS - 1]
        return last.x, last.y, last.yaw

    @property
    def routes(self) -> tuple[tuple[PlanarPoint, ...], ...]:
        """Closed routes of the others [m]."""
        return self.whole.routes

    def grid(self) -> OccupancyGrid:
        """Return the floor."""
        return self.whole.grid()

    def goals(self) -> list[Pose]:
        """Return the waypoints as poses."""
        goals = self.whole.goals()
        return goals[LEGS:] if self.second else goals[:LEGS]


@dataclass(frozen=True)
class Building:
    """One building.

    Attributes
    ----------
    world : callable
        The world of a seed; the same for all seeds but in a family.
    detours : callable
        Whether a seed has detours: other routes where one is blocked.
    constants : mapping
        What the worlds are drawn from; empty where nothing is drawn.
    """

    name: str
    world: Callable[[int], World]
    detours: Callable[[int], bool]
    constants: Mapping[str, Any]

    def half_round(self, seed: int) -> HalfRound:
        """Return what is driven on a seed: by turns two seeds the first half and two the second."""
        return HalfRound(self.world(seed), seed // 2 % 2 == 1)

    def parameters(self) -> dict[str, Any]:
        """What a row of this building depends on: constants; the floor, waypoints and routes of seed 0; the legs."""
        world = self.world(0)
        grid = world.grid()
        floor = hashlib.sha256(grid.occupied.tobytes() + grid.free.tobytes()).hexdigest()
        goals = [[goal.x, goal.y, goal.yaw] for goal in world.goals()]
        found = {"floor": floor, "start": world.start, "goals": goals, "routes": world.routes}
        return {**self.constants, **found, "legs": LEGS, "head_start": HEAD_START}

    def group(self, seed: int) -> str:
        """Name of the rows of a seed in the table."""
        return f"{self.name}, {WITH if self.detours(seed) else WITHOUT}"


def buildings(depot: Path | None) -> dict[str, Building]:
    """The buildings by name; without a world file of the depot there are two.

    Raises
    ------
    ConfigError
        The world file is wrong.
    """
    found = [_fixed("warehouse", WAREHOUSE, False)]
    if depot is not None:
        found.append(_fixed("depot", depot, True))
    constants = {name: getattr(floor_plans, name) for name in dir(floor_plans) if name.isupper()}
    found.append(Building("plans", draw_world, has_detours, json.loads(json.dumps(constants))))
    return {building.name: building for building in found}


def _fixed(name: str, file: Path, detours: bool) -> Building:
    world = load_world(file)
    return Building(name, lambda seed: world, lambda seed: detours, {})
