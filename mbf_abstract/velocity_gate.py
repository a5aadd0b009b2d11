"""The only writer to the robot: leases, limits, a watchdog, and zero velocity on every way out.

A controller or recovery drives through a *lease*. One lease exists at a time; a command through a lease that was
released or revoked is dropped, so nothing a late thread does can move the robot (promise P1). When commands stop
coming for ``command_timeout`` the watchdog sends zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from mbf_abstract.clock import Clock, Priority
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventBus, EventKind
from mbf_abstract.geometry import AckermannCommand, Command, Twist
from mbf_abstract.robot import Robot

CURVATURE_TOLERANCE = 1e-6  # a controller that keeps to the same circle must not be corrected for its rounding


@dataclass(frozen=True)
class VelocityLimits:
    """Limits of commands; a component beyond its limit scales the whole command, so its direction is kept.

    Attributes
    ----------
    max_vx, min_vx : float
        Forward and (negative or zero) reverse limit [m/s].
    max_vy : float
        Sideways limit [m/s].
    max_wz : float
        Yaw rate limit [rad/s].
    max_steering_angle : float
        Limit of an Ackermann command's steering angle [rad], clamped on its own.
    min_turning_radius : float
        Radius [m] of the tightest curve; 0 = the robot may turn on the spot. A twist keeps its speed and loses what is
        too much of its yaw rate, all of it where it does not drive.
    """

    max_vx: float = math.inf
    min_vx: float = -math.inf
    max_vy: float = math.inf
    max_wz: float = math.inf
    max_steering_angle: float = math.inf
    min_turning_radius: float = 0.0

    def apply(self, command: Command) -> Command:
        """Return the command within the limits; the same object if it already is."""
        if isinstance(command, AckermannCommand):
            speed = min(max(command.speed, self.min_vx), self.max_vx)
            angle = min(max(command.steering_angle, -self.max_steering_angle), self.max_steering_angle)
            limited = AckermannCommand(speed, angle)
            return command if limited == command else limited
        return self._scaled(self._curved(command))

    def _curved(self, command: Twist) -> Twist:
        """Widen a curve that is too tight."""
        speed = math.hypot(command.vx, command.vy)
        if abs(command.wz) * self.min_turning_radius <= speed * (1.0 + CURVATURE_TOLERANCE):
            return command
        wx, wy, wz = command.angular
        return Twist(command.linear, (wx, wy, math.copysign(speed / self.min_turning_radius, wz)))

    def _scaled(self, command: Twist) -> Twist:
        """Slow down what is too fast, all components alike: the curve stays."""
        scale = min(
            _scale(command.vx, self.max_vx if command.vx > 0.0 else -self.min_vx),
            _scale(command.vy, self.max_vy),
            _scale(command.wz, self.max_wz),
        )
        if scale >= 1.0:
            return command
        return Twist(
            (command.linear[0] * scale, command.linear[1] * scale, command.linear[2] * scale),
            (command.angular[0] * scale, command.angular[1] * scale, command.angular[2] * scale),
        )


def _scale(value: float, limit: float) -> float:
    return 1.0 if abs(value) <= limit else limit / abs(value)


def zero_like(command: Command) -> Command:
    """The stop command of the same type; a car keeps its steering angle."""
    return replace(command, speed=0.0) if isinstance(command, AckermannCommand) else Twist()


def command_data(command: Command) -> list[float]:
    """The command's numbers for an event: [vx, vy, wz], or [speed, steering angle]."""
    if isinstance(command, AckermannCommand):
        return [command.speed, command.steering_angle]
    return [command.vx, command.vy, command.wz]


class Lease:
    """The right to drive, until released or revoked. Thread-safe."""

    def __init__(self, gate: VelocityGate, owner: str) -> None:
        self._gate = gate
        self.owner = owner
        self.paused = False

    @property
    def active(self) -> bool:
        """Whether commands through this lease still reach the robot (unless paused)."""
        return self._gate._lease is self

    def send(self, command: Command) -> bool:
        """Send one command, limited; False if it was dropped."""
        return self._gate._send(self, command)

    def stop(self) -> None:
        """Send zero velocity now, keeping the lease."""
        self._gate._stop(self, "asked by the lease's owner")

    def pause(self) -> None:
        """Stop the robot and drop commands until ``resume``; idempotent."""
        self._gate._pause(self)

    def resume(self) -> None:
        """Let commands pass again; idempotent."""
        self.paused = False

    def release(self, stop: bool = True, reason: str = "released") -> None:
        """Give the right back; sends zero unless ``stop`` is False (the watchdog then does, a little later)."""
        self._gate._release(self, stop, reason)


