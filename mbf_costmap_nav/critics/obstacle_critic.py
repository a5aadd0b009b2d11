"""The critic that keeps away from obstacles: mean cell cost along the trajectory; marks trajectories that collide.

The footprint is approximated by a row of discs of the inscribed radius along the robot's x axis, each looked up as one
cell of the inflated map. Corners stick out of the discs by up to 0.41 inscribed radii; the controllers check the chosen
trajectory with the full footprint afterwards.
"""

from __future__ import annotations

import numpy as np

from mbf_costmap_nav.critics.rollouts import Float32Array, Rollouts
from mbf_costmap_nav.grid.costmap import INSCRIBED, UNKNOWN
from mbf_costmap_nav.kernels.control.critics import map_costs

STRIDE = 2
"""Every how many steps the map is looked up: at 0.05 s and 0.5 m/s every 5 cm, one cell."""
COLLISION = 1.0e6
"""Cost of a collision, larger than the sum of all other terms."""

_VALUES = np.concatenate([np.arange(INSCRIBED) / 252.0, np.full(UNKNOWN - INSCRIBED, COLLISION), [0.0]])
VALUE_OF_COST = _VALUES.astype(np.float32)
"""(256,) what a cell adds: 0..1 by its cost, COLLISION from the inscribed one on, nothing if unknown."""
WHILE_TOUCHING = np.minimum(VALUE_OF_COST, np.float32(1.0))
"""The same for a robot that touches something already: no cell that it has to cross counts as a collision."""


def obstacle(rollouts: Rollouts) -> Float32Array:
    """Mean over the steps of the most expensive disc; marks ``rollouts.collided``."""
    grid = rollouts.costmap
    total = map_costs(
        grid.cells,
        grid.resolution,
        grid.origin_x - rollouts.robot[0],
        grid.origin_y - rollouts.robot[1],
        rollouts.poses,
        rollouts.discs,
        STRIDE,
        WHILE_TOUCHING if rollouts.touches else VALUE_OF_COST,
    )
    np.greater_equal(total, np.float32(COLLISION), out=rollouts.collided)
    return np.asarray(total / np.float32(rollouts.poses.shape[1] / STRIDE))
