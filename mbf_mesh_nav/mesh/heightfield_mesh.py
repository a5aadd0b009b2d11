"""Heightfields as triangle meshes, split exactly as the Bullet physics engine splits them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mbf_mesh_nav.arrays import FloatArray, IntArray


def heightfield_mesh(
    heights: ArrayLike, dx: float, dy: float, x0: float = 0.0, y0: float = 0.0, keep_grid: bool = False
) -> tuple[FloatArray, IntArray]:
    """Triangulate a heightfield along the anti-diagonals (x+1, y)-(x, y+1), the split of Bullet's heightfield shape.

    Parameters
    ----------
    heights : (ny, nx) float
        z [m]; rounded to float32, which is what the physics engine computes with. NaN leaves a hole.
    dx, dy : float
        Spacing of columns and rows [m].
    x0, y0 : float
        Position of ``heights[0, 0]`` [m].
    keep_grid : bool
        Keep a vertex, with a z of NaN, for samples that belong to no face; ``repair.checked_mesh`` leaves
        them out and still numbers the others as the grid does.

    Returns
    -------
    vertices : (V, 3) float64
        Row by row; without holes, or with ``keep_grid``, vertex ``iy * nx + ix`` is sample ``heights[iy, ix]``.
    faces : (F, 3) int32
        Counter-clockwise seen from above.
    """
    z = np.asarray(heights, dtype=np.float32).astype(np.float64)
    if z.ndim != 2 or min(z.shape) < 2:
        raise ValueError(f"heights must be a (ny, nx) array with at least 2 x 2 samples, got shape {z.shape}")
    if not (0.0 < dx < np.inf and 0.0 < dy < np.inf):
        raise ValueError(f"the spacing must be positive, got dx={dx}, dy={dy}")
    ny, nx = z.shape
    x, y = np.meshgrid(x0 + dx * np.arange(nx), y0 + dy * np.arange(ny))
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])

    corner = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)[None, :]).ravel().astype(np.int32)
    lower = np.column_stack([corner, corner + 1, corner + nx])
    upper = np.column_stack([corner + 1, corner + nx + 1, corner + nx])
    faces = np.stack([lower, upper], axis=1).reshape(-1, 3)
    known = np.isfinite(vertices[:, 2])
    if known.all():
        return vertices, faces
    faces = faces[known[faces].all(axis=1)]
    if keep_grid:
        in_hole = np.ones(len(vertices), dtype=np.bool_)
        in_hole[faces] = False
        vertices[in_hole, 2] = np.nan
        return vertices, faces
    used, compact = np.unique(faces, return_inverse=True)
    return vertices[used], compact.reshape(-1, 3).astype(np.int32)
