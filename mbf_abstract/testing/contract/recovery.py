"""The contract of recovery behaviours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import NDArray

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest, RecoveryResult
from mbf_abstract.testing.contract.report import Report
from mbf_abstract.testing.contract.rig import (
    ContextMaker,
    Rig,
    canceled_token,
    expect_idle_cancel_is_harmless,
    rig,
    same_context,
)
from mbf_abstract.time.cancel import CancelToken

_SPAN = range(150, 200)
_STOP_WITHIN = 0.2  # s of simulated time
_LONGEST_RUN = 120.0  # s of simulated time


class RigMotion:
    """The ``Motion`` of a behaviour under test: drives the loopback robot, and refuses on request.

    Attributes
    ----------
    lost : bool
        The robot's state is unknown.
    closed : bool
        The gate refuses every command.
    """

    def __init__(self, made: Rig[AbstractRecovery], token: CancelToken, on_ground: Callable[[Pose], Pose]) -> None:
        self._made = made
        self._token = token
        self._on_ground = on_ground
        self.lost = False
        self.closed = False
        self.commands: list[Command] = []

    def pose(self) -> Pose:
        """True pose of the robot; raises RobotStateError if it is lost."""
        if self.lost:
            raise RobotStateError("no fresh robot pose: the contract check has taken it away")
        return self._on_ground(self._made.robot.pose)

    def velocity(self) -> Twist:
        """Measured velocity; raises RobotStateError if the robot is lost."""
        if self.lost:
            raise RobotStateError("no fresh odometry: the contract check has taken it away")
        odometry = self._made.robot.odometry()
        return odometry.velocity if odometry else Twist()

    def send(self, command: Command) -> bool:
        """Drive the robot, unless the gate is closed."""
        if self.closed:
            return False
        self.commands.append(command)
        self._made.robot.send_command(command)
        return True

    def sleep(self, seconds: float) -> bool:
        """Wait in simulated time; False as soon as the token is set."""
        end = min(self._made.clock.now() + seconds, _LONGEST_RUN)
        while not self._token.cancelled and self._made.clock.now() < end:
            self._made.clock.sleep(min(0.02, end - self._made.clock.now()))
        return not self._token.cancelled and self._made.clock.now() < _LONGEST_RUN


def check_recovery(
    recovery_class: type[AbstractRecovery],
    *,
    start: Pose | None = None,
    make_context: ContextMaker = same_context,
    parameters: PluginParameters | None = None,
    watched: Sequence[NDArray[Any]] = (),
    on_ground: Callable[[Pose], Pose] = lambda pose: pose,
) -> None:
    """Check a recovery behaviour against the contract.

    Parameters
    ----------
    start : Pose, optional
        Where the robot stands; the origin if not given.
    make_context, parameters, watched
        As for ``check_planner``; leave out of ``watched`` what the behaviour is there to clear.
    on_ground : callable
        Puts the robot's pose on the surface, for maps that are not flat.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    """
    report = Report(recovery_class, watched)
    check = _RecoveryCheck(report, on_ground)

    def fresh() -> Any:
        return rig(recovery_class, make_context, parameters, start or Pose.planar(0.0, 0.0))

    with report.no_exception("construction"):
        runs = []
        for _ in range(2):
            with fresh() as made:
                runs.append(check.whole_run(made))
        report.expect(runs[0] == runs[1], "two instances with the same seed did different things")
        with fresh() as made:
            check.canceled_before(made)
        with fresh() as made:
            check.canceled_midway(made, runs[0][-1] / 2.0)
        for trouble in ("lost", "closed"):
            with fresh() as made:
                check.trouble(made, trouble)
    report.finish()


class _RecoveryCheck:
    """Situations of one behaviour."""

    def __init__(self, report: Report, on_ground: Callable[[Pose], Pose]) -> None:
        self.report = report
        self.on_ground = on_ground

    def whole_run(self, made: Rig[AbstractRecovery]) -> tuple[int | None, list[Command], float]:
        """Run to the end; return outcome, commands and simulated time [s]."""
        expect_idle_cancel_is_harmless(self.report, made.plugin)
        motion, result = self._run(made, "a whole run", CancelToken())
        seconds = made.clock.now()
        self.report.expect(seconds < _LONGEST_RUN, f"a whole run: not over after {_LONGEST_RUN:g} s")
        return None if result is None else result.outcome, motion.commands, seconds

    def canceled_before(self, made: Rig[AbstractRecovery]) -> None:
        """Expect that a token that is set already keeps the robot where it is."""
        motion, result = self._run(made, "canceled before", canceled_token())
        moved = [command for command in motion.commands if not command.is_stopped()]
        self.report.expect(not moved, f"canceled before: sent {moved[:1]}")
        if result is not None:
            allowed = result.success or result.outcome == RecoveryOutcome.CANCELED
            self.report.expect(allowed, f"canceled before: outcome {result.outcome}, expected CANCELED (151)")

    def canceled_midway(self, made: Rig[AbstractRecovery], moment: float) -> None:
        """Set the token in the middle of the run."""
        token = CancelToken()

        def cancel() -> None:
            made.clock.sleep(moment)
            token.cancel("canceled midway")

        made.clock.spawn(cancel, "contract cancel")
        self._run(made, "canceled midway", token)
        late = made.clock.now() - moment
        text = f"canceled midway: ended {late:.2f} s later, limit {_STOP_WITHIN:g} s"
        self.report.expect(moment == 0.0 or late <= _STOP_WITHIN, text)

    def trouble(self, made: Rig[AbstractRecovery], trouble: str) -> None:
        """Take away the robot's state, or close the gate."""
        self._run(made, f"with the {'robot' if trouble == 'lost' else 'gate'} {trouble}", CancelToken(), trouble)
        self.report.expect(made.clock.now() < _LONGEST_RUN, f"with the state {trouble}: it does not end")

    def _run(
        self, made: Rig[AbstractRecovery], situation: str, token: CancelToken, trouble: str = ""
    ) -> tuple[RigMotion, RecoveryResult | None]:
        motion = RigMotion(made, token, self.on_ground)
        motion.lost, motion.closed = trouble == "lost", trouble == "closed"
        request = RecoveryRequest(motion, token)
        result = self.report.call(
            situation, lambda: made.plugin.run_behavior(request), RecoveryResult, RecoveryOutcome, _SPAN
        )
        command = made.robot.command
        self.report.expect(command.is_stopped(), f"{situation}: left the robot driving with {command}")
        return motion, result
