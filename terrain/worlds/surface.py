"""Triangle meshes of worlds and things: boxes, cylinders, height grids, and functions to join them.

The order of vertices and faces decides how rays round and how wheels touch, so trimesh's solids are not used: their
order differs, which would change every drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import rotated

IntArray = NDArray[np.int32]

MERGE_DISTANCE = 1e-6  # m; corners nearer than this are one

BOX_CORNERS = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
BOX_FACES = np.array(
    [
        [0, 2, 3], [0, 3, 1],  # bottom
        [4, 5, 7], [4, 7, 6],  # top
        [0, 1, 5], [0, 5, 4],  # front, -y
        [2, 6, 7], [2, 7, 3],  # back, +y
        [0, 4, 6], [0, 6, 2],  # left, -x
        [1, 3, 7], [1, 7, 5],  # right, +x
    ],
    dtype=np.int32,
)  # fmt: skip


class Surface(NamedTuple):
    """Triangles: ``vertices`` (n, 3) float64 [m] and ``faces`` (m, 3) int32, counter-clockwise seen from outside."""

    vertices: FloatArray
    faces: IntArray

    def at(self, pose: Pose) -> Surface:
        """Return the surface in the map, its own frame at ``pose``."""
        return Surface(rotated(pose.rotation, self.vertices) + pose.position, self.faces)


NO_SURFACE = Surface(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


def box(size: Sequence[float]) -> Surface:
    """Box of ``size`` (3,) [m] about the origin: 8 vertices, 12 faces."""
    return Surface(BOX_CORNERS * np.asarray(size, dtype=float), BOX_FACES.copy())


def box_between(low: Sequence[float], high: Sequence[float]) -> Surface:
    """Axis-parallel box from corner ``low`` to corner ``high``, each (3,) [m]."""
    corners = np.array([low, high], dtype=float)
    vertices, faces = box((corners[1] - corners[0]).tolist())
    return Surface(vertices + corners.mean(axis=0), faces)


def level_rectangle(x_min: float, x_max: float, y_min: float, y_max: float) -> Surface:
    """Level rectangle at z = 0 between these coordinates [m]."""
    corners = np.array([[x_min, y_min, 0], [x_max, y_min, 0], [x_max, y_max, 0], [x_min, y_max, 0]], dtype=float)
    return Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))


def cylinder(radius: float, height: float, sides: int = 24) -> Surface:
    """Upright cylinder about the origin as a prism: 2 * sides + 2 vertices, 4 * sides faces."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    bottom, top = -0.5 * height, 0.5 * height
    rings = [np.column_stack([ring, np.full(sides, z)]) for z in (bottom, top)]
    near = np.arange(sides)
    far = (near + 1) % sides
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    corners = (
        (near, far, far + sides),
        (near, far + sides, near + sides),
        (low, far, near),
        (high, near + sides, far + sides),
    )
    faces = np.concatenate([np.column_stack(triangle) for triangle in corners])
    return Surface(np.concatenate([*rings, [[0.0, 0.0, bottom], [0.0, 0.0, top]]]), faces.astype(np.int32))


def height_grid(x: ArrayLike, y: ArrayLike, z: ArrayLike, keep: ArrayLike | None = None) -> Surface:
    """Build a surface over a grid; its faces look up, two for each cell, parted along the anti-diagonal.

    Parameters
    ----------
    x, y : (nx,), (ny,) float
        Grid lines [m], rising.
    z : (ny, nx) float
        Heights of the grid's corners [m].
    keep : (ny - 1, nx - 1) bool, optional
        Cells that exist; the others are holes.
    """
    gx, gy = np.meshgrid(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    vertices = np.column_stack([gx.ravel(), gy.ravel(), np.asarray(z, dtype=float).ravel()])
    ny, nx = gx.shape
    i = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).astype(np.int32)
    i = i.ravel() if keep is None else i[np.asarray(keep)]
    lower, upper = np.stack([i, i + 1, i + nx], axis=-1), np.stack([i + 1, i + nx + 1, i + nx], axis=-1)
    return Surface(vertices, np.stack([lower, upper], axis=1).reshape(-1, 3))


def joined(parts: Sequence[Surface]) -> Surface:
    """All parts as one mesh, side by side; none for no parts."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)]).tolist()
    faces = [part.faces + np.int32(start) for part, start in zip(parts, starts, strict=False)]
    vertices = [part.vertices for part in parts]
    return Surface(np.concatenate([NO_SURFACE.vertices, *vertices]), np.concatenate([NO_SURFACE.faces, *faces]))


def merged(parts: Sequence[Surface]) -> Surface:
    """All parts as one mesh in which corners at the same place are one vertex; corners that no face uses are left out.

    Levels and ramps that end on the same grid line at the same height are connected there and nowhere else.
    """
    vertices, faces = joined(parts)
    keys = np.rint(vertices / MERGE_DISTANCE).astype(np.int64)
    _, first, where = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    used, compact = np.unique(where.ravel()[faces], return_inverse=True)
    return Surface(vertices[first[used]], compact.reshape(-1, 3).astype(np.int32))
