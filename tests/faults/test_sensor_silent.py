"""Fault table, row 13: the lidar falls silent while the robot drives, on both maps and with their default limits."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGS = {
    "mesh": """
backend: mesh
mesh_map:
  mesh_file: floor.ply
  layers: [{name: obstacle, type: obstacle}]
controllers: [{name: follower, type: path_follower}]
controller_patience: 2.0
""",
    "costmap": """
backend: costmap
global_costmap: {width: 8.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap:
  rolling_window: true
  width: 3.0
  height: 3.0
  layers: [{name: obstacle, type: obstacle}]
  obstacle: {sources: {lidar: {}}}
controllers: [{name: follower, type: regulated_pure_pursuit}]
controller_patience: 2.0
""",
}
PERIOD = 0.1  # s between two scans


class Site:
    """A robot on an empty floor of 8 m x 4 m; the test is its lidar, which sees nothing."""

    def __init__(self, backend, folder):
        vertices, faces = heightfield_mesh(np.zeros((21, 41)), 0.2, 0.2)
        trimesh.Trimesh(vertices, faces, process=False).export(folder / "floor.ply")
        (folder / "robot.yaml").write_text(CONFIGS[backend])
        self.clock, transforms = SimClock(), TransformBuffer()
        self.robot = LoopbackRobot(self.clock, transforms, Pose.planar(1.0, 2.0))
        self.navigator = Navigator.from_file(folder / "robot.yaml", self.robot, self.clock, transforms)

    def see(self, seconds):
        """Scan into the distance for some time."""
        directions = np.linspace(-np.pi, np.pi, 36, endpoint=False)
        for _ in range(round(seconds / PERIOD)):
            origin = np.add(self.robot.pose.position, (0.0, 0.0, 0.4))
            ends = origin + 6.0 * np.column_stack([np.cos(directions), np.sin(directions), 0.0 * directions])
            scan = RangeScan("lidar", "map", origin, ends, np.zeros(36, bool), self.clock.now())
            self.navigator.server.take_scan(scan)
            self.clock.sleep(PERIOD)

    def drive(self):
        self.see(1.0)
        path = Path.from_points(np.linspace((1.0, 2.0, 0.0), (6.0, 2.0, 0.0), 51))
        handle = self.navigator.send(ExePathGoal(path))
        self.see(2.0)
        assert not self.robot.command.is_stopped(), "the robot drives while it sees"
        return handle


@pytest.fixture(params=CONFIGS)
def site(request, tmp_path):
    made = Site(request.param, tmp_path)
    with made.navigator:
        yield made
    made.robot.close()


def test_a_robot_that_sees_nothing_more_stops_and_its_goal_ends_with_map_error_after_patience(site):
    handle = site.drive()
    silent_since = site.clock.now()
    result = handle.wait()
    assert result.outcome == ExePathOutcome.MAP_ERROR
    assert "obstacle" in result.message or "lidar" in result.message
    assert not site.robot.moved_after(silent_since + 1.1), "the limit of the sensor's age is 1 s"
    assert site.robot.command.is_stopped()


def test_a_robot_that_sees_again_within_its_patience_drives_on_and_arrives(site):
    handle = site.drive()
    site.clock.sleep(2.0)
    assert site.robot.command.is_stopped()
    assert not handle.done
    site.see(20.0)
    assert handle.result is not None and handle.result.success
