"""Finds a robot that tilts too far, ignores its commands, or moves without getting anywhere."""

from __future__ import annotations

import math

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.time.clock import Clock, Stopwatch

LEAST_PROGRESS = 0.1
"""Progress along the path [m], or rotation towards the final heading [rad], that counts."""
NEAR_END = 0.5
"""Length [m] left of the path below which turning to the final heading is progress."""

LEAST_RESPONSE = 0.1
"""Share of the commanded speeds below which a robot counts as standing."""


class MotionWatch:
    """Watches one control loop."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._ignored = Stopwatch(runtime.clock)
        self._oscillation = OscillationDetector(runtime.clock)
        self._progress = ProgressDetector(runtime.clock)
        self._stopwatches = (self._ignored, self._oscillation.stopwatch, self._progress.stopwatch)

    def pause(self) -> None:
        """Let no time count until ``resume``."""
        for watch in self._stopwatches:
            watch.pause()

    def resume(self) -> None:
        """Let time count again."""
        for watch in self._stopwatches:
            watch.resume()

    def note_command(self) -> None:
        """Take note that a command follows; until now the robot stood because zero was commanded."""
        if self._runtime.gate.last_command.is_stopped():
            self._ignored.restart()

    def problem(self, pose: Pose, measured: Twist | None, tracker: PathTracker) -> tuple[ExePathOutcome, str] | None:
        """Check one cycle; ``measured`` is None without odometry. Returns why the loop must end, or None."""
        parameters = self._runtime.parameters
        tilt = tilt_of(pose)
        if parameters.max_tilt is not None and tilt > parameters.max_tilt:
            allowed = math.degrees(parameters.max_tilt)
            return ExePathOutcome.ROBOT_STUCK, (
                f"the robot tilts by {math.degrees(tilt):.1f} degrees, allowed are {allowed:.1f}: "
                "the ground is steeper than planned"
            )
        if measured is None or not _ignores(self._runtime.velocity_or_command(None), measured):
            self._ignored.restart()
        elif 0.0 < parameters.cmd_vel_ignored_tolerance < self._ignored.elapsed:
            return ExePathOutcome.ROBOT_STUCK, f"the robot has ignored its commands for {self._ignored.elapsed:.1f} s"
        if self._oscillation.check(
            pose, parameters.oscillation_timeout, parameters.oscillation_distance, parameters.oscillation_angle
        ):
            return ExePathOutcome.OSCILLATION, (
                f"the robot has neither moved {parameters.oscillation_distance:g} m "
                f"nor turned {parameters.oscillation_angle:g} rad in {parameters.oscillation_timeout:g} s"
            )
        if self._progress.check(pose, tracker, parameters.progress_timeout):
            left = f"{tracker.remaining:.2f} m before the path's end"
            return ExePathOutcome.OSCILLATION, f"no progress in {parameters.progress_timeout:g} s, {left}"
        return None


def _ignores(command: Twist, measured: Twist) -> bool:
    """Whether hardly any of a command is carried out: wheels that slip make a robot shiver on the spot."""
    least = max(LEAST_RESPONSE * command.speed, 1e-3), max(LEAST_RESPONSE * abs(command.wz), 1e-3)
    return not command.is_stopped() and measured.is_stopped(*least)


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
        """Take in a new pose; True if the robot oscillates.

        Limits in s, m and rad, as the class has them. A ``timeout`` of 0 switches the detector off.
        """
        if self._reference is None or pose.distance_to(self._reference) >= distance:
            self.reset(pose)
        elif pose.angle_to(self._reference) >= angle:
            self.reset(pose)
        return timeout > 0.0 and self.stopwatch.elapsed >= timeout


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
