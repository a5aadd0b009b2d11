"""When has the robot arrived? By the plugin's answer, by the server's tolerances, or by either."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from mbf_abstract.geometry import Pose
from mbf_abstract.goal_area import GoalArea
from mbf_abstract.relaxation import Slack

ToleranceCheck = Literal["plugin", "either", "exclusive"]


@dataclass(frozen=True)
class ArrivalCheck:
    """The arrival rule of one goal.

    Attributes
    ----------
    goal : Pose
        Last pose of the path, in the global frame.
    dist_tolerance, angle_tolerance : float
        Largest 3D distance [m] and rotation [rad], exclusive.
    check : {"plugin", "either", "exclusive"}
        Who decides: the controller; the controller or the server; the server alone.
    area : GoalArea, optional
        Decides alone where there is one.
    """

    goal: Pose
    dist_tolerance: float
    angle_tolerance: float
    check: ToleranceCheck = "plugin"
    area: GoalArea | None = None

    def relaxed(self, slack: Slack) -> ArrivalCheck:
        """Return the same rule with tolerances at least as wide as the slack."""
        return replace(
            self,
            dist_tolerance=max(self.dist_tolerance, slack.arrival_distance),
            angle_tolerance=max(self.angle_tolerance, slack.arrival_angle),
        )

    def reached(self, pose: Pose, ask_plugin: Callable[[], bool]) -> bool:
        """Apply the rule; ``ask_plugin`` is called only where its answer counts."""
        if self.area is not None:
            return self.area.contains(pose)
        if self.check == "exclusive":
            return self.within(pose)
        return ask_plugin() or (self.check == "either" and self.within(pose))

    def within(self, pose: Pose) -> bool:
        """Whether ``pose`` is inside both tolerances."""
        close = pose.distance_to(self.goal) < self.dist_tolerance
        return close and pose.angle_to(self.goal) < self.angle_tolerance
