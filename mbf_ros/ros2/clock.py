"""Our clock on ROS time: the calendar of the computer, or the simulated time of the topic ``/clock``.

Our time counts from the start of the node and never runs backwards. ROS time may jump: a simulation starts over, a
recording is played again, a computer sets its calendar. Then ``epoch``, the ROS time at which our clock shows 0,
moves along, and those who listen to ``on_jump`` forget what was stamped before.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from mbf_abstract.time.clock import Condition, WallClock

JUMP = 0.5
"""Difference [s] of the calendar to our clock from which on it counts as set, not as corrected."""
CORRECTION = 0.005
"""Difference [s] up to which the epoch stays, so that equal ROS times are equal for us."""


class RosClock(WallClock):
    """Real time, with an epoch that follows the calendar.

    Parameters
    ----------
    ros_time : float
        ROS time now [s since 1970].

    Attributes
    ----------
    epoch : float
        ROS time [s] at which this clock shows 0.
    on_jump : list of callables
        Called with the size of a jump [s], negative for one back, after ``epoch`` has changed.
    """

    def __init__(self, ros_time: float) -> None:
        super().__init__()
        self.epoch = ros_time - self.now()
        self.on_jump: list[Callable[[float], None]] = []

    def follow(self, ros_time: float) -> None:
        """Take the present ROS time [s]; to be called often, on one thread."""
        difference = ros_time - (self.epoch + self.now())
        if abs(difference) > CORRECTION:
            self.epoch += difference
        if abs(difference) > JUMP:
            self._notify_of_jump(difference)

    def stand_in(self, seconds: float, after: float) -> None:
        """Do nothing: real time does not stand still."""

    def _notify_of_jump(self, difference: float) -> None:
        for listener in self.on_jump:
            listener(difference)


class SimulatedRosClock(RosClock):
    """Time that passes as ``follow`` is called with it. Waits end when simulated time has come so far.

    Where ROS time stands still so does ours, unless ``stand_in`` lets it pass.
    """

    def __init__(self, ros_time: float) -> None:
        self._elapsed, self._ros_time = 0.0, ros_time
        self._real_time = WallClock()
        self._moved = 0.0
        self._lock = threading.Lock()
        self._waiting: dict[object, tuple[float, _SimulatedCondition]] = {}
        super().__init__(ros_time)

    def now(self) -> float:
        """Simulated seconds since the clock was made."""
        return self._elapsed

    def sleep(self, seconds: float) -> None:
        """Wait until ``seconds`` of simulated time have passed."""
        self.sleep_until(self.now() + seconds)

    def sleep_until(self, stamp: float) -> None:
        """Wait until ``now() >= stamp``."""
        condition = self.condition()
        with condition:
            while (remaining := stamp - self.now()) > 0.0:
                condition.wait(remaining)

    def condition(self) -> Condition:
        """Make a condition whose timeouts are simulated time."""
        return _SimulatedCondition(self)

    def follow(self, ros_time: float) -> None:
        """Let time pass up to a ROS time [s]; one that lies back is a jump."""
        with self._lock:
            passed, self._ros_time = ros_time - self._ros_time, ros_time
            if passed != 0.0:
                self._moved = self._real_time.now()
            self.epoch += min(passed, 0.0)
            self._elapsed += max(passed, 0.0)
        if passed < 0.0:
            self._notify_of_jump(passed)
        else:
            self._wake_those_due()

    def stand_in(self, seconds: float, after: float) -> None:
        """Let our time alone pass by ``seconds`` where ROS time has stood still for ``after`` [s of real time].

        What has been asked to end then can: a grace runs out, a wait for the next control period ends. The epoch
        moves back, so that what ROS stamps now is not old for us.
        """
        with self._lock:
            if self._real_time.now() - self._moved < after:
                return
            self._elapsed += seconds
            self.epoch -= seconds
        self._wake_those_due()

    def _wake_those_due(self) -> None:
        with self._lock:
            due = {condition for stamp, condition in self._waiting.values() if stamp <= self._elapsed}
        for condition in due:
            with condition:
                condition.notify_all()

    def add_waiter(self, waiter: object, stamp: float, condition: _SimulatedCondition) -> None:
        """Have a condition notified when ``stamp`` has come."""
        with self._lock:
            self._waiting[waiter] = (stamp, condition)

    def remove_waiter(self, waiter: object) -> None:
        """Withdraw ``add_waiter``."""
        with self._lock:
            del self._waiting[waiter]


class _SimulatedCondition(threading.Condition):
    def __init__(self, clock: SimulatedRosClock) -> None:
        super().__init__(threading.Lock())
        self._clock = clock

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for a notification or for simulated time; may also return early, as the waits of others end."""
        if timeout is None:
            return super().wait()
        stamp, waiter = self._clock.now() + timeout, object()
        self._clock.add_waiter(waiter, stamp, self)
        try:
            if self._clock.now() < stamp:  # else time passed before it knew of this waiter
                super().wait()
        finally:
            self._clock.remove_waiter(waiter)
        return self._clock.now() < stamp
