"""The base of controllers that follow a path over the surface: where the robot is, and whether it has arrived."""

from __future__ import annotations

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.controllers.failures import no_path, outside_map
from mbf_abstract.maps.controllers.keeping_to_path import KeepingToPath
from mbf_abstract.plugins import ControlResult
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.motion.goal_approach import GoalApproach
from mbf_mesh_nav.plugins import MeshContext, MeshController


class SurfaceFollower(MeshController):
    """A controller whose ``set_plan`` makes a tracker of the path and the approach to its end."""

    _tracker: PathTracker
    _approach: GoalApproach | None = None

    def begin_cycle(
        self, pose: Pose, max_distance: float, hint_face: int = -1
    ) -> tuple[SurfacePoint, GoalApproach] | ControlResult:
        """Find the robot at most ``max_distance`` [m] from the surface; a failure if it is not there or has no plan."""
        if self._approach is None:
            return no_path()
        spot = self.mesh_map.locate_one(pose.position, max_distance, hint_face)
        if spot is None:
            return outside_map(position_text(pose.position), f"no surface within {max_distance:g} m")
        return spot, self._approach

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the path has been driven to its last pose, and that is reached."""
        if self._approach is None:
            return False
        return self._approach.is_reached(pose, self._tracker, dist_tolerance, angle_tolerance)


class SamplingFollower(SurfaceFollower):
    """One that samples motions, and keeps to its path where they get the robot nowhere."""

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._keeping = KeepingToPath(context)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """As for all; whoever keeps to the path needs the tolerances, too."""
        self._keeping.update(pose, dist_tolerance, angle_tolerance)
        return super().is_goal_reached(pose, dist_tolerance, angle_tolerance)
