"""Regulated pure pursuit: steer along the arc to a carrot on the path, slower in curves, near obstacles, at the end.

When to use: a good global path that is to be followed as it is, at little computing time (under 0.2 ms a cycle, 0.3 ms
while it turns at its goal). Forward-only, reversing and turn-in-place robots. When not: obstacles that are not in the
path - it stops before them (BLOCKED_PATH) and never drives around; that needs replanning, ``costmap.dwa`` or
``costmap.mppi``. It cuts corners by about look_ahead^2 / (8 * radius); cars, which cannot always correct that, keep to
their path by ``control.close_steering``.
Formula: pure pursuit (Coulter 1992), curvature = 2 y / L^2; the speeds are those of ``control.regulated_speed``.
"""

from __future__ import annotations

import math
from dataclasses import replace

from mbf_abstract.execution.path_tracker import CUSP_REACHED
from mbf_abstract.geometry import FloatArray, Path, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.continued_path import carried_over
from mbf_abstract.maps.controllers.driving_out import Gears, LeavesContacts, OnPath
from mbf_abstract.maps.controllers.end_of_path import at_exact_end, swept_poses, turn_left
from mbf_abstract.maps.controllers.failures import blocked_path, missed_goal, obstacle_text
from mbf_abstract.maps.controllers.room_to_turn import (
    CREEPING,
    RoomToTurn,
    along_path,
    angle_to_path,
    closely_along_path,
    curves_ahead,
    no_tighter,
    off_course,
    poses_ahead,
    wider_curves,
)
from mbf_abstract.maps.controllers.tight_places import (
    CLOSE_FROM,
    CLOSELY,
    KEPT,
    REACH,
    SPACING,
    TightPlaces,
    least_turn,
    speed_before,
)
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_costmap_nav.control.close_steering import steer_closely
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.control.rolling import RollingPursuit, sweep_step

LEADS_OUT = 0.3  # m; so far a robot that touches something looks whether the motion leads out
SLOWEST = 0.01  # m/s; slower commands are looked ahead for as long as this one, to bound the work


