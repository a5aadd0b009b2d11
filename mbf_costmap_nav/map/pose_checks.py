"""The four questions a client may ask a costmap without planning: cost of a point, a pose, a path; nearest valid pose.

Semantics are those of MBF's costmap services (check_point_cost, check_pose_cost, check_path_cost, find_valid_pose),
with these deviations, each of which avoids a known fault:

- no cell is counted twice (there the outline was), and the safety distance is a true offset of the footprint;
- a search that finds nothing returns no pose (there it returned the one it was asked about).

All functions work on a snapshot, so they hold no lock.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.queries import (
    AS_CONFIGURED,
    CellState,
    PlaceAnswer,
    PlaceCheck,
    PlaceQuery,
    PlaneCheck,
    PoseAnswer,
)
from mbf_costmap_nav.grid.collision import footprint_costs
from mbf_costmap_nav.grid.costmap import INSCRIBED, LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.free_pose import first_fitting_pose, fitting_poses

DEFAULT_ANGLE_INCREMENT = math.radians(5.0)
FIRST_RING = 64
"""Cells around a pose that are looked at first for one that fits."""
STATE_OF_COST = {INSCRIBED: CellState.INSCRIBED, LETHAL: CellState.LETHAL, UNKNOWN: CellState.UNKNOWN}


def check_point(costmap: Costmap, x: float, y: float) -> PlaceAnswer:
    """State and cost of the cell at the point (x, y) [m]."""
    cost = costmap.cost_at(x, y)
    if cost is None:
        return PlaceAnswer(CellState.OUTSIDE, 0.0)
    return PlaceAnswer(STATE_OF_COST.get(cost, CellState.FREE), float(cost))


def pose_check(costmap: Costmap, footprint: Footprint, query: PlaceQuery = AS_CONFIGURED) -> PlaceCheck:
    """Return a function that gives state and summed cost of the footprint at a pose in the costmap's frame.

    Parameters
    ----------
    footprint : Footprint
        Padded or not, as the caller wishes; the query's choices of map and padding are not looked at here. Without
        corners only the cell of the pose counts.
    query : PlaceQuery
        Safety distance and cost multipliers; a multiplier of 0 counts as 1 (MBF).
    """
    outline = footprint.offset(query.safety_dist)
    multipliers = query.lethal_cost_mult or 1.0, query.inscrib_cost_mult or 1.0, query.unknown_cost_mult or 1.0

    def check(pose: Pose) -> PlaceAnswer:
        costs = footprint_costs(costmap, outline, pose.x, pose.y, pose.yaw)
        known = costs.known if costs.state is CellState.UNKNOWN else None
        return PlaceAnswer(costs.state, costs.weighted_sum(*multipliers), known)

    return check


def plane_check(costmap: Costmap, footprint: Footprint, frame: Transform, safety_dist: float) -> PlaneCheck:
    """As ``pose_check``: how the footprint, grown by a distance [m], fits at poses in the plane of ``frame``."""
    vertices = footprint.offset(safety_dist).vertices
    outline = np.array(vertices) if len(vertices) >= 3 else np.zeros((1, 2))
    grid = costmap.origin_x, costmap.origin_y, costmap.resolution
    placed = *grid, outline, frame.translation, frame.rotation
    return lambda poses: np.asarray(fitting_poses(costmap.cells, *placed, poses))


def find_valid_pose(
    costmap: Costmap,
    footprint: Footprint,
    pose: Pose,
    dist_tolerance: float,
    angle_tolerance: float,
    query: PlaceQuery = AS_CONFIGURED,
    angle_increment: float = DEFAULT_ANGLE_INCREMENT,
) -> PoseAnswer:
    """Find the pose nearest to ``pose`` at which the footprint touches nothing lethal or unknown.

    The requested pose comes first, then cell centres by their distance from its cell; at each the requested heading
    comes first, then growing turns to the left and right. If the heading stays, the orientation is returned as given.

    The answer is FREE or INSCRIBED with a pose that fits; UNKNOWN or OUTSIDE with the nearest pose that only touches
    unknown cells or the border; or, without a pose, LETHAL, or OUTSIDE for a pose off the map. Its cost is the highest
    one under the footprint.

    Parameters
    ----------
    dist_tolerance : float
        Largest distance [m] of the position from the requested one; inf = anywhere on the map.
    angle_tolerance : float
        Largest turn [rad] from the requested heading.
    query : PlaceQuery
        Its safety distance; nothing else of it matters here.
    angle_increment : float
        Largest step between two headings [rad].
    """
    turns = _turns(angle_tolerance, angle_increment)
    outline = footprint.offset(query.safety_dist)
    vertices = outline.vertices if len(outline.vertices) >= 3 else np.zeros((1, 2))
    lower_left = np.array([costmap.origin_x, costmap.origin_y])
    nothing_fits = CellState.LETHAL if costmap.contains(pose.x, pose.y) else CellState.OUTSIDE
    second_best = PoseAnswer(nothing_fits, float(LETHAL), None)
    for candidates in _candidates(costmap, pose, dist_tolerance):
        places = (candidates - lower_left) / costmap.resolution
        which, turn, state, cost = first_fitting_pose(
            costmap.cells, vertices / costmap.resolution, places, pose.yaw + turns
        )
        if which < 0:
            continue
        answer = PoseAnswer(CellState(state), float(cost), _turned(pose, candidates[which], float(turns[turn])))
        if answer.state in (CellState.FREE, CellState.INSCRIBED):
            return answer
        second_best = answer if second_best.pose is None else second_best
    return second_best


def _turned(pose: Pose, place: NDArray[np.float64], turn: float) -> Pose:
    """``pose`` moved to ``place`` (2,) [m] and turned by ``turn`` [rad]; without a turn it keeps its orientation."""
    x, y = place.tolist()
    orientation = pose.orientation if turn == 0.0 else Pose.planar(0.0, 0.0, pose.yaw + turn).orientation
    return Pose((x, y, pose.z), orientation, pose.frame_id, pose.stamp)


def _candidates(costmap: Costmap, pose: Pose, dist_tolerance: float) -> Iterator[NDArray[np.float64]]:
    """Positions (n, 2) [m] to try in order: the pose itself if on the map, then cell centres within the tolerance.

    The centres come in rings, each twice as wide as the one before, so that a tolerance of the whole map costs no more
    than what is needed of it.
    """
    itself = np.array([[pose.x, pose.y]]) if costmap.contains(pose.x, pose.y) else np.zeros((0, 2))
    center = costmap.world_to_cell_clamped(pose.x, pose.y)
    # Cells are ranked by the distance from the pose's cell, or off the map from the nearest one, not from the pose.
    span = costmap.width + costmap.height
    last = span if dist_tolerance >= span * costmap.resolution else math.ceil(dist_tolerance / costmap.resolution) + 1
    inner, outer = -1, min(FIRST_RING, last)
    while True:
        cells = cells_by_distance(costmap, center, outer)
        squares = ((cells - center) ** 2).sum(axis=1)
        # The corners of the last square may be nearer to the pose than the tolerance, as it is off its cell's centre.
        ring = cells[(squares > inner * abs(inner)) & ((squares <= outer**2) | (outer == last))]
        centres = costmap.cells_to_world(ring)
        near = np.hypot(centres[:, 0] - pose.x, centres[:, 1] - pose.y) <= dist_tolerance
        yield np.concatenate([itself if inner < 0 else itself[:0], centres[near]])
        if outer == last:
            return
        inner, outer = outer, min(2 * outer, last)


def cells_by_distance(costmap: Costmap, center: tuple[int, int], reach: int) -> NDArray[np.int64]:
    """Cells (n, 2) of the square of ``reach`` cells around ``center``, nearest first, ties by x, then y."""
    x0, y0 = max(0, center[0] - reach), max(0, center[1] - reach)
    x1, y1 = min(costmap.width, center[0] + reach + 1), min(costmap.height, center[1] + reach + 1)
    ix, iy = (axis.ravel() for axis in np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)))
    order = np.lexsort((iy, ix, (ix - center[0]) ** 2 + (iy - center[1]) ** 2))
    return np.column_stack([ix, iy])[order]


def _turns(angle_tolerance: float, increment: float) -> NDArray[np.float64]:
    """Turns [rad] 0, +step, -step, ... up to the tolerance, evenly spread; half a turn is tried once."""
    limit = min(angle_tolerance, math.pi)
    count = math.ceil(limit / increment - 1e-9)
    positive = np.arange(1, count + 1) * (limit / count) if count else np.zeros(0)
    turns = np.concatenate([[0.0], np.column_stack([positive, -positive]).ravel()])
    return turns[:-1] if limit == math.pi else turns
