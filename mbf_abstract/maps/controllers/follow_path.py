"""Follow a path on any map: pure pursuit that stops before an obstacle of the map.

When to use: a map backend without a controller of its own. When not: to drive around obstacles (it ends with
BLOCKED_PATH; plan again while driving), on slopes: the controllers of the costmap and the mesh server do more.
Formula: pure pursuit (Coulter 1992), the arc through a point ahead on the path; before a tight place it is near.
"""

from __future__ import annotations

import math
from typing import ClassVar

from mbf_abstract.execution.path_tracker import CUSP_REACHED, PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.controllers.braking import BrakesOnItsArc
from mbf_abstract.maps.controllers.continued_path import carried_over
from mbf_abstract.maps.controllers.driving_out import Gears, LeavesContacts, OnPath
from mbf_abstract.maps.controllers.end_of_path import at_exact_end
from mbf_abstract.maps.controllers.failures import blocked_path, missed_path, no_path, outside_map, storeys_off
from mbf_abstract.maps.controllers.follow_path_parameters import FollowPathParameters
from mbf_abstract.maps.controllers.inertia import (
    PLANNED,
    InertiaParameters,
    braking_distance,
    speed_on_path,
    stopping_speed,
)
from mbf_abstract.maps.controllers.room_to_turn import (
    RoomToTurn,
    along_path,
    angle_to_path,
    closely_along_path,
    curves_ahead,
    off_course,
    poses_ahead,
    wider_curves,
)
from mbf_abstract.maps.controllers.steering_to_path import AT_END, SteeringToPath
from mbf_abstract.maps.controllers.tight_places import (
    CLOSE_FROM,
    CLOSELY,
    KEPT,
    REACH,
    SPACING,
    TightPlaces,
    least_turn,
    outline_fits,
    speed_before,
)
from mbf_abstract.maps.controllers.turn_at_goal import TurnAtGoal
from mbf_abstract.maps.queries import AS_CONFIGURED, PADDED, CellState
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import ControlRequest, ControlResult

MIN_SPEED = 0.05  # m/s; below it a robot would not reach the end of its path


