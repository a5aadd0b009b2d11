"""Detects a robot that moves without getting anywhere."""

from __future__ import annotations

from mbf_abstract.geometry import Pose
from mbf_abstract.time.clock import Clock, Stopwatch


class OscillationDetector:
    """Fires when for ``timeout`` seconds the robot has neither moved nor turned far from a reference pose.

    Moving at least ``distance`` [m] or turning at least ``angle`` [rad] away from the reference pose makes the present
    pose the new reference and starts the time again.
    """

    def __init__(self, clock: Clock) -> None:
        self.stopwatch = Stopwatch(clock)
        self._reference: Pose | None = None

    def reset(self, pose: Pose | None = None) -> None:
        """Start again, from ``pose`` or from the next one that is checked."""
        self._reference = pose
        self.stopwatch.restart()

    def check(self, pose: Pose, timeout: float, distance: float, angle: float) -> bool:
        """Take in a new pose; True if the robot oscillates. A ``timeout`` of 0 switches the detector off."""
        if self._reference is None or pose.distance_to(self._reference) >= distance:
            self.reset(pose)
        elif pose.angle_to(self._reference) >= angle:
            self.reset(pose)
        return timeout > 0.0 and self.stopwatch.elapsed >= timeout
