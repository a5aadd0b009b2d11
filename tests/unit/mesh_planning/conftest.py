"""Small maps and ready-made plugins for the tests of planning and control on meshes."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist, quaternions_from_axes
from mbf_abstract.plugins import ControlRequest
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.plugins import MeshContext


class SettableClock:
    """A clock that shows what the test sets."""

    time = 0.0

    def now(self):
        return self.time


class PaintedLayer(MeshLayer):
    """A layer whose costs a test sets with ``replace``."""

    def compute(self):
        return self._costs, self._lethal


@pytest.fixture(scope="session")
def make_plugin():
    """Factory: a plugin on a map with some parameters."""

    def make(plugin_class, mesh_map, robot=None, **parameters):
        parameters = plugin_class.Parameters(**parameters)
        rng = np.random.default_rng(0)
        return plugin_class(MeshContext("under_test", parameters, SettableClock(), rng, robot, mesh_map))

    return make


@pytest.fixture(scope="session")
def paint():
    """Factory: give a map one layer with costs [and lethal flags] from a function of the vertices (V, 3)."""

    def paint_map(mesh_map, costs, edge_cost_factor=0.0):
        layer = PaintedLayer(LayerContext("painted", mesh_map.topology, mesh_map.locator, PaintedLayer.Parameters()))
        values = np.asarray(costs(mesh_map.vertices), np.float32)
        layer.replace(values, ~np.isfinite(values))
        mesh_map.set_layers(LayerGraph([layer]), "painted", edge_cost_factor)
        return mesh_map

    return paint_map


@pytest.fixture(scope="session")
def hills():
    """A 6 m x 6 m field of gentle bumps, 0.1 m spacing, no costs."""
    x, y = np.meshgrid(np.arange(61) * 0.1, np.arange(61) * 0.1)
    return MeshMap.from_heights(0.25 * np.sin(1.5 * x) * np.cos(1.2 * y), 0.1, 0.1)


@pytest.fixture
def plain():
    """Factory: a flat field [m] with some spacing."""

    def make(width=6.0, height=6.0, spacing=0.2):
        shape = (round(height / spacing) + 1, round(width / spacing) + 1)
        return MeshMap.from_heights(np.zeros(shape), spacing, spacing)

    return make


@pytest.fixture(scope="session")
def pose_on():
    """Factory: the pose of a robot standing on a surface at x, y (found below height z), heading by a direction."""

    def make(mesh_map, position, heading):
        spot = mesh_map.locate_one(position)
        normal = mesh_map.face_normals[spot.face]
        orientation = quaternions_from_axes([heading], [normal])[0]
        return Pose(tuple(spot.point), tuple(orientation))

    return make


@pytest.fixture(scope="session")
def drive(pose_on):
    """Factory: a kinematic robot on the surface under a controller; returns the poses it went through."""

    def run(controller, mesh_map, pose, seconds, yaw_response=0.8, dist_tolerance=0.1, angle_tolerance=0.2):
        period, poses, velocity = 0.05, [pose], Twist()
        for _ in range(round(seconds / period)):
            if controller.is_goal_reached(poses[-1], dist_tolerance, angle_tolerance):
                break
            result = controller.compute_velocity_commands(ControlRequest(poses[-1], velocity))
            assert result.success, f"{result.outcome} {result.message} after {len(poses)} cycles"
            speed, turn = result.command.vx, result.command.wz
            velocity = Twist.planar(vx=speed, wz=yaw_response * turn)
            x_axis, y_axis, _ = poses[-1].rotation.T
            turned = np.cos(velocity.wz * period) * x_axis + np.sin(velocity.wz * period) * y_axis
            ahead = np.asarray(poses[-1].position) + velocity.vx * period * (x_axis + turned) / 2
            poses.append(pose_on(mesh_map, ahead, turned))
        return poses

    return run
