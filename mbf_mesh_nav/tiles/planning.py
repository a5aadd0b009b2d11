"""Plans on a tiled map, from places on it to a path; see ``corridor_search`` for how they are found."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.outcomes import GetPathOutcome
from mbf_mesh_nav.arrays import FlagArray
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.tiles.corridor_search import CorridorSearch
from mbf_mesh_nav.tiles.places import TilePlace
from mbf_mesh_nav.tiles.portals import NOT_CANCELLED
from mbf_mesh_nav.tiles.tiled_map import TiledMap
from mbf_mesh_nav.tiles.tiled_plan import TiledPlan, failed_plan

TOLERANCE = 0.03
"""How far above the cheapest path a plan may be, as a share of its cost."""
SURFACE_DISTANCE = 0.4
"""A start or goal farther [m] from the surface is out of the map."""


def plan_on_tiles(
    tiled: TiledMap,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    surface_distance: float = SURFACE_DISTANCE,
    cancel_flag: FlagArray = NOT_CANCELLED,
) -> TiledPlan:
    """Plan along edges from a start to a goal (3,) [m].

    Parameters
    ----------
    tolerance : float
        Share by which the cost may be above the cheapest.
    surface_distance : float
        How far [m] start and goal may be from the surface.
    cancel_flag : (1,) uint8
        Nonzero ends the search.

    Returns
    -------
    TiledPlan
        OUT_OF_MAP, BLOCKED_START, BLOCKED_GOAL, NO_PATH_FOUND and CANCELED are outcomes like SUCCESS.
    """
    places = []
    for name, position in (("start", start), ("goal", goal)):
        place = place_on_tiles(tiled, name, position, surface_distance)
        if isinstance(place, TiledPlan):
            return place
        places.append(place)
    return plan_between(tiled, *places, tolerance=tolerance, cancel_flag=cancel_flag)


def place_on_tiles(
    tiled: TiledMap, name: str, position: ArrayLike, surface_distance: float = SURFACE_DISTANCE
) -> TilePlace | TiledPlan:
    """The place of a position (3,) [m], or OUT_OF_MAP, BLOCKED_START or (any but the "start") BLOCKED_GOAL."""
    there = np.asarray(position, dtype=np.float64)
    place = tiled.find_place(there, surface_distance)
    if place is None:
        text = f"the {name} {position_text(there)} is not within {surface_distance:g} m of the surface"
        return failed_plan(GetPathOutcome.OUT_OF_MAP, text)
    if place.blocked_by:
        outcome = GetPathOutcome.BLOCKED_START if name == "start" else GetPathOutcome.BLOCKED_GOAL
        return failed_plan(outcome, f"the {name} {position_text(there)} is blocked: {place.blocked_by}")
    return place


def plan_between(
    tiled: TiledMap,
    first: TilePlace,
    last: TilePlace,
    *,
    tolerance: float = TOLERANCE,
    cancel_flag: FlagArray = NOT_CANCELLED,
) -> TiledPlan:
    """Plan along edges between two places, as ``plan_on_tiles``."""
    if first.key == last.key and first.face == last.face:
        cost = first.cost_to(last)
        positions, normals = np.array([first.point, last.point]), np.array([first.normal, last.normal])
        return TiledPlan(GetPathOutcome.SUCCESS, "start and goal lie on one face", positions, normals, cost, cost)
    return CorridorSearch(tiled, first, last, tolerance, cancel_flag).run()
