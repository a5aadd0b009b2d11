"""Composites that recover: ``MemRec``, ``RecoveryNode``, ``RoundRobin``, ``PickBy...``, ``InOrder``.

``MemRec`` alternates a check with the next recovery of a list (the paper's node). ``RecoveryNode`` alternates a task
with one recovery a number of times. ``RoundRobin`` takes another child each time it is entered; ``PickByOutcome`` takes
the child that fits the code of the last failure, ``PickByMotion`` the one that fits how an object in the way moves.
Together: a recovery by code, another one if the same failure returns. The rules of ``RecoveryNode`` and ``RoundRobin``
are those of Nav2's nodes of that name, except that ``py_trees`` knows no "skipped".
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.executives.nodes import Composite, Decorator, PickedChild


class TaskWithRecoveries(Composite):
    """Run a task; while it fails, run the next recovery of a list and the task again, until the list is used up.

    ``MemRec`` and ``RecoveryNode`` differ in what a recovery that fails means.

    Attributes
    ----------
    gives_up : callable
        Asked after each failure of the task whether to fail without a further recovery; an ``Escalation`` sets it.
    """

    recovery_must_succeed = False
    turn = "recovery"
    """What one use of the list is called in the node's message."""

    def __init__(
        self, name: str, task: Behaviour, recoveries: Sequence[Behaviour], turns: int, give_up_on: Collection[int] = ()
    ) -> None:
        super().__init__(name, [task, *recoveries])
        self.turns = turns
        self.give_up_on = frozenset(give_up_on)
        self.gives_up: Callable[[], bool] = lambda: False
        self._used = 0
        self._recovering = False

    def initialise(self) -> None:
        """Begin with the task and a fresh list."""
        self._used = 0
        self._recovering = False

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Go on with the task or the recovery that is running."""
        task, *recoveries = self.children
        while True:
            if self._recovering:
                status = yield from self.tick_child(recoveries[(self._used - 1) % len(recoveries)])
                if status == Status.RUNNING or (status == Status.FAILURE and self.recovery_must_succeed):
                    return status
                self._recovering = False
            status = yield from self.tick_child(task)
            if status != Status.FAILURE or self._used == self.turns or self.gives_up():
                return status
            if self.give_up_on and self.mission.failure_code in self.give_up_on:
                return Status.FAILURE
            self._used += 1
            self._recovering = True
            self.feedback_message = f"{self.turn} {self._used} of {self.turns}"


class MemRec(TaskWithRecoveries):
    """Check; while that fails, run the next recovery of the list and check again, until the list is used up.

    How a recovery ended does not matter: the check decides. The place in the list is remembered until this node ends.

    Parameters
    ----------
    give_up_on : collection of int
        Codes of failed checks after which no recovery is tried.
    """

    def __init__(
        self, name: str, check: Behaviour, recoveries: Sequence[Behaviour], give_up_on: Collection[int] = ()
    ) -> None:
        super().__init__(name, check, recoveries, len(recoveries), give_up_on)


class RecoveryNode(TaskWithRecoveries):
    """Run a task; where it fails, run the recovery and the task again, ``retries`` times at most.

    A recovery that fails ends the node: then there is nothing more to try.
    """

    recovery_must_succeed = True
    turn = "retry"

    def __init__(self, name: str, children: Sequence[Behaviour], retries: int = 1) -> None:
        if len(children) != 2:
            raise ValueError(f"{name!r} needs exactly a task and a recovery, got {len(children)} children")
        if retries < 0:
            raise ValueError(f"retries must not be negative, got {retries}")
        super().__init__(name, children[0], children[1:], retries)


class RoundRobin(Composite):
    """Tick children in turn until one succeeds; the next time begin after that one. Fails when all have failed.

    Parameters
    ----------
    wrap_around : bool
        Whether the first child follows the last one; otherwise a turn ends with the last child.
    """

    def __init__(self, name: str, children: Sequence[Behaviour], wrap_around: bool = True) -> None:
        super().__init__(name, children)
        self.wrap_around = wrap_around
        self._index = 0
        self._failed = 0

    def initialise(self) -> None:
        """Count failures anew; the place in the list stays."""
        self._failed = 0

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Go on with the child whose turn it is."""
        while self._failed < len(self.children):
            status = yield from self.tick_child(self.children[self._index])
            if status == Status.RUNNING:
                return Status.RUNNING
            self._index = (self._index + 1) % len(self.children)
            if status == Status.SUCCESS:
                return Status.SUCCESS
            self._failed += 1
            if self._index == 0 and not self.wrap_around:
                break
        return Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        """Forget whose turn it is when this node becomes idle."""
        if new_status == Status.INVALID:
            self._index = 0


class OutcomeGuard(Decorator):
    """Let the child run only if the mission's last failure has one of these codes; otherwise fail.

    Parameters
    ----------
    opens_on : collection of int, or function of a code
        Codes that open the guard.
    """

    def __init__(self, name: str, child: Behaviour, opens_on: Collection[int] | Callable[[int], bool]) -> None:
        super().__init__(name, child)
        self.accepts = opens_on if callable(opens_on) else frozenset(opens_on).__contains__
        self._open = False

    def initialise(self) -> None:
        """Decide once, when entered."""
        self._open = self.accepts(self.mission.failure_code)

    def wants_tick(self) -> bool:
        """Tick the child of an open guard only."""
        return self._open

    def update(self) -> Status:
        """Return the child's status, or FAILURE for a closed guard."""
        return self.decorated.status if self._open else Status.FAILURE


class PickByOutcome(PickedChild):
    """Run the first guarded child that fits the last failure; fail where none fits. What the others remember stays."""

    def __init__(self, name: str, children: Sequence[OutcomeGuard]) -> None:
        super().__init__(name, children)

    def pick(self) -> Behaviour | None:
        """Look for the first child that accepts the mission's failure."""
        code = self.mission.failure_code
        picked = next((child for child in self.children if child.accepts(code)), None)
        self.feedback_message = f"code {code}: {picked.name if picked else 'nothing fits'}"
        return picked


class InOrder(Composite):
    """All children one after the other, as ``Sequence`` with memory, but children remember from entry to entry."""

    children_remember = True
    _index = 0

    def initialise(self) -> None:
        """Begin with the first child."""
        self._index = 0

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Go on with the child that is running."""
        while self._index < len(self.children):
            status = yield from self.tick_child(self.children[self._index])
            if status != Status.SUCCESS:
                return status
            self._index += 1
        return Status.SUCCESS
