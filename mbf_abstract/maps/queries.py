"""Requests and answers of the map-independent questions, see ``map_queries.MapQueries``.

Their fields are those of the services of ``mbf_costmap_nav``. States are ordered: for a footprint or a path the worst
one counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.kernels.steps import positions_in_frame

PlanarPose = tuple[float, float, float]
"""x, y [m] and heading [rad] in a plane."""

PlaneCheck = Callable[[FloatArray], NDArray[np.int8]]
"""The ``Fit`` (n,) of the robot at poses (n, 3: x, y [m], heading [rad]) in the plane of a frame."""


class CellState(IntEnum):
    """How a place is for the robot, from good to bad."""

    FREE = 0
    INSCRIBED = 1
    LETHAL = 2
    UNKNOWN = 3
    OUTSIDE = 4


@dataclass(frozen=True)
class PlaceAnswer:
    """State and cost of a place.

    Attributes
    ----------
    state : CellState
        Worst state of what lies under the robot; UNKNOWN hides what is known beside it.
    cost : float
        In the map's own unit (costmap: sum of cell costs).
    known : CellState, optional
        Worst state of what is known under the robot, where ``state`` is UNKNOWN; None if the map does not say.
    """

    state: CellState
    cost: float
    known: CellState | None = None

    def is_blocked(self, limit: CellState = CellState.LETHAL, *, unknown: bool = False) -> bool:
        """Whether anything known is as bad as ``limit``, or, with ``unknown``, anything is unknown."""
        if self.state is CellState.UNKNOWN:
            return unknown or (self.known is not None and self.known >= limit)
        return self.state >= limit


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
    """How a place is checked.

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

PADDED = PlaceQuery(use_padded_footprint=True)
"""The robot with its padded outline, as controllers and recoveries check it."""


PlaceCheck = Callable[[Pose], PlaceAnswer]
"""State and cost at a pose in the frame of the map."""


def on_map(frame: Transform, pose: PlanarPose) -> Pose:
    """Return a pose in the plane of ``frame``, in that frame's parent."""
    x, y, yaw = pose
    return frame.apply_to_pose(Pose.planar(x, y, yaw, frame_id=frame.child))


class Fit(IntEnum):
    """Whether the robot may stand at a pose, from bad to good."""

    TOUCHES = 0
    OFF_PATHS = 1
    """It touches nothing, on ground that no plan leads over."""
    FREE = 2


def in_plane(frame: Transform, poses: FloatArray) -> FloatArray:
    """Positions (n, 3) [m], in the parent of ``frame``, of poses (n, 3) in its plane; each as of ``on_map``."""
    return np.asarray(positions_in_frame(poses, frame.translation, frame.rotation))


def each_pose(touch: PlaceCheck, on_path: PlaceCheck, frame: Transform) -> PlaneCheck:
    """Return the check of poses in the plane of ``frame`` that asks the checks of one pose about each."""

    def fit(pose: PlanarPose) -> Fit:
        there = on_map(frame, pose)
        if touch(there).state > CellState.INSCRIBED:
            return Fit.TOUCHES
        return Fit.FREE if on_path(there).state <= CellState.INSCRIBED else Fit.OFF_PATHS

    return one_by_one(fit, np.int8)


def one_by_one(function: Callable[[PlanarPose], Any], kind: DTypeLike) -> Callable[[FloatArray], NDArray[Any]]:
    """Return the function of many poses (n, 3) that calls ``function`` for each; its values are of a ``kind``."""
    return lambda poses: np.array([function((x, y, yaw)) for x, y, yaw in poses.tolist()], dtype=kind)
