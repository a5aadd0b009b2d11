"""The contract of controllers: they drive a loopback robot along a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Command, Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult
from mbf_abstract.testing.contract.report import Report
from mbf_abstract.testing.contract.rig import (
    ContextMaker,
    Rig,
    cancel_latency,
    canceled_token,
    expect_idle_cancel_is_harmless,
    rig,
    same_context,
)
from mbf_abstract.time.cancel import CancelToken

_SPAN = range(100, 150)
_PERIOD = 0.05  # s
_REPEATED_CYCLES = 40
_CYCLES_TO_STOP = 100


def on_flat_ground(pose: Pose) -> Pose:
    """Leave the robot's pose where it is."""
    return pose


def check_controller(
    controller_class: type[AbstractController],
    path: Path,
    *,
    make_context: ContextMaker = same_context,
    parameters: PluginParameters | None = None,
    watched: Sequence[NDArray[Any]] = (),
    on_ground: Callable[[Pose], Pose] = on_flat_ground,
    dist_tolerance: float = 0.2,
    angle_tolerance: float = 3.2,
    time_limit: float = 60.0,
    cancel_within: float = 0.1,
) -> None:
    """Check a controller against the contract.

    Parameters
    ----------
    path : Path
        A path it can follow to its end; the robot starts on the first pose.
    make_context, parameters, watched, cancel_within
        As for ``check_planner``.
    on_ground : callable
        Puts the robot's pose on the surface, for maps that are not flat.
    dist_tolerance, angle_tolerance : float
        Of the arrival [m, rad].
    time_limit : float
        Simulated time [s] it has to arrive; 0 = it need not.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    """
    report = Report(controller_class, [path.positions, np.asarray(path.orientations), *watched])
    check = _ControllerCheck(report, path, on_ground, (dist_tolerance, angle_tolerance))

    def fresh() -> Any:
        return rig(controller_class, make_context, parameters, path[0])

    with report.no_exception("construction"):
        with fresh() as made:
            first = check.drive(made, _REPEATED_CYCLES)
            if first and time_limit > 0.0:
                check.arrive(made, time_limit)
        with fresh() as made:
            same = check.drive(made, _REPEATED_CYCLES) == first
            report.expect(same, "two instances with the same seed gave different commands")
            check.new_plan_while_driving(made)
        with fresh() as made:
            check.cancel(made, cancel_within)
    report.finish()


class _ControllerCheck:
    """Situations of one controller."""

    def __init__(
        self, report: Report, path: Path, on_ground: Callable[[Pose], Pose], tolerances: tuple[float, float]
    ) -> None:
        self.report = report
        self.path = path
        self.on_ground = on_ground
        self.tolerances = tolerances

    def drive(self, made: Rig[AbstractController], cycles: int) -> list[Command | None]:
        """Take the path and run some cycles; return the commands."""
        if not self._set_plan(made, "a good path"):
            return []
        far = made.robot.pose.distance_to(self.path[-1]) > self.tolerances[0]
        self.report.expect(not (far and self._is_arrived(made)), "claims arrival at the start of the path")
        return [self._cycle(made, "driving") for _ in range(cycles)]

    def arrive(self, made: Rig[AbstractController], time_limit: float) -> None:
        """Drive to the end of the path."""
        end = made.clock.now() + time_limit
        while made.clock.now() < end and not self._is_arrived(made):
            self._cycle(made, "driving")
        gap = made.robot.pose.distance_to(self.path[-1])
        self.report.expect(self._is_arrived(made), f"did not arrive in {time_limit:g} s, {gap:.2f} m from the goal")

    def new_plan_while_driving(self, made: Rig[AbstractController]) -> None:
        """Swap the path under the running controller."""
        if self._set_plan(made, "a new path while driving"):
            self._cycle(made, "after a new path")

    def cancel(self, made: Rig[AbstractController], within: float) -> None:
        """Cancel while idle, before a cycle and during one, and let a controller stop by itself."""
        expect_idle_cancel_is_harmless(self.report, made.plugin)
        if not self._set_plan(made, "a path after an idle cancel"):
            return
        self.report.expect(self._cycle(made, "after an idle cancel") is not None, "an idle cancel is remembered")
        latency, _ = cancel_latency(lambda token: self._cycle(made, "canceled in a cycle", token), 0.0)
        self.report.expect(
            latency <= within, f"canceled in a cycle: returned {latency:.3f} s later, limit {within:g} s"
        )
        stops_itself = made.plugin.cancel()
        self._cycle(made, "after cancel()", canceled_token())
        if stops_itself:
            self._expect_stop(made)
        if self._set_plan(made, "a path after a cancel"):
            self.report.expect(self._cycle(made, "after a cancel") is not None, "set_plan does not end a cancel")

    def _expect_stop(self, made: Rig[AbstractController]) -> None:
        for _ in range(_CYCLES_TO_STOP):
            result = self._compute(made, "stopping by itself", CancelToken())
            if result is None or result.outcome == ExePathOutcome.CANCELED or self._is_arrived(made):
                return
            self._apply(made, result)
        seconds = _CYCLES_TO_STOP * _PERIOD
        self.report.expect(False, f"cancel() gave True, but after {seconds:g} s it has not returned CANCELED (101)")

    def _set_plan(self, made: Rig[AbstractController], situation: str) -> bool:
        accepted = False
        with self.report.no_exception(f"set_plan of {situation}"):
            accepted = made.plugin.set_plan(self.path)
            self.report.expect(accepted is True, f"set_plan of {situation} gave {accepted!r}")
        return bool(accepted)

    def _is_arrived(self, made: Rig[AbstractController]) -> bool:
        arrived = False
        with self.report.no_exception("is_goal_reached"):
            arrived = bool(made.plugin.is_goal_reached(self.on_ground(made.robot.pose), *self.tolerances))
        return arrived

    def _cycle(self, made: Rig[AbstractController], situation: str, token: CancelToken | None = None) -> Command | None:
        """One control cycle; the command, or None if it failed."""
        return self._apply(made, self._compute(made, situation, token or CancelToken()))

    def _compute(self, made: Rig[AbstractController], situation: str, token: CancelToken) -> ControlResult | None:
        odometry = made.robot.odometry()
        velocity = odometry.velocity if odometry else Twist()
        request = ControlRequest(self.on_ground(made.robot.pose), velocity, token)
        result = self.report.call(
            situation, lambda: made.plugin.compute_velocity_commands(request), ControlResult, ExePathOutcome, _SPAN
        )
        if result is None:
            return None
        no_command = result.success and result.command is None
        self.report.expect(not no_command, f"{situation}: success without a command")
        return result

    def _apply(self, made: Rig[AbstractController], result: ControlResult | None) -> Command | None:
        command = result.command if result is not None and result.success else None
        made.robot.send_command(command or Twist())
        made.clock.sleep(_PERIOD)
        return command
