"""Runs a behaviour tree (or a state machine) for one target after the other: ticks it on the server's clock.

The tree is ticked on the caller's thread, every ``period`` seconds of the server's clock, so a simulated run
repeats bit for bit. ``change_target`` sends it elsewhere, whatever branch is running. However a run ends - the tree is
done, ``cancel`` from another thread, an exception, Ctrl-C - every goal it sent is ended and the robot stands when
``run`` returns.

Example
-------
>>> executive = TreeExecutive(navigation_tree(), navigator)
>>> result = executive.run(Pose.planar(8.0, 3.0))
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.events import EventKind
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.executives.tree_events import TreeReporter
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import TIME_RESOLUTION


@dataclass(frozen=True)
class TreeResult:
    """How a run ended: ``status`` of the tree (INVALID = canceled), a text, and the mission with all results."""

    status: Status
    message: str
    mission: MissionContext

    @property
    def success(self) -> bool:
        """Whether the tree succeeded."""
        return bool(self.status == Status.SUCCESS)


class TreeExecutive:
    """Ticks one tree; runs one target at a time.

    Parameters
    ----------
    tree : Behaviour
        Any ``py_trees`` tree; ours need a mission, which ``run`` gives them.
    period : float
        Time between two ticks [s].

    Attributes
    ----------
    on_tick : list of callables
        Called with the number of each tick (from 1) after it, on the executive's thread; for views and tests.
    """

    def __init__(self, tree: Behaviour, navigator: Navigator, period: float = 0.05) -> None:
        if period <= 0.0:
            raise ValueError(f"period must be positive, got {period}")
        self.tree = tree
        self.period = period
        self.on_tick: list[Callable[[int], None]] = []
        self._navigator = navigator
        self._runtime = navigator.server.runtime
        self._condition = self._runtime.clock.condition()
        self._cancel_reason = ""
        self._new_target: Pose | None = None
        self._runs = False
        self._tip = ""
        self._ticks = 0
        self._reporter = TreeReporter(tree, self._runtime.events)

    def run(self, target: Pose | None = None, path: Path | None = None) -> TreeResult:
        """Tick until the tree has succeeded or failed, or ``cancel`` is called; then no goal of it runs.

        Parameters
        ----------
        target : Pose, optional
            For trees that plan.
        path : Path, optional
            For trees that follow a path they are given.

        Raises
        ------
        RuntimeError
            A node's ``update`` returned no status. What a node raises is raised, too.
        """
        mission = MissionContext(self._navigator, target, path)
        self._cancel_reason = ""
        for node in self.tree.iterate():
            node.setup(mission=mission)
        self._reporter.begin()
        try:
            status = self._tick_until_done(mission)
        finally:
            with self._condition:
                self._runs = False
            self._stop_tree()
            mission.end_goals(self._cancel_reason or "the tree has ended")
        return TreeResult(status, self._message(status, mission), mission)

    def cancel(self, reason: str = "canceled from outside") -> None:
        """End the present run soon; may be called from any thread, never waits."""
        with self._condition:
            self._cancel_reason = reason
            self._condition.notify_all()

    def change_target(self, target: Pose) -> bool:
        """Let the present run go on to another target; may be called from any thread, never waits.

        Before the next tick, whatever branch is running, every node becomes idle, the goals they sent are canceled and
        the mission forgets the old target; then the tree begins anew. The robot stops meanwhile. Of several targets
        between two ticks the last one counts. For trees that plan: one that follows a given path has none then.

        Returns
        -------
        bool
            Whether the run goes there; False where none is running.
        """
        with self._condition:
            if self._runs and not self._cancel_reason:
                self._new_target = target
                return True
            return False

    def _take_new_target(self, mission: MissionContext) -> bool:
        """Begin anew if there is another target; without one a run that is done takes no more of them."""
        with self._condition:
            target, self._new_target = self._new_target, None
            self._runs = target is not None or self.tree.status == Status.RUNNING
        if target is None:
            return False
        self._stop_tree()
        mission.begin(target)
        return True

    def _tick_until_done(self, mission: MissionContext) -> Status:
        clock = self._runtime.clock
        start, self._ticks = clock.now(), 0
        with self._condition:
            self._new_target, self._runs = None, True
        while not self._cancel_reason:
            self.tree.tick_once()
            self._ticks += 1
            if self.tree.status == Status.INVALID:  # py_trees takes it for that
                raise RuntimeError(
                    f"{self.tree.name!r} has no status: a node answered neither SUCCESS, FAILURE nor RUNNING"
                )
            self._report_tip()
            self._reporter.report(self._ticks)
            for listener in self.on_tick:
                listener(self._ticks)
            if not self._take_new_target(mission) and self.tree.status != Status.RUNNING:
                return self.tree.status
            self._wait_until(start + self._ticks * self.period)
        return Status.INVALID

    def _stop_tree(self) -> None:
        """Make every node idle. The log keeps how a tree ended by itself; where it was broken off, it records that."""
        broken_off = self.tree.status == Status.RUNNING
        self.tree.stop(Status.INVALID)
        if broken_off:
            self._reporter.report(self._ticks)

    def _wait_until(self, stamp: float) -> None:
        clock = self._runtime.clock
        with self._condition:
            while not self._cancel_reason and clock.now() < stamp - TIME_RESOLUTION:
                self._condition.wait(stamp - clock.now())

    def _report_tip(self) -> None:
        """Log which node is running, so that a tree can be followed in the event log, live and in a replay."""
        tip = self.tree.tip()
        name = "" if tip is None else tip.name
        if name != self._tip:
            self._runtime.events.emit(EventKind.STATE_CHANGED, "tree", tree=self.tree.name, old=self._tip, new=name)
            self._tip = name

    def _message(self, status: Status, mission: MissionContext) -> str:
        if status == Status.SUCCESS:
            return f"{self.tree.name!r} succeeded"
        if status == Status.INVALID:
            return self._cancel_reason
        if mission.failure is None:
            return f"{self.tree.name!r} failed"
        return f"{mission.failure.outcome_name}: {mission.failure.message}"
