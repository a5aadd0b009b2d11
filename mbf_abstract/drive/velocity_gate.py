"""The only writer to the robot: leases, limits, a watchdog, and zero velocity at every end.

A controller or recovery drives through a *lease*. One lease exists at a time; a command through a lease that was
released or revoked is dropped, so nothing a late thread does can move the robot (promise P1). When commands stop
coming for ``command_timeout`` the watchdog sends zero.
"""

from __future__ import annotations

import math

from mbf_abstract.drive.command_writer import CommandWriter
from mbf_abstract.drive.commands import command_data, command_problem
from mbf_abstract.drive.robot import Robot
from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.events import EventBus, EventKind
from mbf_abstract.geometry import Command
from mbf_abstract.time.clock import Clock, Priority, ThreadDetached

CLOSING_TRIES = 3
"""How often the watchdog of a closed gate still tries to stop a robot whose driver fails."""


class Lease:
    """The right to drive, until released or revoked. Thread-safe."""

    def __init__(self, gate: VelocityGate, owner: str) -> None:
        self._gate = gate
        self.owner = owner
        self.paused = False
        self.problem = ""
        """Why the last command through this lease did not reach the robot; empty if it did."""

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

    def ask_stop(self, reason: str) -> None:
        """Have the watchdog send zero at once, keeping the lease; for other threads than the owner's, never waits."""
        self._gate._ask_stop(self, reason)

    def revoke(self, reason: str) -> None:
        """Take the right away from its owner and have the watchdog send zero at once; never waits."""
        self._gate._revoke(self, reason)


