"""When a child is ticked: at a rate, by distance, by speed, after a delay, up to a limit, beside the others.

``py_trees`` has a ``Timeout`` too, but it reads the wall clock; these nodes read the mission's clock, so a
simulated run repeats. ``Retry``, ``Repeat`` and ``OneShot`` of ``py_trees`` need no clock and are used as they are.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Generator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.executives.nodes import Composite, Decorator
from mbf_abstract.geometry import Pose
from mbf_abstract.time.clock import TIME_RESOLUTION, Stopwatch


class Paced(Decorator):
    """Start the child at the first tick, then whenever ``is_due``; RUNNING while it waits for its next turn."""

    _started = False
    _ticked = False

    @abstractmethod
    def is_due(self) -> bool:
        """Whether the child's next turn has come."""

    @abstractmethod
    def begin_turn(self) -> None:
        """Note that the child starts now."""

    def wants_tick(self) -> bool:
        """Tick a child that is running or whose turn has come."""
        self._ticked = self.decorated.status == Status.RUNNING
        if not self._ticked and (not self._started or self.is_due()):
            self.begin_turn()
            self._started = self._ticked = True
        return self._ticked

    def update(self) -> Status:
        """Return the child's status on its turn."""
        return self.decorated.status if self._ticked else Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """Start at once again after having been idle."""
        if new_status == Status.INVALID:
            self._started = False


class EverySeconds(Paced):
    """Start the child every ``period`` seconds."""

    def __init__(self, name: str, child: Behaviour, period: float) -> None:
        super().__init__(name, child)
        self.period = period
        self._last = 0.0

    def is_due(self) -> bool:
        """Whether the period has passed."""
        return self.mission.clock.now() - self._last >= self.period - TIME_RESOLUTION

    def begin_turn(self) -> None:
        """Note the time."""
        self._last = self.mission.clock.now()


class EveryDistance(Paced):
    """Start the child every ``distance`` metres of straight displacement."""

    def __init__(self, name: str, child: Behaviour, distance: float) -> None:
        super().__init__(name, child)
        self.distance = distance
        self._last: Pose | None = None

    def is_due(self) -> bool:
        """Whether the robot is far enough from where the child last started."""
        assert self._last is not None
        return self.mission.robot_pose().distance_to(self._last) >= self.distance

    def begin_turn(self) -> None:
        """Note the place."""
        self._last = self.mission.robot_pose()


class BySpeed(EverySeconds):
    """Start the child more often the faster the robot is; the speed is read at each start.

    Parameters
    ----------
    min_rate, max_rate : float
        Starts per second [Hz] at rest and at ``max_speed``.
    max_speed : float
        Speed [m/s] of the highest rate.
    """

    def __init__(self, name: str, child: Behaviour, min_rate: float, max_rate: float, max_speed: float) -> None:
        super().__init__(name, child, 1.0 / max_rate)
        self.min_rate = min_rate
        self.max_rate = max_rate
        self.max_speed = max_speed

    def begin_turn(self) -> None:
        """Note the time; from the second turn on the speed sets the period."""
        if self._started:
            speed = self.mission.navigator.server.runtime.robot.velocity().speed
            share = min(speed / self.max_speed, 1.0)
            self.period = 1.0 / (self.min_rate + share * (self.max_rate - self.min_rate))
        else:
            self.period = 1.0 / self.max_rate
        super().begin_turn()


class Timed(Decorator):
    """A node with one child and a number of seconds, which count from when it is entered."""

    def __init__(self, name: str, child: Behaviour, seconds: float) -> None:
        super().__init__(name, child)
        self.seconds = seconds

    def initialise(self) -> None:
        """Start the time."""
        self._watch = Stopwatch(self.mission.clock)


class Delay(Timed):
    """Wait ``seconds`` before the child is ticked for the first time."""

    def wants_tick(self) -> bool:
        """Tick once the wait is over."""
        return self._watch.elapsed >= self.seconds - TIME_RESOLUTION

    def update(self) -> Status:
        """Return RUNNING during the wait, then the child's status."""
        return self.decorated.status if self.wants_tick() else Status.RUNNING


class TimeLimit(Timed):
    """Fail and make the child idle if it has not ended within ``seconds``."""

    def update(self) -> Status:
        """Return the child's status while there is time."""
        if self.decorated.status == Status.RUNNING and self._watch.elapsed >= self.seconds - TIME_RESOLUTION:
            self.feedback_message = f"not done within {self.seconds:g} s"
            return Status.FAILURE
        return self.decorated.status


class InBackground(Decorator):
    """RUNNING whatever the child does; for a second planner beside a driving robot. A child that ends starts again.

    Fails once there is a new failure of the mission: the child may have found that to drive on is of no use.
    """

    def initialise(self) -> None:
        """Note the last failure."""
        self._known = self.mission.failure

    def update(self) -> Status:
        """Go on."""
        self.feedback_message = self.decorated.feedback_message
        return Status.RUNNING if self.mission.failure is self._known else Status.FAILURE


class PipelineSequence(Composite):
    """A sequence whose earlier children are ticked again and again while a later one runs.

    Fails when any child fails, succeeds when the last one succeeds; the rules of Nav2's node of that name.
    """

    _reached = 0

    def initialise(self) -> None:
        """Begin at the first child."""
        self._reached = 0

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Tick everything up to the furthest child reached."""
        for index, child in enumerate(self.children):
            status = yield from self.tick_child(child)
            if status == Status.FAILURE:
                return Status.FAILURE
            if status == Status.RUNNING and index >= self._reached:
                self._reached = index
                return Status.RUNNING
        return self.children[-1].status
