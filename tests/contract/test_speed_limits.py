"""Whatever drives obeys the speed limits of layers, on both maps: any controller, recoveries, a person at the stick."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from mbf_abstract.drive.teleoperation import Teleoperation
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import ExePathGoal, RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

ZONE = [[2.0, 0.0], [3.0, 0.0], [3.0, 3.0], [2.0, 3.0]]
PLUGINS = """
planners: [{name: planner, type: dijkstra}]
controllers: [{name: controller, type: TYPE}]
recovery_behaviors: [{name: back_up, type: back_up}]
"""
CONFIGURATIONS = {
    "costmap": """
backend: costmap
global_costmap:
  robot_radius: 0.2
  layers: [{name: walls, type: static}, {name: slow, type: speed_limit}]
  walls: {map_file: room.png}
  slow: {limit_type: KIND, zones: [{name: slow, polygon: ZONE, speed_limit: LIMIT}]}
local_costmap:
  robot_radius: 0.2
  layers: [{name: walls, type: static}]
  walls: {map_file: room.png}
""",
    "mesh": """
backend: mesh
mesh_map:
  mesh_file: room.ply
  layers:
    - {name: border, type: border}
    - {name: slow, type: speed_limit}
  border: {threshold: 0.5}
  slow: {limit_type: KIND, regions: [{polygon: ZONE, speed_limit: LIMIT}]}
""",
}
CONTROLLERS = [("costmap", "follow_path"), ("costmap", "dwa"), ("mesh", "follow_path"), ("mesh", "path_follower")]


@pytest.fixture
def room(tmp_path):
    """``room(backend, x, controller=.., limit=.., kind=..)`` -> a session in a room of 6 m x 3 m."""
    cells = np.full((60, 120), 254, dtype=np.uint8)
    Image.fromarray(cells).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text("{image: room.png, resolution: 0.05, origin: [0, 0, 0], negate: 0}")
    vertices, faces = heightfield_mesh(np.zeros((16, 31)), 0.2, 0.2)[:2]
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "room.ply")
    sessions = []

    def open_session(backend, x, controller="follow_path", limit=0.1, kind="absolute"):
        text = CONFIGURATIONS[backend].replace("room.png", "room.yaml").replace("ZONE", str(ZONE))
        text = text.replace("LIMIT", str(limit)).replace("KIND", kind) + PLUGINS.replace("TYPE", controller)
        (tmp_path / "navigation.yaml").write_text(text)
        session = LoopbackSession(Pose.planar(x, 1.5))
        sessions.append(session)
        session.serve(*read_config(tmp_path / "navigation.yaml"), session.robot, session.transforms)
        session.clock.sleep(1.0)
        return session

    yield open_session
    for session in sessions:
        session.close()


def fastest(session, handle):
    """Greatest speeds [m/s] that were commanded inside the zone and outside of it while a goal ran."""
    inside = outside = 0.0
    while not handle.done:
        session.clock.sleep(0.02)
        speed, x = abs(session.robot.command.vx), session.robot.pose.x
        if 2.1 < x < 2.9:
            inside = max(inside, speed)
        elif not 1.9 < x < 3.1:
            outside = max(outside, speed)
    return inside, outside


def drive(session, x):
    path = session.navigator.get_path(session.navigator.ground_pose(x, 1.5)).path
    return session.navigator.send(ExePathGoal(path))


@pytest.mark.parametrize(("backend", "controller"), CONTROLLERS)
def test_a_controller_drives_slowly_in_the_zone_and_fast_outside(room, backend, controller):
    session = room(backend, 0.8, controller)
    handle = drive(session, 5.0)
    inside, outside = fastest(session, handle)
    assert handle.wait().success
    assert 0.05 < inside <= 0.1 + 1e-6 and outside > 0.3


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_percent_is_a_share_of_the_top_speed(room, backend):
    session = room(backend, 0.8, limit=40, kind="percent")
    inside, outside = fastest(session, drive(session, 5.0))
    assert outside == pytest.approx(0.5) and inside == pytest.approx(0.2)


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_a_recovery_moves_slowly_in_the_zone(room, backend):
    session = room(backend, 2.7)
    handle = session.navigator.send(RecoveryGoal("back_up"))
    assert fastest(session, handle)[0] == pytest.approx(0.1) and handle.wait().success


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_a_limit_of_zero_blocks_and_says_where(room, backend):
    session = room(backend, 2.5, limit=0)
    result = drive(session, 5.0).wait(60.0)
    assert result.outcome in (ExePathOutcome.BLOCKED_PATH, ExePathOutcome.PAT_EXCEEDED)
    assert "the speed limit at (2.50, 1.50) is 0 m/s" in result.message
    recovered = session.navigator.recover("back_up")
    assert recovered.outcome == RecoveryOutcome.IMPASSABLE and "is 0 m/s" in recovered.message


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_a_person_at_the_stick_is_slowed_down(room, backend):
    session = room(backend, 2.2)
    stick = Teleoperation(session.navigator.server.runtime)
    for _ in range(10):
        stick.hold(Twist.planar(0.4))
        session.clock.sleep(0.1)
    assert session.robot.command.vx == pytest.approx(0.1)
    stick.release()


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_limits_change_at_run_time(room, backend):
    session = room(backend, 0.8)
    session.navigator.server.set_layer_parameters("slow", enabled=False)
    session.clock.sleep(1.0)
    assert fastest(session, drive(session, 5.0))[0] > 0.3
