"""The outdoor evaluation: generated terrains of rising difficulty, and crops of real surveys.

A Husky with exact localisation crosses each from one corner to the opposite one, in Bullet at 120 Hz, without sensors,
so that nothing but the ground is in the way. Surveys coarser than a robot are shrunk isotropically: their slopes stay
what they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.experiments.evaluation.protocol import Protocol, Trial, read_entries
from terrain.experiments.evaluation.reachability import DrivingLimits, is_reachable
from terrain.physics.robot_models import HUSKY
from terrain.scenarios.environment import WORLD_STREAM
from terrain.scenarios.limits import Limits
from terrain.scenarios.places import coordinates
from terrain.scenarios.scenario import PlanarPose, Scenario
from terrain.scenarios.world_types import GeneratedWorld, HeightfieldWorld
from terrain.worlds.elevation_files import read_dem
from terrain.worlds.heightfield import Heightfield

SIZE = (24.0, 20.0)
SPACING = 0.25
LEVELS = 10
FROM_CORNER = 2.5
TOLERANCE = 0.4  # m, of the goal, as in the configurations
SUCCESS = "the verdict of mbf run: in truth at the goal, not tipped over, nothing touched while it moved, in time"
FLAT_LETHAL_SLOPE = 30.0
FOLDER = Path(__file__).parent / "config"
CONFIGS = {name: FOLDER / f"outdoor_{name}.yaml" for name in ("mesh", "costmap")}
SURVEYS = {"kootenai_1m.npz": 1.0, "N44W072.hgt": 0.5 / 90.0, "jacksboro.npz": 0.5 / 80.0, "bigtujunga.npz": 0.5 / 30.0}
CROPS = 10  # of every survey


def scenario_in(name: str, world: GeneratedWorld | HeightfieldWorld, corner: tuple[float, float]) -> Scenario:
    """A drive across a world whose lower left corner lies at ``corner``."""
    (x, y), (length, width) = corner, SIZE
    yaw = math.atan2(width - 2.0 * FROM_CORNER, length - 2.0 * FROM_CORNER)
    return Scenario(
        name=name,
        proves="A robot crosses rough ground.",
        backend="mesh",
        navigation=CONFIGS,
        world=world,
        robot="husky",
        start=PlanarPose(x=x + FROM_CORNER, y=y + FROM_CORNER, yaw=yaw),
        goals=(PlanarPose(x=x + length - FROM_CORNER, y=y + width - FROM_CORNER, yaw=yaw),),
        physics_rate=120.0,
        time_limit=120.0,
        limits=Limits(goal_distance=TOLERANCE),  # and not the tolerance that an entrant may set
    )


def generated(level: int) -> Scenario:
    """Ground of a level from 0 to 9: steeper and rougher hills, deeper ruts, more boulders."""
    difficulty, (length, width) = level / (LEVELS - 1), SIZE
    boulders = {"type": "boulders", "density": 1.0 + 4.0 * difficulty, "radius_min": 0.2, "radius_max": 0.8}
    ruts = {"type": "ruts", "points": ((0.0, 0.6 * width), (length, 0.4 * width)), "depth": 0.1 + 0.1 * difficulty}
    world = GeneratedWorld(
        type="generated",
        size=SIZE,
        spacing=SPACING,
        median_slope=4.0 + 14.0 * difficulty,
        roughness=0.02 * difficulty,
        features=(ruts, boulders),  # type: ignore[arg-type]
        lethal_slope=FLAT_LETHAL_SLOPE,
    )
    return scenario_in(f"level {level}", world, (0.0, 0.0))


@lru_cache
def _survey(file: Path) -> Heightfield:
    return read_dem(file)


def real(file: Path, seed: int, scale: float) -> Scenario:
    """A crop of a survey that is shrunk by ``scale``, drawn from the seed."""
    survey = _survey(file)
    length, width = (side / scale for side in SIZE)
    rng = np.random.default_rng(seed)
    x = survey.x0 + rng.uniform(0.0, survey.size[0] - length)
    y = survey.y0 + rng.uniform(0.0, survey.size[1] - width)
    crop = survey.crop(x, x + length, y, y + width)
    world = HeightfieldWorld(
        type="heightfield",
        file=file,
        crop=(x, x + length, y, y + width),
        size=crop.size[0] * scale,
        spacing=SPACING,
        lethal_slope=FLAT_LETHAL_SLOPE,
    )
    return scenario_in(file.stem, world, (crop.x0 * scale, crop.y0 * scale))


def outdoor(seeds: Sequence[int], levels: Sequence[int] = range(LEVELS), surveys: Path | None = None) -> Protocol:
    """Return version 1: these levels with every seed; and with a crop of every survey for each of the first ten seeds.

    Parameters
    ----------
    surveys : Path, optional
        Folder with the files of ``SURVEYS``; without it there are no crops.

    Raises
    ------
    ConfigError
        A survey is missing; all that are.
    """
    files = [] if surveys is None else [(surveys / name).resolve() for name in SURVEYS]
    missing = [
        Finding(str(surveys), 1, "--surveys", f"a file {file.name}", "none") for file in files if not file.is_file()
    ]
    if missing:
        raise ConfigError(missing)
    trials = []
    for number, seed in enumerate(seeds):  # easy and hard ones mixed, so that a part is representative
        trials += [Trial(generated(level), seed) for level in levels]
        if number < CROPS:
            trials += [Trial(real(file, seed, SURVEYS[file.name]), seed) for file in files]
    return Protocol(
        "outdoor",
        "v1",
        "A Husky crosses 24 x 20 m of rough ground in ten levels of difficulty, corner to corner, in Bullet.",
        "mesh",
        trials,
        {"success": SUCCESS, "reachable": asdict(DrivingLimits()), "tolerance": TOLERANCE},
        has_route,
        read_entries(FOLDER / "outdoor_entries.yaml"),
    )


def has_route(scenario: Scenario, seed: int) -> bool:
    """Whether a path within the robot's limits exists on the very ground that a run with this seed drives on."""
    start, goal = scenario.start, scenario.goals[0]
    clear = coordinates((start, goal))
    ground = scenario.world.heightfield(np.random.default_rng([seed, WORLD_STREAM]), clear)  # type: ignore[union-attr]
    return is_reachable(ground, HUSKY, (start.x, start.y, start.yaw), (goal.x, goal.y), TOLERANCE)  # type: ignore[union-attr]
