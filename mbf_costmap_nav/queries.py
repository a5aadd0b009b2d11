"""The four questions a client may ask a costmap without planning: cost of a point, a pose, a path; nearest valid pose.

Semantics are those of MBF's costmap services (check_point_cost, check_pose_cost, check_path_cost, find_valid_pose), with
these deviations, each the cure of a known fault:

- no cell is counted twice (there the outline was), and the safety distance is a true offset of the footprint;
- a pose or path in another frame is refused (there the untransformed request was searched); the server transforms;
- a search that finds nothing returns no pose (there it returned the one it was asked about).

All functions work on a snapshot, so they hold no lock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Path, Pose
from mbf_costmap_nav.collision import CostState, footprint_costs
from mbf_costmap_nav.costmap import INSCRIBED, LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.kernels.free_pose import first_fitting_pose

DEFAULT_ANGLE_INCREMENT = math.radians(5.0)
STATE_OF_COST = {INSCRIBED: CostState.INSCRIBED, LETHAL: CostState.LETHAL, UNKNOWN: CostState.UNKNOWN}


@dataclass(frozen=True)
class CostMultipliers:
    """Factors for lethal, inscribed and unknown cells in a sum of costs."""

    lethal: float = 1.0
    inscribed: float = 1.0
    unknown: float = 1.0


@dataclass(frozen=True)
class CostAnswer:
    """State and (summed) cost of what was asked about; the cost of anything outside is 0."""

    state: CostState
    cost: float


@dataclass(frozen=True)
class PathAnswer:
    """Largest state and summed cost over the checked poses, and the index of the last one looked at (-1: none)."""

    last_checked: int
    state: CostState
    cost: float


@dataclass(frozen=True)
class ValidPoseAnswer:
    """Result of the search for a valid pose.

    FREE or INSCRIBED: ``pose`` fits. UNKNOWN or OUTSIDE: nothing fits, ``pose`` is the nearest that only touches unknown
    cells or the border. LETHAL: nothing at all, ``pose`` is None. ``cost`` is the highest cost under the footprint.
    """

    state: CostState
    cost: float
    pose: Pose | None


def check_point(costmap: Costmap, x: float, y: float) -> CostAnswer:
    """State and cost of the cell at the point (x, y) [m]."""
    cost = costmap.cost_at(x, y)
    if cost is None:
        return CostAnswer(CostState.OUTSIDE, 0.0)
    return CostAnswer(STATE_OF_COST.get(cost, CostState.FREE), float(cost))


def check_pose(
    costmap: Costmap,
    footprint: Footprint,
    pose: Pose,
    safety_distance: float = 0.0,
    multipliers: CostMultipliers = CostMultipliers(),  # noqa: B008 - frozen
) -> CostAnswer:
    """State and summed cost of the footprint at a pose.

    Parameters
    ----------
    costmap : Costmap
    footprint : Footprint
        Padded or not, as the caller wishes.
    pose : Pose
        In the costmap's frame.
    safety_distance : float
        Distance [m] the footprint must keep; it is offset by that.
    multipliers : CostMultipliers

    Raises
    ------
    ValueError
        The pose is in another frame.
    """
    _require_frame(costmap, pose.frame_id)
    return _check(costmap, footprint.offset(safety_distance), pose, multipliers)


def _check(costmap: Costmap, footprint: Footprint, pose: Pose, multipliers: CostMultipliers) -> CostAnswer:
    costs = footprint_costs(costmap, footprint, pose.x, pose.y, pose.yaw)
    return CostAnswer(costs.state, costs.weighted_sum(multipliers.lethal, multipliers.inscribed, multipliers.unknown))


def check_path(
    costmap: Costmap,
    footprint: Footprint,
    path: Path,
    safety_distance: float = 0.0,
    multipliers: CostMultipliers = CostMultipliers(),  # noqa: B008 - frozen
    *,
    return_on: CostState = CostState.FREE,
    skip_poses: int = 0,
    path_cells_only: bool = False,
) -> PathAnswer:
    """Accumulate states and costs over the poses of a path.

    Parameters
    ----------
    return_on : CostState
        Stop after the pose at which the accumulated state reaches this one; FREE = never.
    skip_poses : int
        Poses to leave out after each checked one.
    path_cells_only : bool
        Look only at the cell of each pose; footprint and safety distance are ignored.

    Raises
    ------
    ValueError
        The path is in another frame, or ``skip_poses`` is negative.
    """
    _require_frame(costmap, path.frame_id)
    if skip_poses < 0:
        raise ValueError(f"skip_poses must not be negative, got {skip_poses}")
    outline = Footprint([]) if path_cells_only else footprint.offset(safety_distance)
    last_checked, state, cost = -1, CostState.FREE, 0.0
    for index in range(0, len(path), skip_poses + 1):
        answer = _check(costmap, outline, path[index], multipliers)
        last_checked, state, cost = index, max(state, answer.state), cost + answer.cost
        if CostState.FREE < return_on <= state:
            break
    return PathAnswer(last_checked, state, cost)


def find_valid_pose(
    costmap: Costmap,
    footprint: Footprint,
    pose: Pose,
    dist_tolerance: float,
    angle_tolerance: float,
    safety_distance: float = 0.0,
    angle_increment: float = DEFAULT_ANGLE_INCREMENT,
) -> ValidPoseAnswer:
    """Find the pose nearest to ``pose`` at which the footprint touches nothing lethal or unknown.

    The requested pose comes first, then cell centres by their distance from its cell; at each the requested heading
    comes first, then growing turns to the left and right. If the heading stays, the orientation is returned as given.

    Parameters
    ----------
    dist_tolerance : float
        Largest distance [m] of the position from the requested one.
    angle_tolerance : float
        Largest turn [rad] from the requested heading.
    safety_distance : float
        Distance [m] the footprint must keep.
    angle_increment : float
        Largest step between two headings [rad].

    Raises
    ------
    ValueError
        The pose is in another frame, a tolerance is negative, or the increment not positive.
    """
    _require_frame(costmap, pose.frame_id)
    if dist_tolerance < 0.0 or angle_tolerance < 0.0 or angle_increment <= 0.0:
        raise ValueError(f"tolerances {dist_tolerance}, {angle_tolerance}, increment {angle_increment} out of range")
    candidates = _candidates(costmap, pose, dist_tolerance)
    turns = _turns(angle_tolerance, angle_increment)
    outline = footprint.offset(safety_distance)
    vertices = outline.vertices if len(outline.vertices) >= 3 else np.zeros((1, 2))
    lower_left = np.array([costmap.origin_x, costmap.origin_y])
    which, turn, state, cost = first_fitting_pose(
        costmap.cells, vertices / costmap.resolution, (candidates - lower_left) / costmap.resolution, pose.yaw + turns
    )
    if which < 0:
        return ValidPoseAnswer(CostState.LETHAL, float(LETHAL), None)
    x, y = candidates[which].tolist()
    orientation = pose.orientation if turn == 0 else Pose.planar(0.0, 0.0, pose.yaw + float(turns[turn])).orientation
    found = Pose((x, y, pose.z), orientation, pose.frame_id, pose.stamp)
    return ValidPoseAnswer(CostState(state), float(cost), found)


def _candidates(costmap: Costmap, pose: Pose, dist_tolerance: float) -> NDArray[np.float64]:
    """Positions (n, 2) [m] to try in order: the pose itself if on the map, then cell centres within the tolerance."""
    reach = math.ceil(dist_tolerance / costmap.resolution) + 1
    cells = cells_by_distance(costmap, costmap.world_to_cell_clamped(pose.x, pose.y), reach)
    centres = costmap.cells_to_world(cells)
    near = np.hypot(centres[:, 0] - pose.x, centres[:, 1] - pose.y) <= dist_tolerance
    itself = np.array([[pose.x, pose.y]]) if costmap.contains(pose.x, pose.y) else np.zeros((0, 2))
    return np.concatenate([itself, centres[near]])


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


def _require_frame(costmap: Costmap, frame_id: str) -> None:
    if frame_id != costmap.frame_id:
        raise ValueError(f"expected frame {costmap.frame_id!r}, got {frame_id!r}; transform it first")
