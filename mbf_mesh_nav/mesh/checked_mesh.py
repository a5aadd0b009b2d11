"""A mesh during checks, repairs and densifying, with the origin of each of its parts.

Use it between reading a mesh and ``topology.build_topology``. It is no map: it has no neighbours and no layers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.mesh.mesh_report import MeshError


@dataclass(frozen=True, eq=False)
class CheckedMesh:
    """A mesh without defects and where its parts came from.

    Attributes
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int32
    vertex_source, face_source : (V,), (F,) int32
        The caller's number, -1 = added later. The halves of a split face share the number of the whole.
    input_to_vertex : (V_input,) int32
        The other direction; -1 = dropped. Merged vertices share one number.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_source: IntArray
    face_source: IntArray
    input_to_vertex: IntArray

    def without_faces(self, dropped: BoolArray) -> CheckedMesh:
        """Copy without the faces of a mask (F,), the mesh itself if there are none."""
        if not dropped.any():
            return self
        return replace(self, faces=self.faces[~dropped], face_source=self.face_source[~dropped])

    def without_vertices(self, dropped: BoolArray) -> CheckedMesh:
        """Copy without the vertices of a mask (V,), none of which a face may use."""
        renumbered = np.where(dropped, -1, np.cumsum(~dropped) - 1).astype(np.int32)
        given = self.input_to_vertex
        return replace(
            self,
            vertices=self.vertices[~dropped],
            faces=renumbered[self.faces],
            vertex_source=self.vertex_source[~dropped],
            input_to_vertex=np.where(given >= 0, renumbered[given], -1).astype(np.int32),
        )

    def merged(self, target: IntArray) -> CheckedMesh:
        """Copy in which vertex ``target[v]`` (V,) stands for ``v``; targets stand for themselves."""
        moved = np.asarray(target != np.arange(len(target)))
        given = self.input_to_vertex
        given = np.where(given >= 0, target[given], -1).astype(np.int32)
        return replace(self, faces=target[self.faces], input_to_vertex=given).without_vertices(moved)

    def with_copies(self, originals: IntArray, faces: IntArray) -> CheckedMesh:
        """Copy whose faces (F, 3) name copies of vertices, too: number V + i is that of ``originals[i]``."""
        added = np.full(len(originals), -1, dtype=np.int32)
        return replace(
            self,
            vertices=np.vstack([self.vertices, self.vertices[originals]]),
            faces=faces,
            vertex_source=np.concatenate([self.vertex_source, added]),
        )

    @property
    def used(self) -> BoolArray:
        """Mask (V,) of the vertices that belong to a face."""
        mask = np.zeros(len(self.vertices), dtype=np.bool_)
        mask[self.faces] = True
        return mask


def edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Lengths (F, 3) [m] of the edges from corner k to corner k+1."""
    x, y, z = (column[faces] - column[np.roll(faces, -1, axis=1)] for column in np.ascontiguousarray(vertices.T))
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def shaped_arrays(vertices: ArrayLike, faces: ArrayLike, file: str) -> tuple[FloatArray, NDArray[np.int64]]:
    """Vertices (V, 3) and faces (F, 3) of a caller, of any index; MeshError if they are no such arrays."""
    points, corners = np.asarray(vertices), np.asarray(faces)
    reasons = []
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        reasons.append(f"vertices must be a (V, 3) array of numbers, got {points.shape} {points.dtype}")
    if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
        reasons.append(f"faces must be a (F, 3) array of integers, got {corners.shape} {corners.dtype}")
    elif len(corners) == 0:
        reasons.append("there is no face")
    if reasons:
        raise MeshError(file, reasons)
    return points.astype(np.float64), corners.astype(np.int64)
