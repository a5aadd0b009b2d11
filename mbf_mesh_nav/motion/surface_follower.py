"""The base of controllers that follow a path over the surface: where the robot is, and whether it has arrived."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.controllers.braking import BrakesOnItsArc, LastFreeArc
from mbf_abstract.maps.controllers.failures import blocked_path, no_path, obstacle_text, outside_map
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.maps.controllers.keeping_to_path import KeepingToPath
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.kernels.search.forbidden_surface import LETHAL_RANK, may_enter
from mbf_mesh_nav.mesh.borders import beyond_border
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.motion.goal_approach import GoalApproach
from mbf_mesh_nav.plugins import MeshContext, MeshController

OBSTACLE_STEP = 0.1  # m between two looks along a path
OUTLINE_LOOK = 0.5  # s, over which an outline that has to fit does on the motion of a command


class SurfaceFollower(MeshController):
    """A controller whose ``set_plan`` makes a tracker of the path and the approach to its end."""

    _tracker: PathTracker
    _approach: GoalApproach | None = None

    def not_on_mesh(self, path: Path) -> str:
        """Why a path cannot be followed on the map, whatever leads along it; empty if it can."""
        if len(path) == 0:
            return "it has no poses"
        known = self.mesh_map.frame_id
        return "" if path.frame_id == known else f"it is in the frame {path.frame_id!r}, the map in {known!r}"

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

    def obstacle_along(self, places: FloatArray, max_distance: float, cost_limit: float) -> str:
        """The first of places (n, 3) [m] that the map forbids now, as a text; empty if the robot may go along all.

        A robot that stands on forbidden surface, as the first place is, may leave it, see
        ``kernels.search.forbidden_surface``. What lies farther than ``max_distance`` [m] from the surface, or past its
        border, is forbidden too.
        """
        location = self.mesh_map.locate(places, max_distance)
        ranks = self.mesh_map.snapshot().traversability_rank(cost_limit, self.mesh_map.faces[location.faces])
        nearest = np.take_along_axis(ranks, np.argmax(location.barycentric, axis=1)[:, None], axis=1)[:, 0]
        mixed = np.where(nearest > 0.0, (ranks * location.barycentric).sum(axis=1), 0.0)
        mixed[(location.faces < 0) | beyond_border(self.mesh_map.topology, places, location)] = LETHAL_RANK
        for place, before, now in zip(places[1:], mixed[:-1], mixed[1:], strict=True):
            if not may_enter(before, now):
                return obstacle_text(position_text(place))
        return ""

    def outline_on(self, pose: Pose, command: Twist, duration: float = OUTLINE_LOOK) -> str:
        """What the robot's outline would touch on a motion, as a text; empty if nothing, or if its disc will do."""
        if (outline := self.mesh_map.outline()) is None:
            return ""
        spot = self.mesh_map.locate_one(pose.position)
        return "" if spot is None else outline.swept(spot, pose, command, duration)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the path has been driven to its last pose, and that is reached."""
        if self._approach is None:
            return False
        return self._approach.is_reached(pose, self._tracker, dist_tolerance, angle_tolerance)


class KeepingFollower(SurfaceFollower):
    """One that drives closely along its path where its own motions get the robot nowhere."""

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._keeping = KeepingToPath(context)
        self.parameters_changed()

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """As for all; whoever keeps to the path needs the tolerances, too."""
        reached = self._keeping.update(pose, dist_tolerance, angle_tolerance)
        return super().is_goal_reached(pose, dist_tolerance, angle_tolerance) or reached


class SteeringFollower(KeepingFollower, BrakesOnItsArc):
    """One that steers, on the spot, too; it drives closely along its path where it is stuck, or where that is tight."""

    def parameters_changed(self) -> None:
        """Take over new limits."""
        p: Any = self.parameters
        self._keeping.drive_with(p.max_vel_x, p.max_vel_theta, p, p, allow_reversing=False)

    @property
    def inertia(self) -> InertiaParameters:
        """As its parameters have it."""
        p: Any = self.parameters
        assert isinstance(p, InertiaParameters)
        return p

    @cached_property
    def last_arc(self) -> LastFreeArc:
        """The arc of its last command, or of the last one along the path."""
        return self._keeping.last_arc

    @property
    def turns_on_the_spot(self) -> bool:
        """Always true."""
        return True

    def closely(self, request: ControlRequest, fastest: float, *, is_stuck: bool = False) -> ControlResult | None:
        """The motion that keeps to the path where that is to be, see ``KeepingToPath``, at most ``fastest`` [m/s].

        It is asked for robots that state their inertia, or whose outline has to fit; others drive as before, bit for
        bit.
        """
        p: Any = self.parameters
        if p.acc_lim_x == math.inf and not self.mesh_map.check_footprint:
            return None
        return self._keeping.closely(request, MotionLimits(0.0, fastest, p.max_vel_theta), is_stuck=is_stuck)

    def fitting(self, request: ControlRequest, result: ControlResult, fastest: float, seconds: float) -> ControlResult:
        """A motion along which the outline fits for some ``seconds``, if it has to: the given one, or a closer one."""
        if not isinstance(result.command, Twist):
            return result
        obstacle = self.outline_on(request.pose, result.command, seconds)
        if not obstacle:
            return result
        return self.closely(request, fastest, is_stuck=True) or blocked_path(self.mesh_map, request.pose, obstacle)
