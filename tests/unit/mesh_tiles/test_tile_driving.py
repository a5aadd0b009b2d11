"""Drives over the borders of tiles, with the behaviours that know their map by its contract only."""

import numpy as np
import pytest
from test_tile_planning import build_storeys, storeys

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader
from mbf_mesh_nav.tiles.tiled_map import KEPT_TILES

START = Pose.planar(1.2, 2.0)
PLUGINS = """
max_vel_x: 2.0
controllers: [{name: follower, type: follow_path}]
follower: {max_vel_x: 2.0, decel_lim_x: 2.0}
recovery_behaviors: [{name: back_up, type: back_up}]
"""
ON_TILES = """
backend: tiles
planners: [{name: far, type: tiles.hierarchical}]
tiled_map: {folder: map, memory: %d, inscribed_radius: 0.3}
"""
ON_MESH = """
backend: mesh
planners: [{name: astar, type: astar}]
mesh_map: {mesh_file: storeys.ply, inscribed_radius: 0.3, layers: [{name: slope, type: steepness}]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two storeys of 40 m, as four tiles and as one mesh."""
    folder = tmp_path_factory.mktemp("storeys")
    tiled = build_storeys(folder / "map", portal_length=2.0)
    # Two of the four tiles fit into the pool.
    memory = tiled.table_bytes + (KEPT_TILES + 2.5) * tiled.pool.slot_bytes
    (folder / "tiles.yaml").write_text(PLUGINS + ON_TILES % memory, "utf-8")
    write_map(folder / "storeys.ply", *storeys(), MapHeader((0, 0, 0), 0, 0))
    (folder / "mesh.yaml").write_text(PLUGINS + ON_MESH, "utf-8")
    return folder


def drive(folder, backend, *goals):
    """Results of goals, one after the other, and where the robot stood after each."""
    results, stood = [], []
    with LoopbackSession(START) as session:
        server = session.serve(*read_config(folder / f"{backend}.yaml"), session.robot, session.transforms)
        for goal in goals:
            results.append(session.navigator.send(goal).wait())
            stood.append(session.robot.pose)
        if backend == "tiles":
            tiled = server.tiled_map.tiled
            assert len(tiled.pool.loaded) <= tiled.pool.slots == 2
            assert server.tiled_map._window.now.is_central(session.robot.pose.x, session.robot.pose.y)
    return results, stood


def test_a_drive_over_three_borders_of_tiles_ends_as_on_the_whole_mesh(folder):
    off_the_map = Path.from_points(np.linspace((22.0, 1.9, 0.0), (22.0, -4.0, 0.0), 30))
    goals = [
        ExePathGoal(Path.from_points(np.linspace(START.position, (38.0, 2.4, 0.0), 200))),
        RecoveryGoal("back_up"),
        MoveBaseGoal(Pose.planar(22.0, 2.0, -np.pi / 2.0)),
        ExePathGoal(off_the_map),
    ]
    (ours, stood), (expected, stands) = (drive(folder, backend, *goals) for backend in ("tiles", "mesh"))
    wanted = [ExePathOutcome.SUCCESS, RecoveryOutcome.SUCCESS, MoveBaseOutcome.SUCCESS, ExePathOutcome.PAT_EXCEEDED]
    assert [result.outcome for result in ours] == wanted == [result.outcome for result in expected]
    assert stood[0].x > 37.0, "tiles meet at 10, 20 and 30 m"
    for one, other in zip(stood, stands, strict=True):
        assert one.distance_to(other) < 0.3
    for result in (ours[3], expected[3]):
        assert "the surface ends" in result.message


@pytest.mark.parametrize(
    ("controller", "block"),
    [("path_follower", "follower: {check_ahead_dist: 2.7}"), ("mppi", "follower: {batch_size: 100}")],
)
def test_a_controller_for_meshes_drives_from_window_to_window_as_on_the_whole_mesh(folder, controller, block):
    """Windows of 16 m move on every 4 m; the controllers look nearly as far ahead."""
    path = Path.from_points(np.linspace(START.position, (13.0, 2.4, 0.0), 60))
    for backend in ("tiles", "mesh"):
        text = (folder / f"{backend}.yaml").read_text("utf-8").replace("follow_path", controller)
        text = text.replace("follower: {max_vel_x: 2.0, decel_lim_x: 2.0}", block).replace(
            "{folder", "{window: 16.0, folder"
        )
        (folder / f"{backend}_{controller}.yaml").write_text(text, "utf-8")
    goals = [ExePathGoal(path), MoveBaseGoal(Pose.planar(20.0, 2.0))]
    (ours, stood), (expected, stands) = (drive(folder, f"{one}_{controller}", *goals) for one in ("tiles", "mesh"))
    assert [result.outcome for result in ours] == [0, 0] == [result.outcome for result in expected]
    for one, other in zip(stood, stands, strict=True):
        assert one.distance_to(other) < 0.3


def test_a_goal_that_needs_more_tiles_than_the_memory_holds_is_not_silently_refused(folder):
    (result,), _ = drive(folder, "tiles", MoveBaseGoal(Pose.planar(38.0, 2.0)))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and "the memory holds 2 of 4 tiles" in result.message
