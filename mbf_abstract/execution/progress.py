"""How far along its path the robot is: the numbers of the feedback, and the end of a robot that gets no farther."""

from __future__ import annotations

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathFeedback
from mbf_abstract.plugins import ControlResult
from mbf_abstract.time.clock import Clock, Stopwatch

LEAST_PROGRESS = 0.1
"""Progress along the path [m], or rotation towards the final heading [rad], that counts."""
NEAR_END = 0.5
"""Length [m] left of the path below which turning to the final heading is progress."""


class PathProgress:
    """Feedback of a robot that is tracked along one path after the other."""

    def __init__(self, clock: Clock, tracker: PathTracker) -> None:
        self._watch = Stopwatch(clock)
        self.restart(tracker)

    def restart(self, tracker: PathTracker) -> None:
        """Begin on a new path."""
        self._tracker = tracker
        self._start_distance: float | None = None
        self._watch.restart()

    @property
    def path(self) -> Path:
        """The path of now."""
        return self._tracker.path

    def feedback(self, pose: Pose, result: ControlResult) -> ExePathFeedback:
        """Feedback of one control cycle."""
        goal = self.path[-1]
        to_go = self._tracker.deviation + self._tracker.remaining
        if self._start_distance is None:
            self._start_distance = to_go
        done, elapsed = self._start_distance - to_go, self._watch.elapsed
        time_to_goal = to_go * elapsed / done if done > 0.0 else float("inf")
        return ExePathFeedback(
            outcome=int(result.outcome),
            message=result.message,
            current_pose=pose,
            dist_to_goal=pose.distance_to(goal),
            angle_to_goal=pose.angle_to(goal),
            distance_along_path=to_go,
            time_to_goal=time_to_goal,
            last_command=result.command,
        )


class ProgressDetector:
    """Fires when a robot has come no farther for some time, whatever it does meanwhile.

    Farther is ``LEAST_PROGRESS`` along its path, also where a new one replaces it on the way, or as much nearer to the
    final heading at its end. Turning, driving to and fro and driving back are none.
    """

    def __init__(self, clock: Clock) -> None:
        self.stopwatch = Stopwatch(clock)
        self._tracker: PathTracker | None = None
        self._last = 0.0
        self._advanced = 0.0
        self._least_turn = float("inf")

    def check(self, pose: Pose, tracker: PathTracker, timeout: float) -> bool:
        """Take in this cycle's pose and progress; True if it is time to end. A ``timeout`` of 0 switches it off."""
        if self._tracker is None:
            self.stopwatch.restart()
        if self._tracker is not tracker:
            self._tracker, self._last = tracker, 0.0
        self._advanced += tracker.progress - self._last
        self._last = tracker.progress
        turn = pose.angle_to(tracker.goal) if tracker.remaining <= NEAR_END else float("inf")
        if self._advanced >= LEAST_PROGRESS or turn < self._least_turn - LEAST_PROGRESS:
            self._advanced, self._least_turn = 0.0, min(turn, self._least_turn)
            self.stopwatch.restart()
        return 0.0 < timeout <= self.stopwatch.elapsed
