"""Teleoperation: a person drives the robot by hand, as a controller does, through the velocity gate.

When to use: to move a robot out of a place that navigation does not leave, or to try it out. The stick is a deadman's
switch: the robot moves only while ``hold`` is called again and again.

Each control period: end without a fresh ``hold`` - stand on a stale map or without a pose - slow the command down, or
stop, before obstacles and before what moves - send it, limited, through the lease. Whatever happens, the last command
is zero.
"""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.drive.velocity_gate import Lease
from mbf_abstract.event_values import error_text
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.tracking.contact import SHARES
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult, PluginKind

OWNER = "teleoperation"
TAKING_OVER = "taking over"
"""The problem until the first command."""
REACTION_TIME = 0.3
"""Time [s] that passes before a robot begins to brake."""
DECELERATION = 0.5
"""With which a robot surely brakes [m/s^2]."""


class Teleoperation:
    """The stick of one robot; ``hold`` and ``release`` are called from any thread and never wait.

    While it is held the velocity gate is its own: goals that are sent then fail, and goals that run must be canceled by
    whoever holds it, before or at the same time; it waits until the gate is free.

    Parameters
    ----------
    runtime : Runtime
        Of the server.

    Attributes
    ----------
    problem : str
        Why the robot does not follow the stick as it is held; empty if it does.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.problem = ""
        self._runtime = runtime
        self._grip: _Grip | None = None

    @property
    def is_held(self) -> bool:
        """Whether somebody drives."""
        return self._grip is not None and not self._grip.is_over

    def hold(self, command: Twist) -> None:
        """Drive with a command, for at most ``command_timeout`` unless it is called again.

        After an error, e.g. of the map, the stick must be released first.
        """
        if self._grip is not None and self._grip.has_failed:
            return
        if self._grip is None or self._grip.is_over:
            self.problem = TAKING_OVER
            self._grip = grip = _Grip(self._runtime, self._take_problem)
            grip.hold(command)
            self._runtime.clock.spawn(grip.drive, OWNER)
        else:
            self._grip.hold(command)

    def release(self, reason: str = "the stick was released") -> None:
        """Stop the robot; idempotent."""
        if self._grip is not None:
            self._grip.end(reason)
            self._grip = None

    def _take_problem(self, problem: str) -> None:
        self.problem = problem


class _Grip:
    """From when the stick is taken until it is released."""

    def __init__(self, runtime: Runtime, on_problem: Callable[[str], None]) -> None:
        self._runtime, self._on_problem = runtime, on_problem
        self._command, self._held_at = Twist(), runtime.clock.now()
        self._lease: Lease | None = None
        self._reason = ""
        self.has_failed = False

    @property
    def is_over(self) -> bool:
        return bool(self._reason)

    def hold(self, command: Twist) -> None:
        self._command, self._held_at = command, self._runtime.clock.now()

    def end(self, reason: str) -> None:
        """Have the robot stopped at once, by the gate's watchdog."""
        self._reason = self._reason or reason
        if self._lease is not None:
            self._lease.revoke(self._reason)

    def drive(self) -> None:
        """Send commands until the end; on a thread of its own."""
        clock = self._runtime.clock
        try:
            with self._runtime.map_hooks.using_map(PluginKind.CONTROLLER):
                next_cycle = clock.now()
                while not self.is_over:
                    self._cycle()
                    next_cycle = max(next_cycle + 1.0 / self._runtime.parameters.controller_frequency, clock.now())
                    clock.sleep_until(next_cycle)
        except Exception as error:  # of a map or a driver: the robot stands, and the person reads why
            self.has_failed = True
            self._on_problem(f"{type(error).__name__}: {error_text(error)}")
            self.end(f"an error: {type(error).__name__}")
        finally:
            self._reason = self._reason or "the thread has ended"
            if self._lease is not None:
                self._lease.release(reason=self._reason)

    def _cycle(self) -> None:
        runtime = self._runtime
        unheld = runtime.clock.now() - self._held_at
        if unheld > runtime.parameters.command_timeout:
            self.end(f"the stick was not held for {unheld:.2f} s")
            return
        lease = self._lease = self._lease or runtime.gate.acquire(OWNER)
        if lease is None:
            self._on_problem(f"the robot is driven by {runtime.gate.holder}" if runtime.gate.holder else "no gate")
            return
        if self.is_over:  # since the lease was asked for
            lease.revoke(self._reason)
            return
        command, problem = self._safe()
        self._on_problem(problem)
        if not lease.send(command) and lease.active:
            self._on_problem(lease.problem)

    def _safe(self) -> tuple[Twist, str]:
        """The command as far as it may be followed, and why not all of it."""
        hooks, robot = self._runtime.map_hooks, self._runtime.robot
        problem = hooks.map_problem()
        if problem:
            return Twist(), problem
        try:
            pose, velocity = robot.pose(), self._runtime.velocity_or_command(robot.measured_velocity())
            command, obstacle = self._before_obstacles(pose)
        except (RobotStateError, TransformError) as error:
            return Twist(), str(error)
        answer = self._runtime.as_safe(pose, velocity, ControlResult(ExePathOutcome.SUCCESS, command=command))
        safe = answer.command if isinstance(answer.command, Twist) else Twist()
        return safe, obstacle or answer.message

    def _before_obstacles(self, pose: Pose) -> tuple[Twist, str]:
        """The largest share of the command with which the robot can stand before it touches anything."""
        wanted, first = self._runtime.gate.limits.apply(self._command), ""
        assert isinstance(wanted, Twist)
        for share in SHARES:
            command = Twist.planar(share * wanted.vx, share * wanted.vy, share * wanted.wz)
            ahead = REACTION_TIME + command.speed / (2.0 * DECELERATION)
            obstacle = self._runtime.map_hooks.obstacle_ahead(pose, command, ahead)
            if not obstacle:
                return command, first
            first = first or obstacle
        return Twist(), first