class VelocityGate:
    """Guards one robot. Close it and the robot stands for good."""

    def __init__(
        self, robot: Robot, clock: Clock, events: EventBus, limits: VelocityLimits, command_timeout: float
    ) -> None:
        self._robot = robot
        self._clock = clock
        self._events = events
        self.limits = limits
        self.command_timeout = command_timeout
        self._condition = clock.condition()
        self._lease: Lease | None = None
        self._last_command: Command = Twist()
        self._last_time = clock.now()
        self._closed = False
        self._watchdog = clock.spawn(self._watch, "velocity watchdog", Priority.WATCHDOG)

    @property
    def holder(self) -> str:
        """Owner of the present lease, empty if nobody drives."""
        lease = self._lease
        return lease.owner if lease else ""

    @property
    def last_command(self) -> Command:
        """What the robot was told last."""
        return self._last_command

    def acquire(self, owner: str) -> Lease | None:
        """Hand out the lease, or None while somebody holds it or the gate is closed."""
        with self._condition:
            if self._lease is not None or self._closed:
                return None
            self._lease = Lease(self, owner)
            self._events.emit(EventKind.LEASE_GRANTED, "velocity_gate", holder=owner)
            return self._lease

    def close(self, reason: str = "server shut down") -> None:
        """Stop the robot for good: revoke the lease, refuse new ones, end the watchdog. Idempotent."""
        with self._condition:
            if self._closed:
                return
            self._closed = True
            owner = self.holder
            self._lease = None
            self._zero()
            self._events.emit(EventKind.GATE_CLOSED, "velocity_gate", holder=owner, reason=reason)
            self._condition.notify_all()

    # ------------------------------------------------------------------------------------ from leases
    def _send(self, lease: Lease, command: Command) -> bool:
        with self._condition:
            if self._lease is not lease or lease.paused:
                why = "the lease is paused" if self._lease is lease else "the lease is over"
                self._events.emit(EventKind.COMMAND_DROPPED, lease.owner, command=command_data(command), reason=why)
                return False
            limited = self.limits.apply(command)
            if limited is not command:
                self._events.emit(
                    EventKind.COMMAND_CLAMPED, lease.owner, requested=command_data(command), sent=command_data(limited)
                )
            return self._write(limited)

    def _stop(self, lease: Lease, reason: str) -> None:
        with self._condition:
            if self._lease is lease and not self._last_command.is_stopped(0.0, 0.0):
                self._zero()
                self._events.emit(EventKind.ROBOT_STOPPED, lease.owner, reason=reason)

    def _pause(self, lease: Lease) -> None:
        with self._condition:
            if self._lease is lease and not lease.paused:
                lease.paused = True
                self._zero()
                self._events.emit(EventKind.ROBOT_STOPPED, lease.owner, reason="paused")

    def _release(self, lease: Lease, stop: bool, reason: str) -> None:
        with self._condition:
            if self._lease is not lease:
                return
            self._lease = None
            if stop:
                self._zero()
            self._events.emit(EventKind.LEASE_REVOKED, "velocity_gate", holder=lease.owner, reason=reason)

    # ---------------------------------------------------------------------------------------- writing
    def _write(self, command: Command) -> bool:
        """Give one command to the driver; False, and an event, if the driver raises."""
        delivered = True
        try:
            self._robot.send_command(command)
        except BaseException as error:  # also sys.exit() in a driver: the watchdog must live on
            delivered = False
            self._events.emit(
                EventKind.FAULT, "robot", where="send_command", type=type(error).__name__, message=error_text(error)
            )
        was_stopped = self._last_command.is_stopped(0.0, 0.0)
        if delivered or not command.is_stopped(0.0, 0.0):
            self._last_command = command  # a zero that was not delivered is tried again by the watchdog
        self._last_time = self._clock.now()
        if was_stopped:
            self._condition.notify_all()  # the watchdog sleeps while the robot is told to stand
        return delivered

    def _zero(self) -> None:
        self._write(zero_like(self._last_command))

    def _watch(self) -> None:
        with self._condition:
            while not self._closed:
                if self._last_command.is_stopped(0.0, 0.0):
                    self._condition.wait()
                    continue
                silence = self._clock.now() - self._last_time
                if silence < self.command_timeout - 1e-9:
                    self._condition.wait(self.command_timeout - silence)
                    continue
                self._zero()
                self._events.emit(
                    EventKind.ROBOT_STOPPED,
                    "velocity_gate",
                    reason=f"no command for {silence:.3f} s",
                    holder=self.holder,
                )
