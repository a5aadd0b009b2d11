"""A cloud of a world with posts, the map built from it, a plan on the built map, and the drive in the true world."""

import numpy as np
import pytest

from mbf_mesh_nav.building.map_build import build_map
from mbf_mesh_nav.building.surface import SurfaceParameters
from mbf_mesh_nav.mesh.mesh_report import MeshError
from terrain.scenarios.environment import FOREST_STREAM, WORLD_STREAM
from terrain.scenarios.library import LIBRARY
from terrain.scenarios.obstacles import Forest
from terrain.scenarios.places import coordinates
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.runner import RunOptions, run_scenario

POSTS = Forest(x_range=(4.0, 14.0), y_range=(2.0, 10.0), count=14, gap=2.0)
SEED = 5


@pytest.fixture(scope="module")
def scenario():
    """Gentle ground with posts that no map of the world shows, and no sensor that could see them."""
    forest = load_scenario("post_forest")
    world = forest.world.model_copy(update={"size": (18.0, 12.0)})
    changes = {"world": world, "forests": (POSTS,), "sensors": (), "physics": "kinematic", "time_limit": 60.0}
    changes["navigation"] = {"mesh": LIBRARY / "config" / "outdoor_mesh.yaml"}
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


def test_a_map_is_built_from_a_run_s_own_scans(tmp_path):
    forest = load_scenario("post_forest").model_copy(update={"physics": "kinematic"})
    run_scenario(forest, RunOptions(tmp_path / "run", seed=SEED))
    facts, surface, _ = build_map([tmp_path / "run"], tmp_path / "map.ply", SurfaceParameters(hole_width=4.0))
    clear = coordinates((forest.start, *forest.goals))
    ground = forest.world.heightfield(np.random.default_rng([SEED, WORLD_STREAM]), clear)
    errors = surface.vertices[:, 2] - ground.height_at(surface.vertices[:, 0], surface.vertices[:, 1])
    posts = forest.forests[0].posts(np.random.default_rng([SEED, FOREST_STREAM]), clear)
    places = np.array([[post.x, post.y] for post in posts])
    assert np.sqrt(np.nanmean(errors * errors)) < 0.03
    assert np.nanmax(errors) < 0.35  # no post, of which a part was seen and no ground below it, is a corner
    assert (np.abs(errors) > 0.1).mean() < 0.01
    assert facts.area > 250.0
    (seen_posts,) = np.nonzero(surface.is_obstacle)
    distances = np.linalg.norm(surface.patches.centres[seen_posts][:, None] - places[None], axis=2)
    assert distances.min(axis=1).max() < 0.75  # nothing else is an obstacle
    assert (distances.min(axis=0) < 0.75).mean() > 0.7  # and most posts are


def test_a_folder_without_a_run_and_a_run_without_scans_are_refused(tmp_path):
    with pytest.raises(MeshError, match=r"run: expected the folder of a run, with recording\.npz, got one without it"):
        build_map([tmp_path], tmp_path / "map.ply")
    np.savez(tmp_path / "recording.npz", scans=np.zeros((0, 3)))
    with pytest.raises(MeshError, match="expected hits of range sensors, got none in this run"):
        build_map([tmp_path], tmp_path / "map.ply")
    np.savez(tmp_path / "recording.npz", scans=np.zeros((100, 3)))
    with pytest.raises(MeshError, match="its arrays take 2400 bytes, the limit is 1200"):
        build_map([tmp_path], tmp_path / "map.ply", max_points=50)
