"""How far along its path the robot is: the numbers of the feedback."""

from __future__ import annotations

import numpy as np

from mbf_abstract.actions.goals import ExePathFeedback
from mbf_abstract.arithmetic import norm
from mbf_abstract.clock import Clock, Stopwatch
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.plugins import ControlResult

SEARCH_AHEAD = 3.0  # m along the path; a path that comes back past the robot is not short-cut


class PathProgress:
    """Follows the robot along a path; the nearest pose is searched ahead of the last one only."""

    def __init__(self, clock: Clock, path: Path) -> None:
        self._watch = Stopwatch(clock)
        self.restart(path)

    def restart(self, path: Path) -> None:
        """Begin on a new path."""
        self.path = path
        self._remaining = path.remaining_lengths
        self._index = 0
        self._start_distance: float | None = None
        self._watch.restart()

    def distance_along_path(self, pose: Pose) -> float:
        """Distance to go [m]: straight to the nearest pose or the one after it, then along the path."""
        horizon = self._remaining[self._index] - SEARCH_AHEAD
        end = int(np.searchsorted(-self._remaining, -horizon, side="right")) + 1
        window = self.path.positions[self._index : max(end, self._index + 2)]
        distances = norm(window - np.asarray(pose.position))
        nearest = int(np.argmin(distances))
        to_go = distances[nearest : nearest + 2] + self._remaining[self._index + nearest :][:2]
        self._index += nearest
        return float(to_go.min())

    def feedback(self, pose: Pose, result: ControlResult) -> ExePathFeedback:
        """Feedback of one control cycle."""
        goal = self.path[-1]
        to_go = self.distance_along_path(pose)
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