class VelocityGate:
    """Guards one robot. Close it and the robot stands for good."""

    def __init__(
        self, robot: Robot, clock: Clock, events: EventBus, limits: VelocityLimits, command_timeout: float
    ) -> None:
        self._clock = clock
        self._events = events
        self.limits = limits
        self._command_timeout = command_timeout
        self._condition = clock.condition()
        self._writer = CommandWriter(robot, clock, events, self._condition)
        self._lease: Lease | None = None
        self._stop_asked = ""  # the reason
        self._tried_at = -math.inf
        self._closed = False
        self._closing_tries = CLOSING_TRIES
        self._spawn_watchdog()

    @property
    def holder(self) -> str:
        """Owner of the present lease, empty if nobody drives."""
        lease = self._lease
        return lease.owner if lease else ""

    @property
    def last_command(self) -> Command:
        """The last command sent to the robot."""
        return self._writer.last_command

    @property
    def command_timeout(self) -> float:
        """Time after the last command at which the watchdog sends zero [s]."""
        return self._command_timeout

    @command_timeout.setter
    def command_timeout(self, seconds: float) -> None:
        with self._condition:
            self._command_timeout = seconds
            self._condition.notify_all()

    def acquire(self, owner: str) -> Lease | None:
        """Hand out the lease, or None while somebody holds it or the gate is closed."""
        with self._condition:
            if self._lease is not None or self._closed:
                return None
            self._lease = Lease(self, owner)
            self._events.emit(EventKind.LEASE_GRANTED, "velocity_gate", holder=owner)
            return self._lease

    def close(self, reason: str = "server shut down") -> None:
        """Stop the robot for good: revoke the lease, refuse new ones, end the watchdog. Idempotent.

        Where another call of the driver is under way, zero follows it; that is waited for, at most ``command_timeout``.
        """
        with self._condition:
            if self._closed:
                return
            self._closed = True
            owner = self.holder
            self._lease = None
            self._events.emit(EventKind.GATE_CLOSED, "velocity_gate", holder=owner, reason=reason)
            stop = self._writer.begin_stop()
            self._condition.notify_all()
            if stop is None:
                self._writer.wait_until_free(self._command_timeout)
        self._writer.deliver(stop)

    # ------------------------------------------------------------------------------------ from leases
    def _send(self, lease: Lease, command: Command) -> bool:
        with self._condition:
            problem = command_problem(command)
            if not problem and self._writer.busy and self._lease is lease:
                self._writer.wait_until_free(self._command_timeout)
            reason = problem or self._reason_to_drop(lease)
            if reason:
                sent = [] if problem else command_data(command)
                self._events.emit(EventKind.COMMAND_DROPPED, lease.owner, command=sent, reason=reason)
                begun = self._writer.begin_stop() if problem and self._lease is lease else None
            else:
                begun = self._writer.begin(self._limited(lease, command))
        delivered = self._writer.deliver(begun) and not reason
        lease.problem = "" if delivered else reason or self._writer.problem
        return delivered

    def _reason_to_drop(self, lease: Lease) -> str:
        if self._lease is not lease:
            return "the lease is over"
        if lease.paused:
            return "the lease is paused"
        return "the robot's driver has not come back from an earlier command" if self._writer.busy else ""

    def _limited(self, lease: Lease, command: Command) -> Command:
        limited = self.limits.apply(command)
        if limited is not command:
            self._events.emit(
                EventKind.COMMAND_CLAMPED, lease.owner, requested=command_data(command), sent=command_data(limited)
            )
        return limited

    def _stop(self, lease: Lease, reason: str) -> None:
        with self._condition:
            if self._lease is not lease or self._writer.stands:
                return
            self._events.emit(EventKind.ROBOT_STOPPED, lease.owner, reason=reason)
            stop = self._writer.begin_stop()
        self._writer.deliver(stop)

    def _pause(self, lease: Lease) -> None:
        with self._condition:
            if self._lease is not lease or lease.paused:
                return
            lease.paused = True
            self._events.emit(EventKind.ROBOT_STOPPED, lease.owner, reason="paused")
            stop = self._writer.begin_stop()
        self._writer.deliver(stop)

    def _release(self, lease: Lease, stop: bool, reason: str) -> None:
        with self._condition:
            if self._lease is not lease:
                return
            self._end_lease(lease, reason)
            zero = self._writer.begin_stop() if stop else None
        self._writer.deliver(zero)

    def _ask_stop(self, lease: Lease, reason: str) -> None:
        with self._condition:
            if self._lease is lease and not self._writer.stands:
                self._wake_watchdog(reason)

    def _revoke(self, lease: Lease, reason: str) -> None:
        with self._condition:
            if self._lease is lease:
                self._end_lease(lease, reason)
                self._wake_watchdog(reason)

    def _end_lease(self, lease: Lease, reason: str) -> None:
        self._lease = None
        self._events.emit(EventKind.LEASE_REVOKED, "velocity_gate", holder=lease.owner, reason=reason)

    # ------------------------------------------------------------------------------------- the watchdog
    def _wake_watchdog(self, reason: str) -> None:
        self._stop_asked = reason
        self._condition.notify_all()

    def _spawn_watchdog(self) -> None:
        self._clock.spawn(self._watch, "velocity watchdog", Priority.WATCHDOG)

    def _watch(self) -> None:
        try:
            while True:
                with self._condition:
                    reason = self._wait_for_reason()
                    if not reason:
                        return
                    holder, overdue = self.holder, not self._stop_asked
                    self._stop_asked = ""
                    self._tried_at = self._clock.now()
                    stop = self._writer.begin_stop(although_busy=overdue)
                if self._writer.deliver(stop):
                    self._events.emit(EventKind.ROBOT_STOPPED, "velocity_gate", reason=reason, holder=holder)
        except ThreadDetached:  # the driver kept the processor busy: somebody else has to watch
            self._spawn_watchdog()

    def _wait_for_reason(self) -> str:
        """Wait until the robot must be stopped and say why; empty once the gate is closed and nothing is left to do."""
        while True:
            if self._stop_asked:
                return self._stop_asked
            if self._writer.stands or (self._closed and not self._closing_tries):
                if self._closed:
                    return ""
                self._condition.wait()
                continue
            now = self._clock.now()
            remaining = max(self._writer.last_time, self._tried_at) + self._command_timeout - now
            if remaining > 1e-9:
                self._condition.wait(remaining)
                continue
            self._closing_tries -= self._closed
            return f"no command for {now - self._writer.last_time:.3f} s"
