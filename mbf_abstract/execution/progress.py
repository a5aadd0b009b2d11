"""The feedback of a robot that follows a path: how far it has come, and when it will be there."""

from __future__ import annotations

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.plugins import ControlResult
from mbf_abstract.time.clock import Clock, Stopwatch

SET_OFF = 0.05
"""A robot that has come this far [m] has set off. Before that it may turn on the spot, and has no speed to go by."""


class PathProgress:
    """Feedback of a robot that is tracked along one path after the other."""

    def __init__(self, clock: Clock, tracker: PathTracker) -> None:
        self._watch = Stopwatch(clock)
        self.restart(tracker)

    def restart(self, tracker: PathTracker) -> None:
        """Begin on a new path."""
        self._tracker = tracker
        self._goal = tracker.goal
        self._start_distance: float | None = None
        self._watch.restart()

    @property
    def path(self) -> Path:
        """The path of now."""
        return self._tracker.path

    def feedback(self, pose: Pose, result: ControlResult) -> ExePathFeedback:
        """Feedback of one control cycle."""
        to_go = self._tracker.deviation + self._tracker.remaining
        if self._start_distance is None:
            self._start_distance = to_go
        done = self._start_distance - to_go - SET_OFF
        if done <= 0.0:
            self._watch.restart()
        time_to_goal = to_go * self._watch.elapsed / done if done > 0.0 else float("inf")
        return ExePathFeedback(
            outcome=int(result.outcome),
            message=result.message,
            current_pose=pose,
            dist_to_goal=pose.distance_to(self._goal),
            angle_to_goal=pose.angle_to(self._goal),
            distance_along_path=to_go,
            time_to_goal=time_to_goal,
            last_command=result.command,
        )