class RegulatedPurePursuitController(LeavesContacts, RollingPursuit):
    """Carrot follower with regulated speed."""

    leaves_contacts = True
    _known_free: Twist | None = None
    _room_to_turn = RoomToTurn()
    _tight_places = TightPlaces()

    def set_plan(self, path: Path) -> bool:
        """Take over a path; that the robot stood at the end of the last one no longer counts."""
        old, self._at_goal, taken = self.tracker, False, super().set_plan(path)
        self._room_to_turn, self._tight_places = carried_over(self._room_to_turn, self._tight_places, old, self.tracker)
        return taken

    def free_motion(self, request: ControlRequest) -> ControlResult:
        """Find the carrot, choose between turning and driving, regulate the speed, look ahead for collisions."""
        cycle = self.begin_cycle(request)
        if isinstance(cycle, ControlResult):
            return cycle
        if self.turning_radius > 0.0 and (missed := missed_goal(cycle.tracker, request.pose, cycle.goal_tolerance)):
            return missed
        if (drive_out := self._drive_out(cycle)) is not None:
            return ControlResult(ExePathOutcome.SUCCESS, "", self._reachable(cycle, drive_out))
        motions = self._motions(cycle)
        result = self._checked(cycle, motions)
        if not self._at_goal and self._tight_places.drives_otherwise(cycle.tracker, motions[0], result.command):
            return self.free_motion(request)
        is_blocked = result.outcome == ExePathOutcome.BLOCKED_PATH
        if is_blocked and self.tracker and self._tight_places.begin_next_stroke(self.tracker):
            return self.free_motion(request)
        if not isinstance(command := result.command, Twist):
            return result
        if command.vx != 0.0 and self._rolls(cycle, command):
            command = self._slowed(command, request.velocity)
        return replace(result, command=self._reachable(cycle, command))

    def _drive_out(self, cycle: ControlCycle) -> Twist | None:
        """The motion that leads straight out of what is touched; None for a car, at the goal and where none does."""
        pose, concerns = cycle.request.pose, self.rotates and self.leaving.concerns(self.costmap, cycle.request.pose)
        if not concerns or self._turn_at_goal(cycle) is not None:
            return None
        gears = Gears(self._backward(cycle), self.may_reverse, True)
        asked = self._angle_left(cycle), lambda angle: self._turn(cycle, angle), gears
        out = self.leaving.command(self.costmap, pose, *asked, OnPath(cycle.tracker, pose, gears.backward))
        return out if out is None or out.vx == 0.0 else self._slowed(out, cycle.request.velocity)

    def _motions(self, cycle: ControlCycle) -> list[Twist]:
        """The motion that is wanted, then those that make room for it."""
        backward, pose = self._backward(cycle), cycle.request.pose
        if (turn := self._turn_at_goal(cycle)) is not None:
            return at_exact_end(pose, cycle.tracker, backward, turn, lambda angle: self._turn(cycle, angle))
        carrot = self._carrot(cycle)
        close = self._closely(cycle, backward)
        if steered := self._steered(cycle, backward, is_tight=bool(close)):
            return [steered]
        if close:
            return close
        error = off_course(math.atan2(carrot[1], carrot[0]), backward)
        turning, measured = self.parameters.rotate_to_heading_vel, cycle.request.velocity
        turns = abs(error) > self.parameters.rotate_to_heading_min_angle
        if self.rotates and (turns or self.inertia.turns_first(error, measured, turning)):
            return curves_ahead(self._turn(cycle, error), error, backward)
        return wider_curves(self._drive(cycle, self._curvature_to(carrot), backward))

    def _closely(self, cycle: ControlCycle, backward: bool) -> list[Twist]:
        """Motions that creep along the path where a tight place is near ahead; none far from the path."""
        assert self.tracker is not None
        self.tracker.cusp_reached = CUSP_REACHED

        def fits(x: float, y: float, yaw: float) -> bool:
            return not cycle.footprint.collides(cycle.costmap, x, y, yaw)

        rolls_on, p = self._rolls_on(cycle), self.parameters
        reach = max(REACH, CLOSE_FROM + rolls_on + KEPT + 2.0 * SPACING)
        to_tight = self._tight_places.distance(cycle.tracker, p.allow_reversing, fits, reach)
        self._fastest = speed_before(to_tight, p.acc_lim_x)
        if to_tight > CLOSE_FROM:
            return []
        motions = closely_along_path(cycle.tracker, cycle.request.pose, backward, rolls_on, self.inertia.turn_rate)
        close = [no_tighter(motion, self.turning_radius) for motion in motions]
        if close:
            self.tracker.cusp_reached = CLOSELY
        elif self.rotates and self._tight_places.is_close(cycle.tracker):
            turn = self._turn(cycle, angle_to_path(cycle.tracker, cycle.request.pose, backward))
            return [Twist() if self._rolls(cycle, turn) else turn]
        return [
            motion if self._rolls(cycle, motion) else self._slowed(motion, cycle.request.velocity) for motion in close
        ]

    def _steered(self, cycle: ControlCycle, backward: bool, *, is_tight: bool) -> Twist | None:
        """The arc by which a car keeps best to its path, creeping in a tight place; None far from the path."""
        self._known_free = None
        if self.turning_radius == 0.0 or cycle.touches:
            return None
        assert self.tracker is not None
        tightest = self._drive(cycle, 1.0 / self.turning_radius, backward)
        swift = None if is_tight else self._swiftly(cycle, backward, tightest.vx)
        if swift is not None and not self._blocked(cycle, swift):
            self.tracker.cusp_reached = CLOSELY
            return swift
        creeping = self._slowed(Twist.planar(-CREEPING if backward else CREEPING), cycle.request.velocity)
        speed = creeping.vx if is_tight else tightest.vx
        curvature = steer_closely(cycle, self.turning_radius, speed, self.parameters, is_tight=is_tight)
        if curvature is None:
            return None
        self.tracker.cusp_reached = CLOSELY
        self._known_free = Twist.planar(speed, wz=abs(speed) * curvature)
        return self._known_free

    def _along_path(self, cycle: ControlCycle) -> list[Twist]:
        """Motions that keep to the path before its end, if the outline fits on it as far as the farthest look-ahead."""
        if self._at_goal:
            return []
        backward, pose = self._backward(cycle), cycle.request.pose
        ahead = poses_ahead(cycle.tracker, self.look_ahead_distance(self.full_speed), backward)
        if cycle.first_collision(ahead) >= 0:
            return []
        rolls_on, turn_rate = self._rolls_on(cycle), self.inertia.turn_rate
        close = along_path(cycle.tracker, pose, backward, rolls_on=rolls_on, turn_rate=turn_rate)
        motions = [motion for motion in close if abs(motion.wz) * self.turning_radius <= abs(motion.vx)]
        if not self.rotates:
            return motions
        error = angle_to_path(cycle.tracker, pose, backward)
        if self._rolls(cycle, Twist()):
            return [*motions, Twist()] if self._can_turn_where_it_stops(cycle, backward) else motions
        return [*motions, self._turn(cycle, error)] if abs(error) > least_turn(cycle.tracker) else motions

    # ----------------------------------------------------------------------------------------------- collisions
    def _checked(self, cycle: ControlCycle, motions: list[Twist]) -> ControlResult:
        """Take the first motion that is free within the distance for making room, else refuse."""
        if not self.parameters.collision_check and not cycle.touches:
            return ControlResult(ExePathOutcome.SUCCESS, "", motions[0])
        pose, progress, distance = cycle.request.pose, cycle.tracker.progress, self.parameters.make_room_dist
        command, reason = self._room_to_turn.choose(
            pose,
            progress,
            motions,
            distance,
            lambda motion: self._blocked(cycle, motion),
            lambda: self._along_path(cycle),
        )
        if reason:
            return blocked_path(self.costmap, pose, reason)
        return ControlResult(ExePathOutcome.SUCCESS, "", command)

    def _blocked(self, cycle: ControlCycle, command: Twist) -> str:
        """Where a command leads into an obstacle in the check time, not beyond the next cusp; empty if free."""
        if command is self._known_free:
            return ""
        command = self._reachable(cycle, command)
        rolls = self._rolls(cycle, command)
        if command.vx == 0.0 and not rolls and self.costmap.unpadded_footprint.is_circle:
            return ""  # whatever the polygon does that stands for it
        if self._at_goal and command.vx == 0.0:
            return self._blocked_at_goal(cycle, command)
        duration, shortest = self.parameters.check_ahead_time, self.parameters.min_distance_to_obstacle
        if cycle.touches:
            shortest = max(shortest, LEADS_OUT)
        if command.vx != 0.0:  # a robot that may creep as far as the check time allows ends up at the obstacle
            duration = max(duration, shortest / max(abs(command.vx), SLOWEST))
        duration = max(duration, self.inertia.time_on_arc(command)) / cycle.limit_factor
        poses, step = (self._rolled if rolls else self._driven)(cycle, command, duration)
        hit = cycle.first_collision(poses)
        if hit < 0:
            return ""
        x, y = poses[hit, 0], poses[hit, 1]
        return obstacle_text(f"({x:.2f}, {y:.2f}) in {(hit + 1) * step:.2f} s")

    def _driven(self, cycle: ControlCycle, command: Twist, duration: float) -> tuple[FloatArray, float]:
        """Poses (n, 3) of the next ``duration`` [s] at most, and the time [s] between them."""
        if command.vx != 0.0:  # it stops at a cusp
            duration = min(duration, cycle.tracker.to_cusp / abs(command.vx))
        elif command.wz != 0.0:  # and where it has turned to what it turns to
            duration = min(duration, abs(self._angle_left(cycle)) / abs(command.wz))
        outline_speed = abs(command.vx) + abs(command.wz) * cycle.footprint.footprint.circumscribed_radius
        step, pose = self._step(cycle, outline_speed), cycle.request.pose
        driven = command.vx, 0.0, command.wz, max(duration, step), step
        return arc_poses((pose.x, pose.y, pose.yaw), *driven), step

    def _blocked_at_goal(self, cycle: ControlCycle, command: Twist) -> str:
        """Where a turn at the goal leads into an obstacle before the robot has its heading; empty if it does not.

        One that still turns the wrong way only brakes.
        """
        turn, now = self._turn_at_goal(cycle) or 0.0, cycle.request.velocity.wz
        brakes = command.wz * turn < 0.0 and abs(command.wz) < abs(now) and command.wz * now > 0.0
        angle = 0.5 * command.wz**2 / self.parameters.acc_lim_theta if brakes else turn_left(turn, command)
        poses = swept_poses(cycle.request.pose, math.copysign(angle, command.wz), sweep_step(cycle))
        hit = cycle.first_collision_of_turn(poses)
        x, y, yaw = poses[hit]
        return obstacle_text(f"({x:.2f}, {y:.2f}, {yaw:.2f} rad)") if hit >= 0 else ""
