"""Where ``follow_path`` steers: the point ahead, turns, what inertia leaves of a motion, and how long that takes.

When to use: as the base of ``follow_path``, which chooses among motions and looks whether they are free. When not:
controllers with another law.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.maps.controllers.end_of_path import turn_left
from mbf_abstract.maps.controllers.follow_path_parameters import FollowPathParameters
from mbf_abstract.maps.controllers.inertia import braking_distance
from mbf_abstract.maps.controllers.room_to_turn import off_course
from mbf_abstract.maps.controllers.turn_at_goal import TurnAtGoal, from_goal
from mbf_abstract.maps.map_plugin import MapPlugin

AT_END = 0.05
"""Nearer [m] to the goal a robot only turns to its heading, unless the goal's tolerance is less."""
SHORTEST_CHECK = 0.05  # s


class SteeringToPath(MapPlugin):
    """Steers to a point ahead on the path."""

    parameters: FollowPathParameters
    _turn_at_goal = TurnAtGoal(AT_END)
    _measured = Twist()

    def _time_checked(self, motion: Twist, pose: Pose, tracker: PathTracker) -> float:
        """How long [s] a motion must be free: until it ends at a cusp or has turned far enough, at most as set.

        Of a turn to the goal's heading the whole sweep must be: where it is blocked later, no way is left to drive on.
        """
        left, speed = min(tracker.to_cusp, self._arc_to_goal(pose, tracker)), abs(motion.vx)
        shortest = max(self.parameters.time_on_arc(Twist.planar(wz=motion.wz)), SHORTEST_CHECK)
        if motion.vx == 0.0 != motion.wz and self._turn_at_goal.is_turning:
            return max(turn_left(self._from_goal(pose, tracker)[1], motion) / abs(motion.wz), shortest)
        if motion.vx == 0.0:
            left, speed = abs(self._angle_left(pose, tracker)), abs(motion.wz)
        longest = max(self.parameters.check_ahead_time, self.parameters.time_on_arc(motion))
        return max(min(longest, left / speed), shortest) if speed > 0.0 else longest

    def _arc_to_goal(self, pose: Pose, tracker: PathTracker) -> float:
        """Length [m] of the arc to the goal where that is the point ahead; it cuts what the path still goes around."""
        if not tracker.on_last_section or tracker.remaining > self.parameters.look_ahead_dist:
            return math.inf
        angle = abs(off_course(self._carrot(pose, tracker)[0], self._backward(tracker)))
        if angle >= 0.5 * math.pi:
            return math.inf
        gap = self._from_goal(pose, tracker)[0]
        return gap * angle / math.sin(angle) if angle > 0.0 else gap

    def _angle_left(self, pose: Pose, tracker: PathTracker) -> float:
        """Angle [rad] to the goal's heading at the end of the path, else to the point ahead on it."""
        if self._turn_at_goal.is_turning:
            return self._from_goal(pose, tracker)[1]
        return off_course(self._carrot(pose, tracker)[0], self._backward(tracker))

    def _carrot(self, pose: Pose, tracker: PathTracker) -> tuple[float, float]:
        """Bearing [rad] of the point ahead on the path, and curvature [1/m] of the arc to it."""
        last, ahead = tracker.on_last_section, self.parameters.look_ahead_dist
        x, y = (tracker.point_at(tracker.progress + ahead) if last else tracker.carried_on(ahead)).tolist()
        return arc_to(pose, np.array([x, y, pose.z]))

    def _backward(self, tracker: PathTracker) -> bool:
        return self.parameters.allow_reversing and tracker.driving_backward

    def _turn(self, angle: float) -> Twist:
        p = self.parameters
        rate = max(-p.max_vel_theta, min(p.turn_gain * angle, p.max_vel_theta))
        return Twist.planar(wz=p.turn_rate(rate, angle))

    @property
    def _rolls_on(self) -> float:
        """Length [m] that the robot rolls until it creeps."""
        return braking_distance(self._measured.vx, self.parameters.acc_lim_x)

    def _from_goal(self, pose: Pose, tracker: PathTracker) -> tuple[float, float]:
        """Distance [m] and angle [rad] from the pose to the last one of the path."""
        return from_goal(pose, tracker.goal, self.navigation_map.same_storey)
