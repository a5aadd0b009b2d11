"""Controller `chase_on_mesh`: turn towards a point ahead on the path and drive.

When to use: as a start for a controller of your own. When not: crowds and tight corners; it checks one point only.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import FloatArray, Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_mesh_nav.plugins import MeshController


class ChaseOnMeshParameters(PluginParameters):
    """Parameters of `chase_on_mesh`."""

    speed: float = parameter(0.5, "Speed straight ahead.", unit="m/s", gt=0.0, le=5.0)
    max_turn: float = parameter(1.0, "Greatest yaw rate.", unit="rad/s", gt=0.0, le=5.0)
    look_ahead: float = parameter(0.5, "Distance of the point to drive to.", unit="m", gt=0.0, le=10.0)


class ChaseOnMesh(MeshController):
    """Chases a point ahead and turns to the goal's heading on arrival."""

    Parameters = ChaseOnMeshParameters
    parameters: ChaseOnMeshParameters
    _path: Path

    def set_plan(self, path: Path) -> bool:
        """Take any path that has poses."""
        self._path = path
        return len(path) > 0

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Turn in place while the point is far off the heading, else drive towards it."""
        point = self._point_ahead(np.array(request.pose.position))
        below = self.mesh_map.locate_one(point, max_distance=1.0)
        if below is None or self.mesh_map.snapshot().lethal[self.mesh_map.faces[below.face]].any():
            return ControlResult(ExePathOutcome.BLOCKED_PATH, f"lethal ground at {point.round(2).tolist()}")
        to_goal = request.pose.distance_to(self._path[-1])
        arriving = to_goal < 0.05
        direction = self._path[-1].rotation[:, 0] if arriving else point - request.pose.position
        x, y, _ = direction @ request.pose.rotation  # in the robot's frame
        bearing = math.atan2(y, x)
        limit = self.parameters.max_turn
        turn = min(limit, max(-limit, 2.0 * bearing))
        speed = 0.0 if arriving or abs(bearing) > 1.0 else min(self.parameters.speed, to_goal) * math.cos(bearing)
        return ControlResult(ExePathOutcome.SUCCESS, "driving", Twist.planar(speed, wz=turn))

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Compare the pose with the last pose of the path."""
        end = self._path[-1]
        return pose.distance_to(end) <= dist_tolerance and pose.angle_to(end) <= angle_tolerance

    def _point_ahead(self, position: FloatArray) -> FloatArray:
        """First point after the nearest one that is at least ``look_ahead`` away, or the last point."""
        distances = np.linalg.norm(self._path.positions - position, axis=1)
        nearest = int(distances.argmin())
        far = np.flatnonzero(distances[nearest:] >= self.parameters.look_ahead)
        point: FloatArray = self._path.positions[nearest + far[0] if far.size else -1]
        return point
