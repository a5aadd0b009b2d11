"""Finds files of one survey whose heights disagree where they overlap: a wrong datum, or scans that were not aligned.

When to use: before files become one cloud, whose surface would lie between them or have steps along their borders. When
not: to align them, which is the work of a registration, or to find shifts in the plan view, which this does not see.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray

BLOCK = 1.0
"""Edge [m] of the squares in which heights are compared."""
LEAST_BLOCKS, LEAST_POINTS = 20, 5
"""Squares in which two files are compared at least, and points that a square has of each."""
NOTED = 0.05
"""Differences of heights [m] up to this are not named."""
SAME_SURFACE = 1.0
"""Heights [m] that differ by more are of different surfaces, such as storeys, and are not compared."""
MOST_POINTS = 500_000
"""So many points of the overlap are looked at, of each of the two files."""


def disagreements(files: Sequence[Path], parts: Sequence[FloatArray]) -> list[str]:
    """Notes on pairs of files that lie above each other by more than ``NOTED``.

    Parameters
    ----------
    parts : sequence of (n, 3) float64
        Points of each file [m], z up.
    """
    corners = [(part[:, :2].min(axis=0), part[:, :2].max(axis=0)) for part in parts]
    notes = list[str]()
    for one, other in combinations(range(len(files)), 2):
        lower, upper = np.maximum(corners[one][0], corners[other][0]), np.minimum(corners[one][1], corners[other][1])
        if not (lower < upper).all():
            continue
        differences = _differences(_within(parts[one], lower, upper), _within(parts[other], lower, upper), lower)
        if len(differences) < LEAST_BLOCKS or abs(above := float(np.median(differences))) <= NOTED:
            continue
        upper_file, lower_file = (files[other], files[one]) if above > 0.0 else (files[one], files[other])
        notes.append(
            f"{upper_file.name} lies {abs(above):.2f} m above {lower_file.name} where they overlap "
            f"({len(differences) * BLOCK * BLOCK:.0f} m² compared): check their datum and their alignment"
        )
    return notes


def _within(points: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Points of a rectangle, at most ``MOST_POINTS``, evenly chosen in their order."""
    is_inside = np.logical_and(points[:, :2] >= lower, points[:, :2] <= upper)
    chosen = points[is_inside[:, 0] & is_inside[:, 1]]
    return chosen[:: len(chosen) // MOST_POINTS + 1]


def _differences(one: FloatArray, other: FloatArray, corner: FloatArray) -> FloatArray:
    """How much the other's median height is above the one's, in each square that has enough points of both [m]."""
    (squares, heights), (other_squares, other_heights) = _medians(one, corner), _medians(other, corner)
    _, here, there = np.intersect1d(squares, other_squares, assume_unique=True, return_indices=True)
    differences = other_heights[there] - heights[here]
    return differences[np.abs(differences) <= SAME_SURFACE]


def _medians(points: FloatArray, corner: FloatArray) -> tuple[IntArray, FloatArray]:
    """Squares (m,) that hold enough points, and the median heights (m,) of their points [m]."""
    column, row = np.floor((points[:, :2] - corner) / BLOCK).astype(np.int64).T
    square = column * (2**31) + row
    order = np.lexsort((points[:, 2], square))
    squares, firsts, counts = np.unique(square[order], return_index=True, return_counts=True)
    heights = points[order[firsts + counts // 2], 2]
    is_enough = counts >= LEAST_POINTS
    return squares[is_enough], heights[is_enough]
