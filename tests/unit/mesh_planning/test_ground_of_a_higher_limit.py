"""A controller whose ``cost_limit`` lets it drive on ground that the map forbids takes it for no contact."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGURATION = """
backend: mesh
min_vel_x: -0.5
planners: [{name: planner, type: dijkstra}]
controllers: [{name: controller, type: CONTROLLER}]
planner: {cost_limit: 2.0}
controller: {cost_limit: 2.0}
mesh_map:
  mesh_file: field.ply
  inscribed_radius: 0.34
  layers:
    - {name: posts, type: keepout}
    - {name: inflation, type: inflation, inputs: [posts]}
  posts:
    regions:
      - {polygon: [[3, 3.3], [5, 3.3], [5, 3.6], [3, 3.6]]}
      - {polygon: [[3, 2.4], [5, 2.4], [5, 2.7], [3, 2.7]]}
  inflation: {inscribed_radius: 0.34, inflation_radius: 0.5, lethal_value: 1.5, inscribed_value: 1.0}
"""


@pytest.mark.parametrize("controller", ["path_follower", "mppi"])
def test_it_drives_on_between_obstacles_that_are_nearer_than_its_disc(tmp_path, controller):
    vertices, faces = heightfield_mesh(np.zeros((61, 81)), 0.1, 0.1)[:2]
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "field.ply")
    (tmp_path / "navigation.yaml").write_text(CONFIGURATION.replace("CONTROLLER", controller))
    with LoopbackSession(Pose.planar(1.0, 3.0)) as session:
        session.serve(*read_config(tmp_path / "navigation.yaml"), session.robot, session.transforms)
        result = session.navigator.go_to(session.navigator.ground_pose(7.0, 3.0))
        assert result.success, result.message
        assert session.clock.now() < 20.0 and all(command.vx >= 0.0 for _, command in session.robot.commands)
