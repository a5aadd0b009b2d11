"""Finds a robot that tilts too far, ignores its commands, or moves without getting anywhere."""

from __future__ import annotations

import math

from mbf_abstract.execution.oscillation import OscillationDetector
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.execution.progress import ProgressDetector
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.time.clock import Stopwatch


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
        """Take in a cycle, with the measured velocity of a robot that has odometry; why the loop shall end, if so."""
        parameters = self._runtime.parameters
        tilt = tilt_of(pose)
        if parameters.max_tilt is not None and tilt > parameters.max_tilt:
            allowed = math.degrees(parameters.max_tilt)
            return ExePathOutcome.ROBOT_STUCK, (
                f"the robot tilts by {math.degrees(tilt):.1f} degrees, allowed are {allowed:.1f}: "
                "the ground is steeper than planned"
            )
        commanded = not self._runtime.gate.last_command.is_stopped()
        if not (commanded and measured is not None and measured.is_stopped()):
            self._ignored.restart()
        elif 0.0 < parameters.cmd_vel_ignored_tolerance < self._ignored.elapsed:
            return ExePathOutcome.ROBOT_STUCK, f"the robot has ignored its commands for {self._ignored.elapsed:.1f} s"
        if self._oscillation.check(
            pose, parameters.oscillation_timeout, parameters.oscillation_distance, parameters.oscillation_angle
        ):
            return ExePathOutcome.OSCILLATION, (
                f"the robot has not moved {parameters.oscillation_distance:g} m "
                f"nor turned {parameters.oscillation_angle:g} rad in {parameters.oscillation_timeout:g} s"
            )
        if self._progress.check(pose, tracker, parameters.progress_timeout):
            left = f"{tracker.remaining:.2f} m before the path's end"
            return ExePathOutcome.OSCILLATION, f"no progress in {parameters.progress_timeout:g} s, {left}"
        return None
