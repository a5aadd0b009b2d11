"""Sensors are used where a layer of a map, of either backend, listens to their source."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_ros.sensor_options import sensors_of, used_sensors

SIZE = "width: 4.0, height: 4.0, layers: [{name: obstacles, type: obstacle}], obstacles: {sources: {lidar: {}}}"
MAPS = {
    "costmap": f"backend: costmap\nglobal_costmap: {{{SIZE}}}\nlocal_costmap: {{{SIZE}}}\n",
    "mesh": """
backend: mesh
mesh_map: {mesh_file: floor.ply, layers: [{name: obstacles, type: obstacle}], obstacles: {sources: [lidar]}}
""",
}


@pytest.fixture(params=MAPS)
def server(request, tmp_path):
    floor = trimesh.Trimesh(*heightfield_mesh(np.zeros((5, 5)), 1.0, 1.0), process=False)
    floor.export(tmp_path / "floor.ply")
    (tmp_path / "robot.yaml").write_text(MAPS[request.param])
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(2.0, 2.0))
    with Navigator.from_file(tmp_path / "robot.yaml", robot, clock, transforms) as navigator:
        yield navigator.server
    robot.close()


def test_a_sensor_that_feeds_nothing_is_not_used_and_reported_unless_it_is_one_by_default(server):
    reported = []
    chosen = sensors_of(["/front:LaserScan=lidar", "/rear:LaserScan=lidra", "/points:PointCloud2=points"])
    assert used_sensors(chosen, server.listens_to, reported.append) == {"/front": chosen["/front"]}
    assert reported == ["/rear is not used: no layer of a map listens to the source 'lidra'"]
