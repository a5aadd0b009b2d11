"""How wrong the heights under the wheels of a footprint are, at every vertex and heading."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array, FloatArray
from mbf_mesh_nav.kernels.compiled import Count, kernel
from mbf_mesh_nav.kernels.layers.footprint_settling import face_below, upward_face
from mbf_mesh_nav.kernels.mesh.surface import Surface


@kernel
def errors_below_wheels(
    surface: Surface, wheel_angles: FloatArray, wheel_order: NDArray[np.int64], radius: float, errors: FloatArray
) -> Float32Array:
    """Root mean square (V, heading_count) of the standard errors [m] of the heights under the four wheels.

    That of a wheel is the root mean square of the corners of the face it stands on. A wheel without ground has that of
    the vertex; there no heading is allowed anyway.

    Parameters
    ----------
    wheel_angles, wheel_order : (4 heading_count,)
        Where the wheels of all headings stand, see ``footprint_settling.wheel_directions``.
    radius : float
        Of the circle on which all wheels stand [m].
    errors : (V,) float64
        Of the vertices [m].
    """
    count, heading_count = surface.vertices.shape[0], len(wheel_order) // 4
    result = np.empty((count, heading_count), dtype=np.float32)
    squares = np.empty(4 * heading_count, dtype=np.float64)
    for vertex in range(count):
        start_face = upward_face(surface, Count(vertex))
        face, own = start_face, errors[vertex] * errors[vertex]
        for index in range(len(wheel_order)):
            found = -1
            if start_face >= 0:
                x = surface.vertices[vertex, 0] + radius * np.cos(wheel_angles[index])
                y = surface.vertices[vertex, 1] + radius * np.sin(wheel_angles[index])
                found = face_below(surface, face, x, y)
                if found < 0 and face != start_face:
                    found = face_below(surface, start_face, x, y)
            face = found if found >= 0 else start_face
            square = 3.0 * own if found < 0 else 0.0
            if found >= 0:
                for corner in range(3):
                    error = errors[surface.faces[found, corner]]
                    square += error * error
            squares[wheel_order[index]] = square / 3.0
        for heading in range(heading_count):
            total = 0.0
            for wheel in range(4):
                total += squares[4 * heading + wheel]
            result[vertex, heading] = np.sqrt(0.25 * total)
    return result
