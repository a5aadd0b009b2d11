"""What the critics look at: sampled trajectories with the path, the goal and the map; and the critics' weights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import normalize_angle
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.kernels.control.critics import furthest_reached

Float32Array = NDArray[np.float32]

AHEAD = 4
"""How many path points beyond the furthest reached one the desired heading points at."""
FACING = 0.785
"""Angle [rad] to that point below which the robot faces the path."""

LOOKING_AWAY = 1.571
"""Angle [rad] to that point above which driving in the wrong direction would bring the robot nearer to it."""


class CriticParameters(ParameterModel):
    """Weights of the critics; a weight of 0 switches a critic off (obstacles still count as collisions)."""

    obstacle: float = parameter(4.0, "Weight of the mean cell cost along the trajectory (0..1).", ge=0.0, le=1e4)
    goal: float = parameter(5.0, "Weight of the distance to a near goal.", unit="1/m", ge=0.0, le=1e4)
    goal_angle: float = parameter(3.0, "Weight of the heading at a near goal.", unit="1/rad", ge=0.0, le=1e4)
    path_align: float = parameter(10.0, "Weight of the distance from the path.", unit="1/m", ge=0.0, le=1e4)
    path_follow: float = parameter(
        5.0, "Weight of the distance to the target point ahead on the path.", unit="1/m", ge=0.0, le=1e4
    )
    path_angle: float = parameter(2.0, "Weight of the heading towards the path.", unit="1/rad", ge=0.0, le=1e4)
    prefer_forward: float = parameter(
        5.0, "Weight of driving against the path's direction of travel, mostly backward.", unit="s/m", ge=0.0, le=1e4
    )
    twirling: float = parameter(0.0, "Weight of turning; for omnidirectional robots.", unit="s/rad", ge=0.0, le=1e4)


@dataclass
class Rollouts:
    """Sampled trajectories and the inputs of the critics; positions are relative to the robot, axes of the map.

    Attributes
    ----------
    poses : (3, steps, samples) float32
        x, y [m], yaw [rad] after each step.
    velocities : (3, steps, samples) float32
        vx, vy [m/s], wz [rad/s] of each step.
    path : (m, 2) float32
        Points of the path ahead [m], ``path_spacing`` apart; the first is the robot's nearest. Beyond a cusp they run
        straight on, so that the robot does not creep towards the cusp; it reverses when it is there.
    path_free : (m,) bool
        Whether the cell of each path point is below the inscribed cost.
    path_spacing : float
        Distance of two path points [m].
    remaining : float
        Length [m] left to the end of the plan.
    goal : (x, y, yaw)
        End of the plan.
    on_last_section : bool
        Whether there is no cusp before it.
    backward : bool
        Whether the path is driven in reverse here.
    goal_tolerance : float
        Distance [m] from the goal that counts as arrived.
    robot : (x, y)
        The robot's position [m] in the map, to look cells up.
    discs : (k,) float32
        Offsets [m] along the robot's x axis of the discs of its inscribed radius that stand for its footprint.
    turning_radius : float
        Radius of the tightest curve [m]; 0 = the robot turns on the spot.
    touches : bool
        Whether the robot touches an obstacle already; no trajectory counts as collided then, see ``is_free``.
    collided : (samples,) bool
        Set by the obstacle critic.
    """

    poses: Float32Array
    velocities: Float32Array
    path: Float32Array
    path_free: NDArray[np.bool_]
    path_spacing: float
    remaining: float
    goal: tuple[float, float, float]
    on_last_section: bool
    backward: bool
    goal_tolerance: float
    costmap: Costmap
    robot: tuple[float, float]
    discs: Float32Array
    turning_radius: float = 0.0
    touches: bool = False
    collided: NDArray[np.bool_] = field(init=False)
    furthest: int = field(init=False)

    def __post_init__(self) -> None:
        self.collided = np.zeros(self.poses.shape[2], dtype=bool)
        self.furthest = int(furthest_reached(self.poses, self.path, 4))

    @property
    def samples(self) -> int:
        """Number of trajectories."""
        return int(self.poses.shape[2])

    def near_goal(self, distance: float) -> bool:
        """Whether at most ``distance`` [m] are left of the whole path."""
        return self.on_last_section and self.remaining <= distance

    @property
    def direction_ahead(self) -> float:
        """Desired heading [rad]: towards a path point ahead, in reverse away from it."""
        x, y = self.path[min(max(self.furthest, AHEAD) + AHEAD, len(self.path) - 1)].tolist()
        return math.atan2(-y, -x) if self.backward else math.atan2(y, x)

    @property
    def faces_path(self) -> bool:
        """Whether the robot roughly faces along its path."""
        return self._angle_off_path < FACING

    @property
    def has_to_turn(self) -> bool:
        """Whether the robot faces away from its path and can turn on the spot, which it should do before it drives."""
        return self.turning_radius == 0.0 and self._angle_off_path > LOOKING_AWAY

    @property
    def _angle_off_path(self) -> float:
        return abs(normalize_angle(self.direction_ahead - float(self.poses[2, 0, 0])))
