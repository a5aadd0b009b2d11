"""Base classes of all our behaviour tree nodes: ``py_trees`` nodes that know the mission they run in.

The executive binds a tree to a mission with ``setup(mission=...)`` before the first tick, so a tree is built, drawn and
tested without a robot. Leaves derive ``Leaf``; ``Decorator`` and ``Composite`` are for nodes that decide *whether* or
*in which order* their children are ticked.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Generator, Iterator, Sequence
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite as PyTreesComposite
from py_trees.decorators import Decorator as PyTreesDecorator

from mbf_abstract.executives.mission import MissionContext


class MissionNode:
    """The part all nodes share: ``mission``, set by ``setup``."""

    mission: MissionContext
    status: Status

    def setup(self, **kwargs: Any) -> None:
        """Take over ``mission`` from the keyword arguments; raises KeyError without it."""
        self.mission = kwargs["mission"]


class Leaf(MissionNode, Behaviour):  # type: ignore[misc, unused-ignore]
    """A node without children."""


class Decorator(MissionNode, PyTreesDecorator):  # type: ignore[misc, unused-ignore]
    """A node with one child, ticked before ``update`` if ``wants_tick``."""

    def wants_tick(self) -> bool:
        """Whether the child is ticked this time; asked after ``initialise``."""
        return True

    def tick(self) -> Iterator[Behaviour]:
        """Tick the child if it is wanted, then ask ``update`` for the status."""
        if self.status != Status.RUNNING:
            self.initialise()
        if self.wants_tick():
            yield from self.decorated.tick()
        status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self


class Composite(MissionNode, PyTreesComposite):  # type: ignore[misc, unused-ignore]
    """A node with several children; when it ends, all its children are idle.

    Attributes
    ----------
    children_remember : bool
        Children keep what they remember from one entry to the next, until this node itself becomes idle.
    """

    children_remember = False

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, list(children))

    @abstractmethod
    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Tick children with ``tick_child`` and return the status of this node."""

    def tick_child(self, child: Behaviour) -> Generator[Behaviour, None, Status]:
        """Tick one child and return its status; raises RuntimeError where it has none."""
        self.current_child = child
        yield from child.tick()
        if child.status == Status.INVALID:
            raise RuntimeError(f"{child.name!r} returned no status after its tick")
        return child.status

    def tick(self) -> Iterator[Behaviour]:
        """Tick as ``tick_children`` prescribes."""
        if self.status != Status.RUNNING:
            self.initialise()
        status = yield from self.tick_children()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """End this node and, unless they remember, make its children idle."""
        for child in self.children:
            ended = child.status in (Status.SUCCESS, Status.FAILURE)
            kept = ended and self.children_remember and new_status != Status.INVALID
            if child.status != Status.INVALID and not kept:
                child.stop(Status.INVALID)
        super().stop(new_status)


class PickedChild(Composite):
    """Runs the child that ``pick`` names; fails where that is none. What the others remember stays."""

    children_remember = True
    _picked: Behaviour | None = None

    @abstractmethod
    def pick(self) -> Behaviour | None:
        """Name the child that is run until this node ends."""

    def initialise(self) -> None:
        """Pick when entered."""
        self._picked = self.pick()

    def tick_children(self) -> Generator[Behaviour, None, Status]:
        """Tick the picked child."""
        if self._picked is None:
            return Status.FAILURE
        return (yield from self.tick_child(self._picked))
