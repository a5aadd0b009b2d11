"""What is wrong with a mesh, and the repairs a configuration may allow.

A mesh with a defect is refused unless its name stands in the configuration's ``repair`` list; the report says what
was found and done, with counts and indices in the caller's numbering. The caller's arrays and files are never changed.

``REPAIRS`` maps each defect that can be repaired to what the repair does. Harmless findings (unreferenced vertices,
several components) never refuse a mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mbf_mesh_nav.kernels.defects import (
    face_area_vectors,
    faces_without_area,
    repeated_faces,
    surplus_faces,
    winding_flips,
)
from mbf_mesh_nav.kernels.topology import faces_across_edges, faces_of_vertices

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

REPAIRS: dict[str, str] = {
    "non_finite": "drop vertices with NaN or inf and their faces",
    "index_out_of_range": "drop faces that name a vertex that does not exist",
    "duplicate_vertices": "merge vertices at the same position",
    "zero_area": "drop faces without area",
    "duplicate_faces": "drop faces with the same corners as an earlier one",
    "non_manifold": "drop the third and further faces at an edge, in index order",
    "flipped_winding": "turn faces round whose neighbours are wound the other way",
    "facing_down": "turn the whole mesh round",
    "unreferenced": "drop vertices without a face",
    "small_components": "keep only the component with the most vertices",
}
HARMLESS = frozenset({"unreferenced", "components", "coarse"})
ZERO_AREA_TOLERANCE = 1e-10
"""Doubled area over the longest edge squared; relative, so that millimetres and kilometres are treated alike."""
FACING_DOWN_SHARE = 0.05
"""A mesh faces down if its faces' summed area vector points down by more than this share of the area."""


@dataclass(frozen=True, eq=False)
class Finding:
    """One kind of defect: its name, a sentence, the caller's indices of the vertices or faces, whether repaired."""

    name: str
    text: str
    indices: NDArray[np.int64]
    repaired: bool = False

    @property
    def count(self) -> int:
        """How many vertices or faces are concerned."""
        return len(self.indices)

    def __str__(self) -> str:
        shown = ", ".join(str(index) for index in self.indices[:5])
        more = ", ..." if self.count > 5 else ""
        return f"{self.name}: {self.text} (indices {shown}{more}){' - repaired' if self.repaired else ''}"


@dataclass
class MeshReport:
    """All findings of one mesh, in the order of the checks."""

    findings: list[Finding] = field(default_factory=list)

    def __getitem__(self, name: str) -> Finding:
        return next(finding for finding in self.findings if finding.name == name)

    def __contains__(self, name: str) -> bool:
        return any(finding.name == name for finding in self.findings)

    @property
    def refusals(self) -> list[Finding]:
        """Findings that are neither repaired nor harmless."""
        return [finding for finding in self.findings if not finding.repaired and finding.name not in HARMLESS]


class MeshError(ValueError):
    """A mesh or its file cannot be used; names the file and every reason.

    Attributes
    ----------
    file : str
        The file, or "arrays".
    reasons : list of str
    """

    def __init__(self, file: str, reasons: Sequence[str]) -> None:
        self.file = file
        self.reasons = list(reasons)
        super().__init__(f"{file}: " + "; ".join(self.reasons))


