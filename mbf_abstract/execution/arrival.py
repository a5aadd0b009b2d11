"""Decides whether the robot has arrived: by the plugin's answer, by the server's tolerances, or by either.

Also where it stops then: a robot that slides out of the tolerance after it has stopped is driven back in.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.tangent_plane import SAME_STOREY, at_height_of, ground_distance, heading_error
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.maps.relaxation import NO_SLACK, Slack
from mbf_abstract.time.clock import Clock

ToleranceCheck = Literal["plugin", "either", "exclusive"]

STRAYING = 2.0
"""So many times its distance from the path a robot may be short of the path's end: a controller may leave the path."""
DEPTH_SHARE = 0.9
"""Share of the end's depth in an area that a controller may stop short of it."""

MAX_RETURNS = 3
"""So many times a robot is driven back into the tolerance it has slid out of."""
SLIDE_MARGIN = 1.5
"""So many times as far as it slid it is driven in again: it may slide farther the next time."""
LEAST_SHARE = 0.25
"""Share of the tolerance that is always left to the controller on the way back in."""
NEARER = 0.01
"""Less [m] than this is not nearer to the goal."""
LONGEST_APPROACH = 1.0
"""Time [s] after which a robot within its tolerance that comes no nearer stops where it is."""


@dataclass(frozen=True)
class ArrivalCheck:
    """The arrival rule of one goal.

    Attributes
    ----------
    goal : Pose
        Last pose of the path, in the global frame.
    dist_tolerance, angle_tolerance : float
        Largest distance [m] and difference in heading [rad] in the robot's tangent plane, exclusive; passed to the
        controller whoever decides, so that it does not stop short. With an area the distance is at most what keeps a
        robot at the end of the path inside.
    check : {"plugin", "either", "exclusive"}
        Who decides: the controller; the controller or the server; the server alone.
    area : GoalArea, optional
        Decides alone where there is one.
    same_storey : float
        A goal at most so far [m] above or below the robot is reached from below or above; infinity on level maps.
    """

    goal: Pose
    dist_tolerance: float
    angle_tolerance: float
    check: ToleranceCheck = "plugin"
    area: GoalArea | None = None
    same_storey: float = SAME_STOREY

    def __post_init__(self) -> None:
        depth = self.area.depth(self.goal) if self.area is not None else 0.0
        if depth > 0.0:
            object.__setattr__(self, "dist_tolerance", min(self.dist_tolerance, DEPTH_SHARE * depth))

    def relaxed(self, slack: Slack) -> ArrivalCheck:
        """Return the same rule with tolerances at least as wide as the slack; an area is tolerance enough."""
        if self.area is not None or slack is NO_SLACK:
            return self
        return replace(
            self,
            dist_tolerance=max(self.dist_tolerance, slack.arrival_distance),
            angle_tolerance=max(self.angle_tolerance, slack.arrival_angle),
        )

    def reached(self, pose: Pose, tracker: PathTracker, plugin_agrees: bool) -> bool:
        """Apply the rule to a pose, the progress on the path, and the controller's answer."""
        if self.area is not None:
            return self.area.contains(at_height_of(pose, self.goal, self.same_storey))
        if self.check == "exclusive":
            return self.within(pose, tracker)
        return plugin_agrees or (self.check == "either" and self.within(pose, tracker))

    def distance(self, pose: Pose) -> float:
        """Distance [m] to the end of the path in the robot's tangent plane."""
        return ground_distance(pose, self.goal, self.same_storey)

    def is_elsewhere(self, other: ArrivalCheck) -> bool:
        """Whether another goal is meant, and not another path to the same."""
        return self.goal.distance_to(other.goal) > self.dist_tolerance

    def within(self, pose: Pose, tracker: PathTracker) -> bool:
        """Whether ``pose`` is inside both tolerances, at the end of the path and not where the path passes earlier."""
        close = self.distance(pose) < self.dist_tolerance
        lift = at_height_of(pose, self.goal, self.same_storey).distance_to(
            pose
        )  # a path may climb to a goal above the ground
        driven = tracker.has_arrived(self.dist_tolerance + STRAYING * tracker.deviation + lift)
        return close and driven and abs(heading_error(pose, self.goal)) < self.angle_tolerance


class StopsAtGoal:
    """Where a robot stops near the end of its path, and whether it may try again after it has slid away.

    The first stop is at the tolerance. The next are farther in, by more than the robot slid, or as far in as it gets.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.reset()

    def reset(self) -> None:
        """Begin anew, for another goal."""
        self.returns = 0
        self._limit = math.inf
        self._slide = 0.0
        self._stopped_at = 0.0
        self._nearest = math.inf
        self._nearer_since = self._clock.now()

    def is_arrived(self, arrival: ArrivalCheck, pose: Pose, stands: bool, ask: Callable[[float], bool]) -> bool:
        """Whether a robot that drives may stop here, or one that stands has arrived.

        Parameters
        ----------
        ask : callable
            Answers for a distance tolerance [m] whether the goal is reached; that is how far in a controller drives.
        """
        full = arrival.dist_tolerance
        if stands or self.returns == 0:
            return ask(full)
        distance, wanted = arrival.distance(pose), min(full, max(self._limit, LEAST_SHARE * full))
        if distance < self._nearest - NEARER:
            self._nearest, self._nearer_since = distance, self._clock.now()
        if distance <= wanted or self._clock.now() - self._nearer_since >= LONGEST_APPROACH:
            return ask(full)
        ask(wanted)
        return False

    def begin(self, arrival: ArrivalCheck, pose: Pose) -> None:
        """Take note that the robot is stopped here."""
        self._stopped_at = arrival.distance(pose)

    def drive_back(self, arrival: ArrivalCheck, pose: Pose) -> str:
        """Take note that the robot stands outside; why it is not to be driven back in, or an empty text."""
        distance = arrival.distance(pose)
        self._slide = max(self._slide, distance - self._stopped_at)
        self._limit = self._stopped_at - SLIDE_MARGIN * self._slide
        self._nearest, self._nearer_since = distance, self._clock.now()
        self.returns += 1
        if self.returns <= MAX_RETURNS:
            return ""
        return f"{distance:.2f} m from its goal: the robot slid away each of the {self.returns} times it stopped"
