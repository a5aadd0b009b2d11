"""Which vertices a planner may not touch, brought up to date from plan to plan at the price of what changed.

When to use: by planners that plan again and again on a changing map. When not: for a single question;
``MeshSnapshot.blocked`` answers that, in several passes over the whole map.
"""

from __future__ import annotations

from mbf_mesh_nav.map.layer import LethalArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot


class BlockedVertices:
    """The mask of one planner, remembered; threads may share it, for a mask that was given out is never changed."""

    def __init__(self, mesh_map: MeshMap) -> None:
        self._mesh_map = mesh_map
        self._last: tuple[int, float, LethalArray] | None = None

    def at(self, snapshot: MeshSnapshot, cost_limit: float) -> LethalArray:
        """Return ``snapshot.blocked(cost_limit)`` (V,) bool."""
        last, changed = self._last, None
        if last is not None and last[1] == cost_limit:
            changed = self._mesh_map.changes_between(last[0], snapshot.version)
        if last is None or changed is None:
            blocked = snapshot.blocked(cost_limit)
        else:
            blocked = last[2].copy()
            blocked[changed] = ~(snapshot.costs[changed] < cost_limit) | snapshot.lethal[changed]
        self._last = snapshot.version, cost_limit, blocked
        return blocked