@dataclass(frozen=True, eq=False)
class CheckedMesh:
    """A mesh without defects and where its parts came from.

    Attributes
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int32
    vertex_source, face_source : (V,), (F,) int32
        The caller's number, -1 = added later.
    input_to_vertex : (V_input,) int32
        The other direction; -1 = dropped. Merged vertices share one number.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_source: IntArray
    face_source: IntArray
    input_to_vertex: IntArray

    def without_faces(self, dropped: NDArray[np.bool_]) -> CheckedMesh:
        """Copy without the faces of a mask (F,)."""
        return replace(self, faces=self.faces[~dropped], face_source=self.face_source[~dropped])

    def without_vertices(self, dropped: NDArray[np.bool_]) -> CheckedMesh:
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


def checked_mesh(
    vertices: ArrayLike, faces: ArrayLike, repair: Sequence[str] = (), file: str = "arrays"
) -> tuple[CheckedMesh, MeshReport]:
    """Check a mesh and apply the allowed repairs.

    Every check runs on what the checks before it left over, so all defects come out at once; if one of them may not
    be repaired, the mesh is refused as a whole.

    Parameters
    ----------
    vertices : (V, 3) float
        Positions [m].
    faces : (F, 3) int
        Corners, counter-clockwise seen from above.
    repair : sequence of str
        Names of ``REPAIRS`` that may be applied.
    file : str
        Named in the error.

    Raises
    ------
    MeshError
        Unknown repair, wrong shape, no usable face, or a defect outside ``repair``.
    """
    if unknown := [name for name in repair if name not in REPAIRS]:
        raise MeshError(file, [f"unknown repair '{name}', the repairs are: {', '.join(REPAIRS)}" for name in unknown])
    points, corners = _shaped(vertices, faces, file)
    check = _Check(repair)
    mesh = check.indices(points, corners)
    mesh = check.duplicate_vertices(mesh)
    mesh = check.zero_area(mesh)
    mesh = check.edges(mesh)
    mesh = check.winding(mesh)
    mesh = check.components(mesh)
    mesh = check.unreferenced(mesh)
    reasons = [str(finding) for finding in check.report.refusals]
    if len(mesh.faces) == 0:
        reasons.append("no face is left")
    if reasons:
        raise MeshError(file, reasons)
    return mesh, check.report


def _shaped(vertices: ArrayLike, faces: ArrayLike, file: str) -> tuple[FloatArray, NDArray[np.int64]]:
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


class _Check:
    """The single checks; each reports its defect and returns the mesh without it."""

    def __init__(self, repair: Sequence[str]) -> None:
        self.repair = frozenset(repair)
        self.report = MeshReport()
        self._faces: IntArray | None = None

    def incidence(self, mesh: CheckedMesh) -> tuple[IntArray, IntArray]:
        """Faces of every vertex as CSR, computed once per face list."""
        if mesh.faces is not self._faces:
            self._faces = mesh.faces
            self._incidence = faces_of_vertices(mesh.faces, len(mesh.vertices))
        return self._incidence

    def found(self, name: str, text: str, indices: NDArray[np.integer]) -> None:
        if len(indices):
            text = text.format(count=len(indices))
            self.report.findings.append(Finding(name, text, indices.astype(np.int64), name in self.repair))

    def indices(self, points: FloatArray, corners: NDArray[np.int64]) -> CheckedMesh:
        identity = np.arange(len(points), dtype=np.int32)
        outside = ((corners < 0) | (corners >= len(points))).any(axis=1)
        text = f"{{count}} faces name vertices outside 0..{len(points) - 1}"
        self.found("index_out_of_range", text, np.flatnonzero(outside))
        broken = np.asarray(~np.isfinite(points).all(axis=1))
        self.found("non_finite", "{count} vertices have a NaN or inf coordinate", np.flatnonzero(broken))
        kept = np.flatnonzero(~outside)
        mesh = CheckedMesh(points, corners[kept].astype(np.int32), identity, kept.astype(np.int32), identity)
        if not broken.any():
            return mesh
        return mesh.without_faces(np.asarray(broken[mesh.faces].any(axis=1))).without_vertices(broken)

    def duplicate_vertices(self, mesh: CheckedMesh) -> CheckedMesh:
        # Merging is an offer, not a duty: two walls may touch without being joined.
        if "duplicate_vertices" not in self.repair:
            return mesh
        _, first, merged = np.unique(mesh.vertices, axis=0, return_index=True, return_inverse=True)
        target = first[merged.ravel()].astype(np.int32)
        moved = target != np.arange(len(target))
        self.found("duplicate_vertices", "{count} vertices repeat a position", mesh.vertex_source[moved])
        given = np.where(mesh.input_to_vertex >= 0, target[mesh.input_to_vertex], -1).astype(np.int32)
        return replace(mesh, faces=target[mesh.faces], input_to_vertex=given).without_vertices(moved)

    def zero_area(self, mesh: CheckedMesh) -> CheckedMesh:
        flat = faces_without_area(mesh.vertices, mesh.faces, ZERO_AREA_TOLERANCE)
        self.found("zero_area", "{count} faces have no area", mesh.face_source[flat])
        return mesh.without_faces(flat) if flat.any() else mesh

    def edges(self, mesh: CheckedMesh) -> CheckedMesh:
        repeated = repeated_faces(mesh.faces, *self.incidence(mesh))
        self.found("duplicate_faces", "{count} faces have the corners of an earlier face", mesh.face_source[repeated])
        mesh = mesh.without_faces(repeated) if repeated.any() else mesh
        surplus = surplus_faces(mesh.faces, *self.incidence(mesh))
        self.found("non_manifold", "{count} faces are the third or later at an edge", mesh.face_source[surplus])
        return mesh.without_faces(surplus) if surplus.any() else mesh

    def winding(self, mesh: CheckedMesh) -> CheckedMesh:
        across = faces_across_edges(mesh.faces, *self.incidence(mesh))
        areas = face_area_vectors(mesh.vertices, mesh.faces)
        flips, contradictions = winding_flips(mesh.faces, across, areas[:, 3])
        text = "{count} faces are wound against their neighbours"
        if contradictions:
            text += f", and {contradictions} edges of a one-sided surface cannot agree"
        self.found("flipped_winding", text, mesh.face_source[flips])
        if flips.any():
            mesh = replace(mesh, faces=np.where(flips[:, None], mesh.faces[:, ::-1], mesh.faces))
        upward = float(np.where(flips, -areas[:, 2], areas[:, 2]).sum())
        if upward >= -FACING_DOWN_SHARE * float(areas[:, 3].sum()):
            return mesh
        self.found("facing_down", "the mesh as a whole ({count} faces) faces down", mesh.face_source)
        return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]))

    def components(self, mesh: CheckedMesh) -> CheckedMesh:
        used = np.zeros(len(mesh.vertices), dtype=np.bool_)
        used[mesh.faces] = True
        labels = component_labels(mesh.faces, len(mesh.vertices))
        names, first, sizes = np.unique(labels[used], return_index=True, return_counts=True)
        if len(names) < 2:
            return mesh
        text = f"{{count}} components, the largest with {sizes.max()} of {sizes.sum()} vertices"
        self.found("components", text, mesh.vertex_source[np.flatnonzero(used)[first]])
        if "small_components" not in self.repair:
            return mesh
        small = used & (labels != names[np.argmax(sizes)])
        self.found("small_components", "{count} vertices belong to smaller components", mesh.vertex_source[small])
        return mesh.without_faces(small[mesh.faces[:, 0]]).without_vertices(small)

    def unreferenced(self, mesh: CheckedMesh) -> CheckedMesh:
        unused = np.ones(len(mesh.vertices), dtype=np.bool_)
        unused[mesh.faces] = False
        self.found("unreferenced", "{count} vertices belong to no face", mesh.vertex_source[unused])
        return mesh.without_vertices(unused) if unused.any() and "unreferenced" in self.repair else mesh


def component_labels(faces: IntArray, vertex_count: int) -> IntArray:
    """Number of the component of every vertex (V,); vertices without a face are components of their own."""
    first, second = faces[:, :2].ravel(), faces[:, 1:].ravel()
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(vertex_count, vertex_count))
    labels: IntArray = connected_components(graph, directed=False)[1]
    return labels
