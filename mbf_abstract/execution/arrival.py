"""Decides whether the robot has arrived: by the plugin's answer, by the server's tolerances, or by either."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.tangent_plane import SAME_STOREY, at_height_of, ground_distance, heading_error
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.maps.relaxation import NO_SLACK, Slack

ToleranceCheck = Literal["plugin", "either", "exclusive"]

STRAYING = 2.0
"""So many times its distance from the path a robot may be short of the path's end: a controller may leave the path."""
DEPTH_SHARE = 0.9
"""Share of the end's depth in an area that a controller may stop short of it."""


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

    def within(self, pose: Pose, tracker: PathTracker) -> bool:
        """Whether ``pose`` is inside both tolerances, at the end of the path and not where the path passes earlier."""
        close = ground_distance(pose, self.goal, self.same_storey) < self.dist_tolerance
        lift = at_height_of(pose, self.goal, self.same_storey).distance_to(
            pose
        )  # a path may climb to a goal above the ground
        driven = tracker.has_arrived(self.dist_tolerance + STRAYING * tracker.deviation + lift)
        return close and driven and abs(heading_error(pose, self.goal)) < self.angle_tolerance
