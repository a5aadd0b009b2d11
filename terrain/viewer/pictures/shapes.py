"""Surfaces that the replay and the logs draw alike: walls cut low, and the prism of a robot's body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain.worlds.surface import Surface

FloatArray = NDArray[np.float64]

WALL_CUT = 0.9  # m above the lowest point of the walls


def cut_walls(walls: Surface) -> Surface:
    """Cut walls low, as in a doll's house, so that one can look into rooms."""
    vertices = walls.vertices.copy()
    vertices[:, 2] = np.minimum(vertices[:, 2], vertices[:, 2].min(initial=0.0) + WALL_CUT)
    return Surface(vertices, walls.faces)


def prism(outline: FloatArray, z_min: float, z_max: float) -> Surface:
    """An upright prism over a convex outline (n, 2), counter-clockwise."""
    count = len(outline)
    bottom = np.column_stack([outline, np.full(count, z_min)])
    top = np.column_stack([outline, np.full(count, z_max)])
    near = np.arange(count)
    far = (near + 1) % count
    sides = np.concatenate([np.stack([near, far, far + count], 1), np.stack([near, far + count, near + count], 1)])
    fan = np.stack([np.zeros(count - 2, int), near[1:-1], near[2:]], axis=1)
    faces = np.concatenate([sides, fan + count, fan[:, ::-1]])
    return Surface(np.concatenate([bottom, top]), faces.astype(np.int32))
