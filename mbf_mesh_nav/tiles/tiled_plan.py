"""What a search on a tiled map returns: a path with its cost, and how far that may be from the least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbf_abstract.outcomes import GetPathOutcome
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.tiles.places import TilePlace
from mbf_mesh_nav.tiles.tile import TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap

NO_POINTS: FloatArray = np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class TiledPlan:
    """What came out.

    Attributes
    ----------
    positions, normals : (n, 3) float64
        Of the path, from start to goal [m]; none without one.
    cost : float
        Length plus collected cost [m], as of ``mesh.dijkstra``; inf without a path.
    least_cost : float
        No path on the map costs less [m]; inf without a path.
    tiles : tuple of (int, int)
        Those that were searched for this path.
    gain : float
        Share by which the last widening of the corridor made the path cheaper; NaN if it was not widened.
    """

    outcome: GetPathOutcome
    message: str
    positions: FloatArray
    normals: FloatArray
    cost: float
    least_cost: float
    tiles: tuple[TileKey, ...] = ()
    gain: float = np.nan

    @property
    def gap(self) -> float:
        """How far above the cheapest path the cost may be at most, as a share; 0 = it is the cheapest."""
        return self.cost / self.least_cost - 1.0 if self.cost > self.least_cost else 0.0


def failed_plan(outcome: GetPathOutcome, message: str, tiles: tuple[TileKey, ...] = ()) -> TiledPlan:
    """A plan without a path."""
    return TiledPlan(outcome, message, NO_POINTS, NO_POINTS, np.inf, np.inf, tiles)


def plan_along(
    tiled: TiledMap,
    chain: IntArray,
    start: TilePlace,
    goal: TilePlace,
    cost: float,
    least_cost: float,
    tiles: tuple[TileKey, ...],
) -> TiledPlan:
    """A plan from a start over vertices (n,) of the pool to a goal; costs in metres."""
    inner, inner_normals = tiled.pool.vertices[chain], tiled.pool.normals[chain].astype(np.float64)
    positions = np.concatenate([start.point[None], inner, goal.point[None]])
    normals = np.concatenate([start.normal[None], inner_normals, goal.normal[None]])
    # A vertex that two tiles share is there twice.
    kept = np.append(True, (positions[1:] != positions[:-1]).any(axis=1))
    return TiledPlan(GetPathOutcome.SUCCESS, "", positions[kept], normals[kept], cost, least_cost, tiles)
