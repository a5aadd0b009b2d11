"""The terrains of ``outdoor_evaluation.py``: generated ones of rising difficulty, and crops of real surveys.

Each is a drive from one corner to the opposite one, without sensors, so that nothing but the ground is in the way.
Surveys coarser than a robot are shrunk isotropically: their slopes stay what they are.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from reachability import is_reachable

from terrain.physics.robot_models import HUSKY
from terrain.scenarios.environment import WORLD_STREAM
from terrain.scenarios.places import coordinates
from terrain.scenarios.scenario import SHIPPED, PlanarPose, Scenario
from terrain.scenarios.world_types import GeneratedWorld, HeightfieldWorld
from terrain.worlds.elevation_files import read_dem
from terrain.worlds.heightfield import Heightfield

SIZE = (24.0, 20.0)
SPACING = 0.25
LEVELS = 10
FROM_CORNER = 2.5
FLAT_LETHAL_SLOPE = 30.0
CONFIGS = {name: SHIPPED / "config" / f"outdoor_{name}.yaml" for name in ("mesh", "costmap")}
SURVEYS = {"kootenai_1m.npz": 1.0, "N44W072.hgt": 0.5 / 90.0, "jacksboro.npz": 0.5 / 80.0, "bigtujunga.npz": 0.5 / 30.0}
FRESH_SURVEYS = {  # nothing was ever chosen on these
    "tidal_2m.npz": 0.5 / 2.0,
    "gale_aeolis_mount_sharp_aeolis_palus_center.npz": 0.5 / 2.0,
    "jezero_neretva_neretva_center.npz": 0.5 / 2.0,
}
SCALES = SURVEYS | FRESH_SURVEYS
FRESH_SEED = 5000


def scenario_in(name: str, world: GeneratedWorld | HeightfieldWorld, corner: tuple[float, float]) -> Scenario:
    """A drive across a world whose lower left corner lies at ``corner``."""
    (x, y), (length, width) = corner, SIZE
    yaw = float(np.arctan2(width - 2.0 * FROM_CORNER, length - 2.0 * FROM_CORNER))
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


def real(file: Path, seed: int) -> Scenario:
    """A crop of a survey, drawn from the seed."""
    survey, scale = _survey(file), SCALES[file.name]
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


def terrains(data: Path, first_seed: int, generated_seeds: int, crops: int) -> list[tuple[Scenario, int]]:
    """Every level with ``generated_seeds`` seeds and ``crops`` of each survey there is, each with its seed.

    From ``FRESH_SEED`` on the fresh surveys count, too.
    """
    names = SCALES if first_seed >= FRESH_SEED else SURVEYS
    places = [(data / "terrain" / folder / name).resolve() for name in names for folder in ("dem", "mars")]
    files = [file for file in places if file.is_file()]
    chosen = []
    for number in range(max(generated_seeds, crops)):  # easy and hard ones mixed, so that a part is representative
        seed = first_seed + number
        if number < generated_seeds:
            chosen += [(generated(level), seed) for level in range(LEVELS)]
        if number < crops:
            chosen += [(real(file, seed), seed) for file in files]
    return chosen


def has_route(scenario: Scenario, seed: int) -> bool:
    """Whether a way within the robot's limits exists on the very ground that a run with this seed drives on."""
    start, goal = scenario.start, scenario.goals[0]
    clear = coordinates((start, goal))
    ground = scenario.world.heightfield(np.random.default_rng([seed, WORLD_STREAM]), clear)  # type: ignore[union-attr]
    return is_reachable(ground, HUSKY, (start.x, start.y, start.yaw), (goal.x, goal.y))  # type: ignore[union-attr]
