"""A WebSocket that is opened again whenever it is lost, and never sends what was meant for an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from functools import partial

from mbf_abstract.access.outbox import MAX_ANSWERS, WaitingFrames
from mbf_abstract.event_values import error_text
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock, ClockThread
from mbf_ros.rosbridge_robot.dialing import LinkError, Socket


class NotConnectedError(RuntimeError):
    """There is no connection; the text says why."""


class Backoff:
    """Times to wait before each try: the first, then twice as long from try to try, up to the longest."""

    def __init__(self, first: float, longest: float) -> None:
        self._first, self._longest, self._next = first, longest, first

    def next(self) -> float:
        """Return the time to wait now [s]."""
        delay, self._next = self._next, min(2.0 * self._next, self._longest)
        return delay

    def lasted(self, seconds: float) -> None:
        """Begin with the first again where a connection has lasted for longer than the longest time to wait."""
        if seconds > self._longest:
            self._next = self._first


class Connection:
    """One connection to a robot.

    Parameters
    ----------
    name : str
        For threads and texts; also an attribute.
    dial : callable
        Opens a WebSocket; raises LinkError.
    clock : Clock
        Real time, on which is waited.
    greeting : callable
        Frames to be sent first on each new WebSocket.
    on_frame : callable
        Takes what comes, on the connection's own thread; must not raise.
    on_change : callable
        Called on that thread with the reason when the connection is lost, or cannot be opened again for another reason,
        and with an empty text when it is open again.
    on_fault : callable
        Takes what ``greeting`` or ``on_change`` has raised; the connection is then opened anew. Must not raise.

    Attributes
    ----------
    problem : str
        Why there is no connection; empty if there is one.
    """

    def __init__(
        self,
        name: str,
        dial: Callable[[], Socket],
        clock: Clock,
        backoff: Backoff,
        greeting: Callable[[], Iterable[str]],
        on_frame: Callable[[str | bytes], None],
        on_change: Callable[[str], None],
        on_fault: Callable[[Exception], None],
    ) -> None:
        self.problem = "not connected yet"
        self.name, self._dial, self._clock, self._backoff = name, dial, clock, backoff
        self._greeting, self._on_frame, self._on_change, self._on_fault = greeting, on_frame, on_change, on_fault
        self._condition = clock.condition()
        self._waiting = WaitingFrames()
        self._socket: Socket | None = None
        self._sending: Socket | None = None
        self._closed = False
        self._thread: ClockThread | None = None

    def open(self) -> None:
        """Connect for the first time; raises LinkError where that fails, and what the greeting raises."""
        opened = self._dial()
        try:
            self._begin(opened)
        except Exception:
            opened.close()
            raise
        self._thread = self._clock.spawn(partial(self._run, opened), f"rosbridge {self.name}")

    def answer(self, frame: str) -> None:
        """Send a frame that must not be lost while the connection lasts; raises NotConnectedError. Never waits."""
        with self._condition:
            self._check()
            self._waiting.answer(frame)
            overflowed = self._waiting.overflowed
            self._condition.notify_all()
        if overflowed:
            problem = f"the robot reads too slowly: {MAX_ANSWERS} frames wait"
            self._clock.spawn(partial(self._end_socket, problem), f"rosbridge {self.name} end")

    def newest(self, kind: Hashable, frame: str) -> None:
        """Send a frame that replaces one of its kind that still waits; raises NotConnectedError. Never waits."""
        with self._condition:
            self._check()
            self._waiting.newest(kind, frame)
            self._condition.notify_all()

    def wait_until_sent(self, seconds: float) -> bool:
        """Wait until nothing waits to be sent, for at most ``seconds``; returns whether that is so."""
        deadline = self._clock.now() + seconds
        with self._condition:
            while not self.problem and (self._sending is not None or not self._waiting.is_empty):
                remaining = deadline - self._clock.now()
                if remaining <= 0.0:
                    return False
                self._condition.wait(remaining)
            return not self.problem

    def close(self) -> None:
        """End the connection, and do not open it again; idempotent."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        self._end_socket("closed")
        if self._thread is not None:
            self._thread.join(5.0)

    # -------------------------------------------------------------------------------------------------------
    def _check(self) -> None:
        if self.problem:
            raise NotConnectedError(f"no connection for {self.name}: {self.problem}")

    def _begin(self, opened: Socket) -> bool:
        """Use a new WebSocket: nothing that waited before is sent on it; False where the connection was closed."""
        with self._condition:
            if self._closed:
                return False
            self._waiting = WaitingFrames()
            for frame in self._greeting():
                self._waiting.answer(frame)
            self._socket, self.problem = opened, ""
        self._clock.spawn(partial(self._write, opened), f"rosbridge {self.name} writer")
        return True

    def _end_socket(self, problem: str) -> None:
        """Use the WebSocket no more, and close it."""
        with self._condition:
            opened, self._socket = self._socket, None
            self.problem = problem
            self._waiting = WaitingFrames()
            self._condition.notify_all()
        if opened is not None:
            opened.close()

    def _run(self, opened: Socket) -> None:
        """Read until the connection is lost, then open it again, until it is closed."""
        current: Socket | None = opened
        while current is not None:
            began = self._clock.now()
            reason = self._read(current)
            self._end_socket(self.problem or reason)
            self._backoff.lasted(self._clock.now() - began)
            if not self._closed:
                self._report(self.problem)
            current = self._open_again()

    def _read(self, opened: Socket) -> str:
        """Take frames until the connection ends; returns why it did."""
        try:
            while True:
                self._on_frame(opened.recv())
        except Exception as error:  # ConnectionClosed, or what the operating system says
            return f"the connection was lost ({error_text(error) or type(error).__name__})"

    def _open_again(self) -> Socket | None:
        """Try until it succeeds; None where the connection was closed meanwhile."""
        while not self._pause(self._backoff.next()):
            try:
                opened = self._dial()
            except LinkError as error:
                if str(error) != self.problem:
                    self.problem = str(error)
                    self._report(self.problem)
                continue
            if self._begin_again(opened):
                return opened
        return None

    def _begin_again(self, opened: Socket) -> bool:
        """Use a new WebSocket; where it cannot be used, close it and return False."""
        try:
            begun = self._begin(opened)
        except Exception as error:
            self._on_fault(error)
            begun = False
        if begun and self._report(""):
            return True
        self._end_socket("closed" if self._closed else "a fault on our side")
        opened.close()
        return False

    def _report(self, problem: str) -> bool:
        """Call ``on_change``; returns whether it did not raise."""
        try:
            self._on_change(problem)
        except Exception as error:
            self._on_fault(error)
            return False
        return True

    def _pause(self, seconds: float) -> bool:
        """Wait; returns whether the connection was closed meanwhile."""
        until = self._clock.now() + seconds
        with self._condition:
            while not self._closed and (remaining := until - self._clock.now()) > TIME_RESOLUTION:
                self._condition.wait(remaining)
            return self._closed

    def _write(self, opened: Socket) -> None:
        """Send what waits, on a thread of its own, for as long as this WebSocket is used."""
        while True:
            with self._condition:
                while self._socket is opened and self._waiting.is_empty:
                    self._condition.wait()
                if self._socket is not opened:
                    return
                frame = self._waiting.pop()
                self._sending = opened
            try:
                opened.send(frame)
            except Exception:  # the thread that reads learns of it, too
                return
            finally:
                with self._condition:
                    if self._sending is opened:
                        self._sending = None
                    self._condition.notify_all()
