"""A cloud of a world with posts, the map built from it, a plan on the built map, and the drive in the true world."""

import numpy as np
import pytest

from mbf_mesh_nav.building.map_build import build_map
from terrain.scenarios.environment import FOREST_STREAM, WORLD_STREAM
from terrain.scenarios.obstacles import Forest
from terrain.scenarios.places import coordinates
from terrain.scenarios.scenario import SHIPPED, PlanarPose, load_scenario
from terrain.session.runner import RunOptions, run_scenario

POSTS = Forest(x_range=(4.0, 14.0), y_range=(2.0, 10.0), count=14, gap=2.0)
SEED = 5


@pytest.fixture(scope="module")
def scenario():
    """Gentle ground with posts that no map of the world shows, and no sensor that could see them."""
    forest = load_scenario("post_forest")
    world = forest.world.model_copy(update={"size": (18.0, 12.0)})
    changes = {"world": world, "forests": (POSTS,), "sensors": (), "physics": "kinematic", "time_limit": 60.0}
    changes["navigation"] = {"mesh": SHIPPED / "config" / "outdoor_mesh.yaml"}
    places = {"start": PlanarPose(x=2.0, y=6.0), "goals": (PlanarPose(x=16.0, y=6.0),)}
    return forest.model_copy(update={**changes, **places})


def survey(scenario, file):
    """Points on ground and posts, 100 on a square metre, with noise of 2 cm."""
    clear = coordinates((scenario.start, *scenario.goals))
    ground = scenario.world.heightfield(np.random.default_rng([SEED, WORLD_STREAM]), clear)
    rng = np.random.default_rng(1)
    x, y = rng.uniform((0.0, 0.0), ground.size, (int(100 * ground.size[0] * ground.size[1]), 2)).T
    parts = [np.column_stack([x, y, ground.height_at(x, y)])]
    for post in POSTS.posts(np.random.default_rng([SEED, FOREST_STREAM]), clear):
        angle, foot = rng.uniform(0.0, 2.0 * np.pi, 140), ground.height_at(post.x, post.y)
        side = (post.x + 0.15 * np.cos(angle), post.y + 0.15 * np.sin(angle), foot + rng.uniform(0.0, 1.5, 140))
        parts.append(np.column_stack(side))
    points = np.vstack(parts)
    np.savetxt(file, points + rng.normal(0.0, 0.02, points.shape), fmt="%.4f")
    return file


def drive(scenario, folder, mesh_file=""):
    settings = {"mesh_map.mesh_file": str(mesh_file)} if mesh_file else {}
    return run_scenario(scenario, RunOptions(folder, seed=SEED, settings=settings))


def test_a_robot_without_eyes_gets_through_posts_on_a_map_built_from_a_scan(scenario, tmp_path):
    built = tmp_path / "built.ply"
    build_map([survey(scenario, tmp_path / "scan.xyz")], built)
    result = drive(scenario, tmp_path / "run", built)
    assert result.success, result.verdict
    assert "collision" not in result.metrics["incidents"]
    on_the_bare_ground = drive(scenario, tmp_path / "without", "")
    assert "collision" in on_the_bare_ground.metrics["incidents"]  # so the map is what kept it off the posts
