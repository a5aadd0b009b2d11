"""A bare goal pose in, the ``move_base`` action run: the adapter for tools that only know how to point at the map.

Like the topic ``move_base_simple/goal``: the newest goal counts. Without the traps of the old relay: the planner and
the controller are the server's defaults, whatever their names, and ``cancel`` reaches the goal.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathFeedback, MoveBaseGoal, MoveBaseResult
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.navigator import Navigator

MoveBaseHandle = GoalHandle[MoveBaseGoal, MoveBaseResult, ExePathFeedback]


class SimpleGoal:
    """Sends goal poses to ``move_base``; ``fields`` are further fields of every ``MoveBaseGoal``."""

    def __init__(self, navigator: Navigator, **fields: Any) -> None:
        self._navigator = navigator
        self._fields = fields
        self.handle: MoveBaseHandle | None = None
        """The newest goal's handle, None before the first."""

    def __call__(self, pose: Pose) -> MoveBaseHandle:
        """Go there; a goal that is still running is taken over."""
        self.handle = self._navigator.send(MoveBaseGoal(pose, **self._fields))
        return self.handle

    def cancel(self) -> None:
        """Cancel the newest goal; does nothing if there is none."""
        if self.handle is not None:
            self.handle.cancel()
