"""Triangles of simple solids, centred at the origin, faces counter-clockwise seen from outside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

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


def box_triangles(size: Sequence[float]) -> tuple[FloatArray, IntArray]:
    """Box of ``size`` (3,) [m]: vertices (8, 3), faces (12, 3)."""
    return BOX_CORNERS * np.asarray(size, dtype=float), BOX_FACES.copy()


def joined(parts: Sequence[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    """All parts as one mesh."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = [faces + np.int32(start) for (_, faces), start in zip(parts, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def cylinder_triangles(radius: float, height: float, sides: int = 24) -> tuple[FloatArray, IntArray]:
    """Upright cylinder as a prism of ``sides``: vertices (2 * sides + 2, 3), faces (4 * sides, 3)."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    bottom, top = -0.5 * height, 0.5 * height
    vertices = np.concatenate(
        [
            np.column_stack([ring, np.full(sides, bottom)]),
            np.column_stack([ring, np.full(sides, top)]),
            [[0.0, 0.0, bottom], [0.0, 0.0, top]],
        ]
    )
    i = np.arange(sides)
    j = (i + 1) % sides
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = np.concatenate(
        [
            np.column_stack([i, j, j + sides]),
            np.column_stack([i, j + sides, i + sides]),
            np.column_stack([low, j, i]),
            np.column_stack([high, i + sides, j + sides]),
        ]
    )
    return vertices, faces.astype(np.int32)
