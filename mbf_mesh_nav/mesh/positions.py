"""Positions as kernels and as messages have them."""

from __future__ import annotations

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.kernels.mesh.vectors import Vector


def vector_of(array: FloatArray) -> Vector:
    """Return an array (3,) as the vector of kernels."""
    return float(array[0]), float(array[1]), float(array[2])


def position_text(position: FloatArray | Vector) -> str:
    """Write a position (3,) [m] for a message."""
    return f"({position[0]:.2f}, {position[1]:.2f}, {position[2]:.2f})"
