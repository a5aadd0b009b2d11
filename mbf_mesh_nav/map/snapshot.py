"""The state of a mesh map at one version, and how the next one is made at the price of what changed.

A snapshot never changes, so the next one needs arrays of its own. On a large map copying them costs more than a local
change does; so the arrays of the snapshot before the last one are brought up to date instead, if nothing refers to
them any more.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.layers.edge_weights import show_changes
from mbf_mesh_nav.kernels.search.forbidden_surface import LETHAL_RANK
from mbf_mesh_nav.map.layer import CostArray, LethalArray
from mbf_mesh_nav.map.layer_graph import union_of
from mbf_mesh_nav.mesh.topology import MeshTopology

REMEMBERED_CHANGES = 100
"""Number of changes of the default layer a planner may have missed and still repair its last result."""


@dataclass(frozen=True, eq=False)
class MeshSnapshot:
    """The state of the map at one version, never changed afterwards.

    Attributes
    ----------
    version : int
        Grows by one with every change of a cost, a flag or a weight.
    costs : (V,) float32
        Costs of the default layer; may be +inf.
    lethal : (V,) bool
        Vertices no plan may touch.
    edge_weights : (2E,) float32
        Aligned with ``MeshMap.neighbours``: length plus collected cost, +inf at lethal vertices.
    edge_cost_factor : float
        How much a cost of 1 lengthens an edge, in lengths.
    """

    version: int
    costs: CostArray
    lethal: LethalArray
    edge_weights: CostArray
    edge_cost_factor: float

    def __post_init__(self) -> None:
        for array in (self.costs, self.lethal, self.edge_weights):
            array.flags.writeable = False

    @property
    def untouchable(self) -> LethalArray:
        """Vertices (V,) that no robot may touch, whatever the cost limit: lethal, or of infinite cost."""
        return np.asarray(self.lethal | np.isposinf(self.costs))

    def blocked(self, cost_limit: float) -> LethalArray:
        """Vertices (V,) a plan with this limit does not touch: lethal, or of a cost that reaches it or is NaN."""
        blocked = self.costs < cost_limit
        np.logical_not(blocked, out=blocked)
        return np.logical_or(blocked, self.lethal, out=blocked)

    def traversability_rank(self, cost_limit: float, vertices: IntArray | None = None) -> CostArray:
        """How forbidden vertices are, all or the given (k,): 0 where free, 1 to 2 by cost, LETHAL_RANK if lethal.

        What is free is as in ``blocked``; infinite cost is lethal. Used by ``kernels.search.forbidden_surface``.
        """
        costs, lethal = (self.costs, self.lethal) if vertices is None else (self.costs[vertices], self.lethal[vertices])
        beyond = np.nan_to_num(costs - np.float32(min(cost_limit, 1e6)), nan=0.0, posinf=1.0)
        by_cost = np.where(costs < cost_limit, 0.0, 1.0 + np.clip(beyond, 0.0, 1.0))
        return np.where(lethal | np.isposinf(costs), LETHAL_RANK, by_cost).astype(np.float32)


class _Lent:
    """Memory as one snapshot shows it; numpy keeps this object alive for every view that is made of it."""

    def __init__(self, memory: NDArray[np.uint8]) -> None:
        self.__array_interface__ = memory.__array_interface__
        self._owner = memory


class _Arrays:
    """Arrays that are shown by one snapshot after the other, in one piece of memory, which is lent as a whole."""

    def __init__(self, memory: NDArray[np.uint8], vertex_count: int) -> None:
        self._memory, self._vertex_count = memory, vertex_count
        self.arrays = self._parts(memory)
        self._lent: Callable[[], _Lent | None] = lambda: None

    @classmethod
    def of(cls, costs: CostArray, lethal: LethalArray, edge_weights: CostArray) -> _Arrays:
        """Copies of costs (V,), lethal flags (V,) and weights of edges (2E,)."""
        parts = costs, edge_weights, lethal
        return cls(np.concatenate([part.view(np.uint8) for part in parts]), len(costs))

    def copy(self) -> _Arrays:
        return _Arrays(self._memory.copy(), self._vertex_count)

    def is_held(self) -> bool:
        """Whether anything still refers to the last snapshot of these arrays, or any part of it."""
        return self._lent() is not None

    def show(self, version: int, edge_cost_factor: float) -> MeshSnapshot:
        """Make the snapshot of what the arrays are now."""
        lent = _Lent(self._memory)
        self._lent = weakref.ref(lent)
        return MeshSnapshot(version, *self._parts(np.asarray(lent)), edge_cost_factor)

    def _parts(self, memory: NDArray[np.uint8]) -> tuple[CostArray, LethalArray, CostArray]:
        numbers = memory[: -self._vertex_count].view(np.float32)  # first, where they are aligned
        flags = memory[-self._vertex_count :].view(np.bool_)
        return numbers[: self._vertex_count], flags, numbers[self._vertex_count :]


class SnapshotSeries:
    """Makes one snapshot of a mesh after the other; the caller takes care that only one thread does."""

    def __init__(self, topology: MeshTopology) -> None:
        self._topology = topology
        self._version = -1
        self._current: _Arrays
        self._spare: _Arrays | None = None
        self._missed: IntArray  # vertices that changed since the spare arrays were current
        self._changes: dict[int, IntArray] = {}  # version -> vertices that differ from the version before
        self._closed = np.zeros(topology.vertex_count, dtype=np.bool_)  # vertices in places to avoid
        self._any_closed = False

    def begin(self, costs: CostArray, lethal: LethalArray, edge_cost_factor: float) -> MeshSnapshot:
        """Make a snapshot that has nothing to do with the one before; costs (V,), lethal (V,), see ``MeshSnapshot``."""
        self._edge_cost_factor = edge_cost_factor
        weights = np.zeros(len(self._topology.neighbours), np.float32)
        self._current, self._spare = _Arrays.of(costs, lethal, weights), None
        self._changes.clear()
        return self._published(costs, lethal, np.arange(len(costs), dtype=np.int32))

    def follow(self, costs: CostArray, lethal: LethalArray, changed: IntArray) -> MeshSnapshot:
        """Make the snapshot that differs from the last one at the ``changed`` vertices (k,) only."""
        last, arrays = self._current, self._spare
        if arrays is None or arrays.is_held():
            arrays, outdated = last.copy(), changed
        else:
            outdated = np.concatenate([self._missed, changed])
        self._current, self._spare, self._missed = arrays, last, changed
        snapshot = self._published(costs, lethal, outdated)
        self._changes[snapshot.version] = changed
        self._changes.pop(snapshot.version - REMEMBERED_CHANGES, None)
        return snapshot

    def changes_between(self, old_version: int, new_version: int) -> IntArray | None:
        """Vertices (k,) int32 that ``follow`` was given between two versions; None if some are not remembered."""
        steps = [self._changes.get(version) for version in range(old_version + 1, new_version + 1)]
        known = [changed for changed in steps if changed is not None]
        return union_of(known) if len(known) == len(steps) else None

    def close(self, closed: LethalArray) -> IntArray:
        """Make the vertices of a mask (V,) lethal in the snapshots to come; return those that were not, or no more."""
        changed = np.flatnonzero(closed != self._closed).astype(np.int32)
        self._closed, self._any_closed = closed, bool(closed.any())
        return changed

    def _published(self, costs: CostArray, lethal: LethalArray, outdated: IntArray) -> MeshSnapshot:
        """Bring the current arrays up to date at the ``outdated`` vertices and show them."""
        if self._any_closed:
            lethal = lethal | self._closed
            lethal.flags.writeable = False  # as those of a layer: kernels know one type
        mesh, now = self._topology, self._current
        graph = (mesh.neighbour_offsets, mesh.neighbours, mesh.neighbour_lengths)
        factor = float(self._edge_cost_factor)
        show_changes(*graph, costs, lethal, factor, outdated, *now.arrays)
        self._version += 1
        return now.show(self._version, factor)
