"""A goal area that is given in another frame than the server's global one."""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_area import GoalArea


@dataclass(frozen=True)
class TransformedArea(GoalArea):
    """An area of any kind, placed once: it stays where it is if the frames move against each other later.

    Attributes
    ----------
    area : GoalArea
        In the child frame of the transform.
    transform : Transform
        From the frame of the area to the one in which it is asked for.
    """

    area: GoalArea
    transform: Transform

    @property
    def frame_id(self) -> str:
        """Frame in which it is asked for."""
        return self.transform.parent

    def depth(self, pose: Pose) -> float:
        """That of the pose in the frame of the area."""
        return self.area.depth(self.transform.inverse().apply_to_pose(pose))

    def members(self) -> tuple[Pose, ...]:
        """Those of the area."""
        return tuple(self.transform.apply_to_pose(member) for member in self.area.members())
