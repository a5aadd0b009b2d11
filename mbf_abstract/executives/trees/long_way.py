"""A long detour around somebody who moved as it was planned: ``IsLongWay`` and ``ShorterPath``, beside a drive.

When to use: where a plan takes those who move to stay where they are, and where they will be soon. Somebody in an aisle
blocks it, and a plan that is made just then leads around the whole block. Once they have gone the short way is free
again. When not: for who stands (``detours.py``), or for a path that is blocked later on.
"""

from __future__ import annotations

from collections.abc import Iterable

from py_trees.common import Status

from mbf_abstract.executives.detours import SHORT_DETOUR, UpdatePath
from mbf_abstract.executives.nodes import Leaf
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject

LONG = 2.0
"""A path of more than so many times the straight distance, and ``SHORT_DETOUR``, may be a long detour."""
MOST = 3
"""So often a shorter path is asked for on the way to one target."""


class IsLongWay(Leaf):
    """Succeed where the path is a long way, and all have gone who moved when it was planned, or asked for again."""

    def __init__(self, name: str = "long detour around somebody who has gone?") -> None:
        super().__init__(name)
        self._target: Pose | None = None
        self._plan: GetPathResult | None = None
        self._moved: frozenset[int] = frozenset()  # numbers of those who moved then
        self._asked = 0

    def update(self) -> Status:
        """Compare who is known now with who moved then."""
        if self._target is not self.mission.target:
            self._target, self._asked = self.mission.target, 0
        if self._plan is not self.mission.plan:
            self._plan, self._moved = self.mission.plan, _moving(self._known()) if self._is_long() else frozenset()
        if not self._moved or self._asked >= MOST:
            return Status.FAILURE
        known = self._known()
        if not self._moved.isdisjoint(each.number for each in known):
            return Status.FAILURE
        self._moved, self._asked = _moving(known), self._asked + 1
        return Status.SUCCESS

    def _known(self) -> tuple[TrackedObject, ...]:
        return self.mission.navigator.server.queries.tracked_objects()

    def _is_long(self) -> bool:
        target, path = self.mission.target, self.mission.path
        if target is None or path is None or target.frame_id != path.frame_id:
            return False
        return path.length > LONG * path[0].distance_to(target) + SHORT_DETOUR


def _moving(known: Iterable[TrackedObject]) -> frozenset[int]:
    return frozenset(each.number for each in known if each.motion is Motion.MOVING)


class ShorterPath(UpdatePath):
    """Plan once; only a path that is shorter by more than ``SHORT_DETOUR`` is taken."""

    def is_too_long(self, length: float, present: float) -> bool:
        """Turning back for a few metres less is not worth it."""
        return length > present - SHORT_DETOUR
