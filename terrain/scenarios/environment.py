"""The environment of a scenario's robot: the world, its obstacles and its actors."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.scenarios.actors import add_actors
from terrain.scenarios.obstacles import Obstacle, add_obstacles
from terrain.scenarios.places import coordinates, off_the_ground
from terrain.scenarios.scenario import Scenario, robot_scenarios
from terrain.scenarios.world import ScenarioWorld, build_world
from terrain.worlds.map_files import MapFiles
from terrain.worlds.surface import Surface

WORLD_STREAM, FOREST_STREAM, ACTOR_STREAM, MAP_STREAM = 1, 2, 3, 4  # each part draws from its own generator


def build_environment(scenario: Scenario, folder: Path, seed: int) -> tuple[ScenarioWorld, Surface | None]:
    """Build the world of a scenario, write its map files into ``folder``, then add obstacles and actors.

    Returns
    -------
    world : ScenarioWorld
    obstacles : Surface or None
        The things in the world that are on no map, for pictures.
    """
    views = robot_scenarios(scenario).values()
    keep_clear = coordinates(place for view in views for place in (view.start, *view.goals))
    rng, is_kinematic = np.random.default_rng([seed, WORLD_STREAM]), scenario.physics == "kinematic"
    files = MapFiles(folder, scenario.map, np.random.default_rng([seed, MAP_STREAM]))
    world = build_world(scenario.world, files, rng, keep_clear, 1.0 / scenario.physics_rate, is_kinematic)
    try:
        rng = np.random.default_rng([seed, FOREST_STREAM])
        posts = _posts(scenario, rng, keep_clear, world)
        obstacles = add_obstacles(world.physics, [*scenario.obstacles, *posts], world.ground_at)
        add_actors(world, scenario.actors, np.random.default_rng([seed, ACTOR_STREAM]))
    except BaseException:
        world.physics.close()
        raise
    return world, obstacles


def _posts(
    scenario: Scenario, rng: np.random.Generator, keep_clear: FloatArray, world: ScenarioWorld
) -> list[Obstacle]:
    """Posts of all forests; raises ConfigError for one that is off the ground."""
    posts: list[Obstacle] = []
    for number, forest in enumerate(scenario.forests):
        drawn = forest.posts(rng, keep_clear, world.ground_at)
        x, y = 0.5 * sum(forest.x_range), 0.5 * sum(forest.y_range)
        if forest.count and not drawn and not math.isfinite(world.ground_at(x, y)):
            raise off_the_ground(f"forests[{number}]", x, y)
        posts += drawn
    return posts


def with_noise(scenario: Scenario) -> Scenario:
    """Return the scenario with the noise of its ``perturb`` block in its sensors and its localisation."""
    perturb = scenario.perturb
    sensors = tuple(
        sensor.model_copy(update={"noise": math.hypot(sensor.noise, perturb.range_noise)})
        for sensor in scenario.sensors
    )
    localization = scenario.localization.widened(perturb.pose_position, perturb.pose_angle)
    return scenario.model_copy(update={"sensors": sensors, "localization": localization})
