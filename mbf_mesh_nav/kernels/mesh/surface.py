"""The arrays of a mesh as kernels take them: one argument instead of eight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Surface(NamedTuple):
    """Arrays of a ``MeshTopology``, which says what they hold."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    face_normals: NDArray[np.float64]
    face_neighbours: NDArray[np.int32]
    vertex_face_offsets: NDArray[np.int32]
    vertex_faces: NDArray[np.int32]
    neighbour_offsets: NDArray[np.int32]
    neighbours: NDArray[np.int32]
