"""Map-independent questions: what a point, a pose or a path costs, and where the robot fits.

An executive asks these before it sends a goal. The request and answer fields are those of the services of
``mbf_costmap_nav``; every server with a map answers them. States are ordered: for a footprint or a path the worst
one counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from mbf_abstract.geometry import Path, Pose


class CellState(IntEnum):
    """How a place is for the robot, from good to bad."""

    FREE = 0
    INSCRIBED = 1
    LETHAL = 2
    UNKNOWN = 3
    OUTSIDE = 4


@dataclass(frozen=True)
class PlaceAnswer:
    """State and cost of a place; the cost is the map's own unit (costmap: sum of cell costs)."""

    state: CellState
    cost: float


@dataclass(frozen=True)
class PathAnswer:
    """Worst state and summed cost over the poses that were looked at; ``last_checked`` is the index of the last."""

    last_checked: int
    state: CellState
    cost: float


@dataclass(frozen=True)
class PoseAnswer:
    """A pose where the robot fits, with its state and cost; ``pose`` is None where none was found."""

    state: CellState
    cost: float
    pose: Pose | None


@dataclass(frozen=True)
class PlaceQuery:
    """How a place is judged.

    Attributes
    ----------
    safety_dist : float
        Distance [m] the robot's outline is grown by; not negative.
    lethal_cost_mult, inscrib_cost_mult, unknown_cost_mult : float
        Factors for the costs of such places.
    local : bool
        Ask the local map of a server that has two.
    use_padded_footprint : bool
        Use the outline with its configured padding.

    Raises
    ------
    ValueError
        The safety distance is negative or not finite.
    """

    safety_dist: float = 0.0
    lethal_cost_mult: float = 1.0
    inscrib_cost_mult: float = 1.0
    unknown_cost_mult: float = 1.0
    local: bool = False
    use_padded_footprint: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.safety_dist < math.inf:
            raise ValueError(f"safety_dist must be 0 m or more and finite, got {self.safety_dist}")


AS_CONFIGURED = PlaceQuery()
"""The robot with its configured outline, and costs as they are."""


class MapQueries(Protocol):
    """What a server with a map answers. Poses may be in any known frame; TransformError where it is not known."""

    def check_point(self, point: Pose, local: bool = False) -> PlaceAnswer:
        """Return state and cost of one point of the map."""

    def check_pose(self, pose: Pose | None, query: PlaceQuery = PlaceQuery()) -> PlaceAnswer:
        """Return state and cost of the robot's outline at ``pose`` (None = where the robot is)."""

    def check_path(
        self,
        path: Path,
        query: PlaceQuery = PlaceQuery(),
        return_on: CellState | None = None,
        skip_poses: int = 0,
        path_cells_only: bool = False,
    ) -> PathAnswer:
        """Return worst state and summed cost along a path; stop at a state of at least ``return_on``."""

    def find_valid_pose(
        self, pose: Pose | None, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery = PlaceQuery()
    ) -> PoseAnswer:
        """Return the nearest pose within the tolerances [m, rad] where the robot fits."""

    def clear_map(self) -> None:
        """Forget what sensors have marked."""

    def update_map(self) -> None:
        """Bring the map up to date now."""
