"""Watchdogs: stop a running child when the robot gets nowhere, and fail with a code that selects a recovery.

Three independent questions: does the robot come closer to the end of its path (progress), does it leave the place it is
at (oscillation), and do its wheels follow the commands (motors)? A lost pose or odometry raises no alarm here: the
actions end with their own code then.
"""

from __future__ import annotations

from abc import abstractmethod

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.execution.motion_watch import OscillationDetector
from mbf_abstract.executives.nodes import Decorator
from mbf_abstract.geometry import Path
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.time.clock import Stopwatch


class Watchdog(Decorator):
    """Fail and make the child idle once ``alarm`` returns a message; a goal that is paused starts it anew."""

    outcome: ExePathOutcome = ExePathOutcome.ROBOT_STUCK

    def __init__(self, name: str, child: Behaviour, timeout: float) -> None:
        super().__init__(name, child)
        self.timeout = timeout

    @abstractmethod
    def alarm(self) -> str:
        """What is wrong; empty while all is well. Called at each tick of a running child; may raise RobotStateError."""

    def update(self) -> Status:
        """Return the child's status unless there is an alarm."""
        if self.decorated.status != Status.RUNNING:
            return self.decorated.status
        if self.mission.paused:
            self.initialise()
            return Status.RUNNING
        try:
            text = self.alarm()
        except RobotStateError:
            return Status.RUNNING
        if not text:
            return Status.RUNNING
        self.feedback_message = text
        self.mission.fail(ActionResult(int(self.outcome), text))
        return Status.FAILURE


class ProgressWatchdog(Watchdog):
    """Alarm when ``timeout`` [s] pass without ``distance`` [m] of progress along the path.

    A new path sets a new distance to go but not the time back: a second planner must not keep a stuck robot waiting.
    """

    def __init__(self, name: str, child: Behaviour, timeout: float, distance: float = 0.1) -> None:
        super().__init__(name, child, timeout)
        self.distance = distance
        self._path: Path | None = None
        self._least: float | None = None

    def initialise(self) -> None:
        """Forget what was reached before."""
        self._watch = Stopwatch(self.mission.clock)
        self._least = None

    def alarm(self) -> str:
        """Compare the distance to go with the least so far."""
        feedback = self.mission.feedback
        if self.mission.path is not self._path:
            self._path, self._least = self.mission.path, None
        if feedback is not None and self._least is None:
            self._least = feedback.distance_along_path
        elif feedback is not None and self._least is not None:
            if feedback.distance_along_path <= self._least - self.distance:
                self._least = feedback.distance_along_path
                self._watch.restart()
        if self._watch.elapsed < self.timeout:
            return ""
        return f"no {self.distance:g} m of progress along the path within {self.timeout:g} s"


class OscillationWatchdog(Watchdog):
    """Alarm when for ``timeout`` [s] the robot has neither moved ``distance`` [m] nor turned ``angle`` [rad] away."""

    outcome = ExePathOutcome.OSCILLATION

    def __init__(self, name: str, child: Behaviour, timeout: float, distance: float = 0.5, angle: float = 3.14) -> None:
        super().__init__(name, child, timeout)
        self.distance = distance
        self.angle = angle

    def initialise(self) -> None:
        """Start at the present pose."""
        self._detector = OscillationDetector(self.mission.clock)

    def alarm(self) -> str:
        """Compare the pose with the reference."""
        if not self._detector.check(self.mission.robot_pose(), self.timeout, self.distance, self.angle):
            return ""
        return f"the robot has not left a circle of {self.distance:g} m within {self.timeout:g} s"


class MotorWatchdog(Watchdog):
    """Alarm when for ``timeout`` [s] the robot is commanded to move and stands; never for a robot without odometry."""

    def initialise(self) -> None:
        """Start the time."""
        self._watch = Stopwatch(self.mission.clock)

    def alarm(self) -> str:
        """Compare the command with the measured velocity."""
        runtime = self.mission.navigator.server.runtime
        obeys = runtime.gate.last_command.is_stopped() or not runtime.robot.velocity().is_stopped()
        if obeys or not runtime.robot.has_odometry:
            self._watch.restart()
        if self._watch.elapsed < self.timeout:
            return ""
        return f"the motors have ignored commands for {self.timeout:g} s"
