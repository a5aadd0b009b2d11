"""Runs a recovery behaviour: one call, with its own patience, driving through the velocity gate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from mbf_abstract.drive.commands import require_command
from mbf_abstract.drive.velocity_gate import Lease
from mbf_abstract.execution.plugin_answer import PluginFault
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import with_changes
from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest, RecoveryResult
from mbf_abstract.time.clock import TIME_RESOLUTION, Stopwatch


class GatedMotion:
    """How a recovery moves the robot (``plugins.Motion``): takes the lease at the first command."""

    def __init__(self, run: PluginRun[AbstractRecovery]) -> None:
        self._run = run
        self._runtime = run.runtime
        self._lease: Lease | None = None
        self._over = False
        self._condition = self._runtime.clock.condition()
        run.handle.on_wake(self._wake)
        run.handle.cancel_token.on_cancel(self._wake)

    def pose(self) -> Pose:
        """Fresh robot pose in the global frame; raises RobotStateError."""
        return self._runtime.robot.pose()

    def velocity(self) -> Twist:
        """Measured velocity in the base frame; raises RobotStateError."""
        return self._runtime.robot.velocity()

    def send(self, command: Command) -> bool:
        """Send one command; False if another owner drives, the goal is paused or is to end. TypeError if it is none."""
        require_command(command)
        if self._run.handle.paused:
            return False
        with self._condition:
            if self._lease is None and not self._over:
                self._lease = self._runtime.gate.acquire(f"recovery {self._run.plugin.name}")
            lease = self._lease
        return lease is not None and lease.send(command)

    def sleep(self, seconds: float) -> bool:
        """Wait for so many seconds; False as soon as the behaviour is to end. Paused time does not count."""
        watch = Stopwatch(self._runtime.clock)
        token = self._run.handle.cancel_token
        with self._condition:
            while watch.elapsed < seconds - TIME_RESOLUTION and not token.cancelled:
                paused = self._run.handle.paused
                watch.pause() if paused else watch.resume()
                self._condition.wait(None if paused else seconds - watch.elapsed)
        return not token.cancelled

    def close(self, reason: str) -> None:
        """Stop the robot if this behaviour moved it, and refuse further commands."""
        if (lease := self._end()) is not None:
            lease.release(reason=reason)

    def revoke(self, reason: str) -> None:
        """Do the same from another thread than the behaviour's, which hangs; never waits."""
        if (lease := self._end()) is not None:
            lease.revoke(reason)

    def _end(self) -> Lease | None:
        with self._condition:
            self._over = True
            return self._lease

    def _wake(self) -> None:
        if self._run.handle.paused and self._lease is not None:
            self._lease.ask_stop("paused")
        with self._condition:
            self._condition.notify_all()


class RecoveryExecution:
    """One recovery goal's call of its behaviour, with parameters of the goal in the place of its own."""

    def __init__(self, run: PluginRun[AbstractRecovery], parameters: Mapping[str, Any]) -> None:
        self._run, self._parameters = run, parameters
        self.motion = GatedMotion(run)

    def execute(self) -> RecoveryResult:
        """Run the behaviour; its own outcome, or CANCELED, PAT_EXCEEDED, INTERNAL_ERROR."""
        if not self._run.acquire_plugin() or self._run.canceled:
            return self._ended_early()
        try:
            result = self._call()
        except PluginFault as fault:
            return RecoveryResult(RecoveryOutcome.INTERNAL_ERROR, str(fault))
        finally:
            self._run.call_beside("the robot's send_command()", lambda: self.motion.close("recovery over"))
        if self._run.canceled or (self._run.patience_exceeded and not result.success):
            return self._ended_early(result.message)
        return result

    def _ended_early(self, message: str = "") -> RecoveryResult:
        name, tail = self._run.plugin.name, f"; last message: {message}" if message else ""
        if self._run.canceled:
            return RecoveryResult(RecoveryOutcome.CANCELED, f"recovery {name!r} canceled{tail}")
        text = self._run.waited or f"recovery {name!r} took longer than {self._run.patience:g} s{tail}"
        return RecoveryResult(RecoveryOutcome.PAT_EXCEEDED, text)

    def _call(self) -> RecoveryResult:
        behavior = self._run.plugin.instance
        request = RecoveryRequest(self.motion, self._run.handle.cancel_token)

        def run() -> RecoveryResult:
            with self._own_parameters(behavior):
                return behavior.run_behavior(request)

        return self._run.ask_reported("run_behavior", run, RecoveryResult)

    @contextmanager
    def _own_parameters(self, behavior: AbstractRecovery) -> Iterator[None]:
        """Let the behaviour, which nobody else uses meanwhile, have the goal's parameters."""
        if not self._parameters:
            yield
            return
        usual, behavior.parameters = behavior.parameters, with_changes(behavior.parameters, self._parameters)
        try:
            behavior.parameters_changed()
            yield
        finally:
            behavior.parameters = usual
            behavior.parameters_changed()