class FollowPath(LeavesContacts, SteeringToPath, BrakesOnItsArc):
    """Steers along the arc to a point ahead on the path."""

    Parameters: ClassVar[type[PluginParameters]] = FollowPathParameters
    parameters: FollowPathParameters

    _tracker: PathTracker | None = None
    _room_to_turn = RoomToTurn()
    _tight_places = TightPlaces()
    _dist_tolerance = 0.0
    ended_early = False
    """Whether the path led no nearer to its goal than the robot has come."""

    @property
    def turns_on_the_spot(self) -> bool:
        """True."""
        return True

    @property
    def inertia(self) -> InertiaParameters:
        """As its parameters have it."""
        return self.parameters

    @property
    def remaining(self) -> float:
        """Length [m] left along the path; inf without one."""
        return self._tracker.remaining if self._tracker else math.inf

    def turns_to_path_after(self, pose: Pose) -> float:
        """Time [s] in which a robot at ``pose``, in the frame of the path, turns on the spot to the point ahead."""
        p, angle = self.parameters, self._angle_left(pose, self._tracker) if self._tracker else 0.0
        return p.turns_after(angle, p.max_vel_theta)

    def to_tight_place(self, pose: Pose, speed: float = 0.0) -> float:
        """Length [m] that a robot at ``pose``, in the frame of the path, has to a tight place, see ``TightPlaces``.

        One with a ``speed`` [m/s] looks as far as it needs to brake before that.
        """
        if self._tracker is None:
            return math.inf
        fits, p = outline_fits(self, pose, PADDED), self.parameters
        reach = max(REACH, CLOSE_FROM + braking_distance(speed, p.acc_lim_x) + KEPT + 2.0 * SPACING)
        return self._tight_places.distance(self._tracker, p.allow_reversing, fits, reach)

    def set_plan(self, path: Path) -> bool:
        """Take over a path that has poses."""
        new, kept = PathTracker(path, dimensions=2) if len(path) else None, (self._room_to_turn, self._tight_places)
        self._room_to_turn, self._tight_places = carried_over(*kept, self._tracker, new)
        self._tracker, self._turn_at_goal, self.ended_early = new, TurnAtGoal(AT_END), False
        return new is not None

    def free_motion(self, request: ControlRequest) -> ControlResult:
        """Find the point ahead, steer to it, and check the motion for obstacles."""
        p, pose, tracker = self.parameters, request.pose, self._tracker
        if tracker is None:
            return no_path()
        self._measured = request.velocity
        tracker.update((pose.x, pose.y))
        self._update_end(pose, tracker)
        farthest = p.max_path_distance * self.relaxation.slack(self.clock.now()).controller_factor
        above = storeys_off(pose, tracker, self.navigation_map)
        if not self.is_leaving and (missed := missed_path(tracker, farthest, above)):
            return missed

        def blocked(motion: Twist) -> str:
            asked = there, motion, self._time_checked(motion, pose, tracker)
            obstacle = self.navigation_map.obstacle_ahead(*asked)
            if obstacle and self._stays_on_map(pose, tracker):
                return self.navigation_map.obstacle_on_path(*asked)
            return obstacle

        try:
            there = self.on_map(pose)
            if self.navigation_map.point_check()(there).state is CellState.OUTSIDE:
                return outside_map(f"({there.x:.2f}, {there.y:.2f})")
            if (out := self.drive_out(pose)) is not None:
                return ControlResult(ExePathOutcome.SUCCESS, "", self._reachable(out))
            motions, along = self._motions(pose, tracker), lambda: self._along_path(pose, tracker, p.look_ahead_dist)
            command, obstacle = self._room_to_turn.choose(
                pose, tracker.progress, motions, p.make_room_dist, blocked, along
            )
        except TransformError as error:
            return ControlResult(ExePathOutcome.TF_ERROR, str(error))
        if not self._turn_at_goal.is_turning and self._tight_places.drives_otherwise(tracker, motions[0], command):
            return self.free_motion(request)
        if obstacle and (self._tight_places.begin_next_stroke(tracker) or self._ends_here(pose, tracker)):
            return self.free_motion(request)
        if obstacle:
            return blocked_path(self.navigation_map, there, obstacle)
        return ControlResult(ExePathOutcome.SUCCESS, "", command)

    def drive_out(self, pose: Pose) -> Twist | None:
        """The motion straight out of what the robot touches at ``pose``, in the frame of the path; None without one."""
        tracker, there = self._tracker, self.on_map(pose)
        if tracker is None or self._turn_at_goal.is_turning or not self.leaving.concerns(self.navigation_map, there):
            return None
        gears = Gears(self._backward(tracker), self.may_reverse)
        asked = self._angle_left(pose, tracker), self._turn, gears, OnPath(tracker, pose, gears.backward, self.on_map)
        return self.leaving.command(self.navigation_map, there, *asked)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the path has been driven to its end, and the pose is within both tolerances of it."""
        if not (tracker := self._tracker):
            return False
        self._dist_tolerance = dist_tolerance
        self._turn_at_goal.take_tolerances(dist_tolerance, angle_tolerance)
        tracker.update((pose.x, pose.y))
        gap, turn = self._from_goal(pose, tracker)
        return tracker.has_arrived(dist_tolerance) and gap <= dist_tolerance and abs(turn) <= angle_tolerance

    def _reachable(self, motion: Twist) -> Twist:
        return self.reachable(motion, self._measured, self.parameters.max_vel_theta)

    def _motions(self, pose: Pose, tracker: PathTracker) -> list[Twist]:
        """A turn at a large heading error, or at the goal to its heading, else an arc; then what makes room for it."""
        return [self._reachable(motion) for motion in self._wanted(pose, tracker)]

    def _wanted(self, pose: Pose, tracker: PathTracker) -> list[Twist]:
        """The same for a robot that follows at once."""
        p, rolls_on = self.parameters, self._rolls_on
        backward = self._backward(tracker)
        gap, turn = self._from_goal(pose, tracker)
        if self._turn_at_goal.is_turning:
            return at_exact_end(pose, tracker, backward, turn, self._turn)
        bearing, curvature = self._carrot(pose, tracker)
        error = off_course(bearing, backward)
        tracker.cusp_reached = CUSP_REACHED
        to_tight = self.to_tight_place(pose, self._measured.vx)
        if to_tight <= CLOSE_FROM and (close := closely_along_path(tracker, pose, backward, rolls_on, p.turn_rate)):
            tracker.cusp_reached = CLOSELY
            return close
        if self._tight_places.is_close(tracker):
            return [self._turn(angle_to_path(tracker, pose, backward))]
        if abs(error) > p.rotate_to_heading_min_angle or p.turns_first(error, self._measured, p.max_vel_theta):
            return curves_ahead(self._turn(error), error, backward)
        left = max(tracker.to_cusp, gap if tracker.on_last_section else 0.0)
        until_turn_ends = p.acc_lim_theta / max(abs(curvature), 1e-6)
        braking = min(p.decel_lim_x, PLANNED * p.acc_lim_x, until_turn_ends)
        stopping = stopping_speed(left, braking, p.reaction_time)
        on_path = speed_on_path(tracker, self._measured.vx, p.look_ahead_dist, p, p.max_vel_theta)
        on_arc = p.speed_on_arc(-curvature if backward else curvature, self._measured.wz)
        speed = min(p.max_vel_x, p.max_vel_theta / max(abs(curvature), 1e-6), stopping, on_path, on_arc)
        if p.acc_lim_x < math.inf:
            speed = min(speed, speed_before(to_tight, p.acc_lim_x))
        speed = max(speed, min(MIN_SPEED, p.max_vel_x)) * (-1.0 if backward else 1.0)
        turn = max(-p.max_vel_theta, min(speed * curvature, p.max_vel_theta))
        return wider_curves(Twist.planar(vx=speed, wz=turn))

    def _along_path(self, pose: Pose, tracker: PathTracker, reach: float) -> list[Twist]:
        """Motions that keep to the path, if the outline fits on it over ``reach`` [m].

        A robot that cannot come nearer to its goal, but stands within its tolerance, only turns to its heading.
        """
        if tracker.has_arrived(self._dist_tolerance) and self._ends_here(pose, tracker):
            return [self._reachable(self._turn(self._from_goal(pose, tracker)[1]))]
        backward, fits = self._backward(tracker), outline_fits(self, pose, AS_CONFIGURED)
        if not all(fits(*one) for one in poses_ahead(tracker, reach, backward).tolist()):
            return []
        error = angle_to_path(tracker, pose, backward)
        motions = along_path(tracker, pose, backward, rolls_on=self._rolls_on, turn_rate=self.parameters.turn_rate)
        motions += [self._turn(error)] if abs(error) > least_turn(tracker) else []
        return [self._reachable(motion) for motion in motions]

    def _stays_on_map(self, pose: Pose, tracker: PathTracker) -> bool:
        """Whether the path does not leave the map as far ahead as it is looked at."""
        check, ahead = self.navigation_map.point_check(), self.parameters.look_ahead_dist
        for x, y, _ in poses_ahead(tracker, ahead, self._backward(tracker)).tolist():
            place = Pose.planar(x, y, 0.0, pose.z, pose.frame_id, pose.stamp)
            if check(self.on_map(place)).state is CellState.OUTSIDE:
                return False
        return True

    def _update_end(self, pose: Pose, tracker: PathTracker) -> None:
        """Decide whether nothing is left but to turn to the goal's heading."""
        gap, turn = self._from_goal(pose, tracker)
        driven = tracker.on_last_section and tracker.remaining < 0.5 * AT_END
        self._turn_at_goal.update(driven and gap < self._turn_at_goal.limit, turn)

    def _ends_here(self, pose: Pose, tracker: PathTracker) -> bool:
        """Take the path for driven where it leads no nearer to a goal that is within its tolerance, and turn."""
        nearly = tracker.has_arrived(self._dist_tolerance + CUSP_REACHED) and tracker.on_last_section
        is_over = self._turn_at_goal.is_turning or self.ended_early
        if is_over or not nearly or self._from_goal(pose, tracker)[0] > self._dist_tolerance:
            return False
        tracker.end()
        self.ended_early = True
        self._turn_at_goal.begin_within(self._dist_tolerance)
        return True
