"""The only writer to the robot: leases, limits, a watchdog, and zero velocity at every end.

A controller or recovery drives through a *lease*. One exists at a time; a command through one that was released or
revoked is dropped, so no late thread moves the robot (P1). After ``command_timeout`` without commands zero is sent.
"""

from __future__ import annotations

import math

from mbf_abstract.drive.command_writer import CommandWriter
from mbf_abstract.drive.commands import command_data, command_problem
from mbf_abstract.drive.robot import Robot
from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.event_bus import EventBus
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Command
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock, Priority, ThreadDetached

CLOSING_TRIES = 3
"""How often the watchdog of a closed gate still tries to stop a robot whose driver fails."""


class Lease:
    """The right to drive, until released or revoked. Thread-safe.

    Attributes
    ----------
    paused : bool
        Whether commands are dropped until ``resume``.
    problem : str
        Why the last command through this lease did not reach the robot; empty if it did.
    """

    def __init__(self, gate: VelocityGate, owner: str) -> None:
        self._gate = gate
        self._condition, self._writer = gate._condition, gate._writer
        self.owner = owner
        self.paused = False
        self.problem = ""

    @property
    def active(self) -> bool:
        """Whether commands through this lease still reach the robot (unless paused)."""
        return self._gate._lease is self

    def send(self, command: Command) -> bool:
        """Send one command, limited; False if it was dropped."""
        with self._condition:
            problem = command_problem(command)
            if not problem and self._writer.busy and self.active:
                self._writer.wait_until_free(self._gate.command_timeout)
            reason = problem or self._reason_to_drop()
            if reason:
                dropped = [] if problem else command_data(command)
                self._emit(EventKind.COMMAND_DROPPED, command=dropped, reason=reason)
                begun = self._writer.begin_stop() if problem and self.active else None
            else:
                begun = self._writer.begin(self._limited(command))
        delivered = self._writer.deliver(begun) and not reason
        self.problem = "" if delivered else reason or self._writer.problem
        return delivered

    def stop(self) -> None:
        """Send zero velocity now, keeping the lease."""
        with self._condition:
            if not self.active or self._writer.stands:
                return
            self._emit(EventKind.ROBOT_STOPPED, reason="asked by the lease's owner")
            stop = self._writer.begin_stop()
        self._writer.deliver(stop)

    def pause(self) -> None:
        """Stop the robot and drop commands until ``resume``; idempotent."""
        with self._condition:
            if not self.active or self.paused:
                return
            self.paused = True
            self._emit(EventKind.ROBOT_STOPPED, reason="paused")
            stop = self._writer.begin_stop()
        self._writer.deliver(stop)

    def resume(self) -> None:
        """Let commands pass again; idempotent."""
        self.paused = False

    def release(self, stop: bool = True, reason: str = "released") -> None:
        """Give the right back; sends zero unless ``stop`` is False (the watchdog then does, a little later)."""
        with self._condition:
            if not self.active:
                return
            self._gate._end_lease(reason)
            zero = self._writer.begin_stop() if stop else None
        self._writer.deliver(zero)

    def ask_stop(self, reason: str) -> None:
        """Have the watchdog send zero at once, keeping the lease; for other threads than the owner's, never waits."""
        with self._condition:
            if self.active and not self._writer.stands:
                self._gate._wake_watchdog(reason)

    def revoke(self, reason: str) -> None:
        """Take the right away from its owner and have the watchdog send zero at once; never waits."""
        self._gate.revoke(reason, self)

    def _reason_to_drop(self) -> str:
        if not self.active:
            return "the lease is over"
        if self.paused:
            return "the lease is paused"
        return "the robot's send_command() has not returned from an earlier command" if self._writer.busy else ""

    def _limited(self, command: Command) -> Command:
        limited = self._gate.limits.apply(command)
        if limited is not command:
            self._emit(EventKind.COMMAND_CLAMPED, requested=command_data(command), sent=command_data(limited))
        return limited

    def _emit(self, kind: EventKind, **data: object) -> None:
        self._gate._events.emit(kind, self.owner, **data)


class VelocityGate:
    """Guards one robot. Close it and the robot stands for good."""

    def __init__(
        self, robot: Robot, clock: Clock, events: EventBus, limits: VelocityLimits, command_timeout: float
    ) -> None:
        self._clock, self._events = clock, events
        self.limits = limits
        self._command_timeout = command_timeout
        self._condition = clock.condition()
        self._writer = CommandWriter(robot, clock, events, self._condition)
        self._lease: Lease | None = None
        self._stop_asked = ""  # the reason
        self._tried_at = -math.inf
        self._closed, self._closing_tries = False, CLOSING_TRIES
        self._spawn_watchdog()

    @property
    def holder(self) -> str:
        """Owner of the present lease; empty without one."""
        lease = self._lease
        return lease.owner if lease else ""

    @property
    def closed(self) -> bool:
        """Whether the robot stands for good."""
        return self._closed

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
        """Hand out the lease, or None while there is one or the gate is closed."""
        with self._condition:
            if self._lease is not None or self._closed:
                return None
            self._lease = Lease(self, owner)
            self._events.emit(EventKind.LEASE_GRANTED, "velocity_gate", holder=owner)
            return self._lease

    def ask_stop(self, reason: str) -> None:
        """Have the watchdog send zero at once, whoever has the lease and keeps it; never waits."""
        with self._condition:
            if not self._writer.stands:
                self._wake_watchdog(reason)

    def revoke(self, reason: str, lease: Lease | None = None) -> None:
        """End this lease, or whatever lease there is, and have the watchdog send zero at once; never waits."""
        with self._condition:
            if self._lease is not None and lease in (None, self._lease):
                self._end_lease(reason)
                self._wake_watchdog(reason)

    def close(self, reason: str = "server shut down") -> None:
        """Stop the robot for good: revoke the lease, refuse new ones, end the watchdog. Idempotent.

        Where another call of the driver is running, zero follows it; that is waited for, at most ``command_timeout``.
        """
        with self._condition:
            if self._closed:
                return
            self._closed = True
            owner, self._lease = self.holder, None
            self._events.emit(EventKind.GATE_CLOSED, "velocity_gate", holder=owner, reason=reason)
            stop = self._writer.begin_stop()
            self._condition.notify_all()
            if stop is None:
                self._writer.wait_until_free(self._command_timeout)
        self._writer.deliver(stop)

    def _end_lease(self, reason: str) -> None:
        holder, self._lease = self.holder, None
        self._events.emit(EventKind.LEASE_REVOKED, "velocity_gate", holder=holder, reason=reason)

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
        except ThreadDetached:  # the driver kept the processor busy: another thread has to watch
            self._spawn_watchdog()

    def _wait_for_reason(self) -> str:
        """Wait until the robot must be stopped; returns why, or nothing once the gate is closed and all is done."""
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
            if remaining > TIME_RESOLUTION:
                self._condition.wait(remaining)
                continue
            self._closing_tries -= self._closed
            return self._writer.silence(self._command_timeout)
