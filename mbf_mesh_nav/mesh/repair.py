"""What is wrong with a mesh, and the repairs a configuration may allow.

A mesh with a defect is refused unless its name stands in the configuration's ``repair`` list; only faces wound against
their neighbours are flipped without being listed, if all can agree. The report lists what was found and done, with
counts and indices in the caller's numbering. The caller's arrays and files are never changed.

``REPAIRS`` maps each defect that can be repaired to what the repair does. Harmless findings (unreferenced vertices,
vertices of holes, several components, one that faces down, groups of faces that touch in a point) never refuse a mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import FARTHEST_COORDINATE
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.defects import (
    face_shapes,
    faces_without_area,
    fans_at_vertices,
    superfluous_faces,
    winding_flips,
)
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices
from mbf_mesh_nav.kernels.mesh.topology import faces_across_edges
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh, shaped_arrays
from mbf_mesh_nav.mesh.mesh_report import Finding, MeshError, MeshReport
from mbf_mesh_nav.mesh.slivers import without_slivers
from mbf_mesh_nav.mesh.topology import group_of_each
from mbf_mesh_nav.mesh.welding import join_boundaries, rounding_distance, same_position

REPAIRS: dict[str, str] = {
    "non_finite": "drop vertices with NaN, inf or coordinates beyond 1e9 m, and their faces",
    "index_out_of_range": "drop faces that name a vertex that does not exist",
    "duplicate_vertices": "merge vertices at the same position, at the boundaries of parts also those nearly there",
    "zero_area": "flip faces without area away and join their neighbours; drop those that cannot be",
    "duplicate_faces": "drop faces with the same corners as an earlier one",
    "non_manifold": "drop the third and further faces at an edge, in index order",
    "flipped_winding": "turn faces round whose neighbours are wound the other way, also where not all can agree",
    "facing_down": "turn every component round that faces down",
    "non_manifold_vertices": "give each of the groups of faces that touch in a point a vertex of its own",
    "unreferenced": "drop vertices without a face",
    "small_components": "keep only the component with the most vertices",
}
ZERO_AREA_TOLERANCE = 1e-10
"""Doubled area over the longest edge squared; relative, so that millimetres and kilometres are treated alike."""
FACING_DOWN_SHARE = 0.05
"""A component faces down if its faces' summed area vector points down by more than this share of the area."""
UPSIDE_DOWN_SHARE = 0.5
"""A mesh is refused if components with more than this share of its area face down; fewer may well be ceilings."""


def checked_mesh(
    vertices: ArrayLike, faces: ArrayLike, repair: Sequence[str] = (), file: str = "arrays", join_distance: float = 0.0
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
    join_distance : float
        How far apart [m] vertices at the boundaries of parts may be for the repair ``duplicate_vertices`` to join them;
        0 = a millionth of the mesh's extent.

    Raises
    ------
    MeshError
        Unknown repair, wrong shape, no usable face, or a defect outside ``repair``.
    """
    if unknown := [name for name in repair if name not in REPAIRS]:
        raise MeshError(file, [f"unknown repair '{name}', the repairs are: {', '.join(REPAIRS)}" for name in unknown])
    points, corners = shaped_arrays(vertices, faces, file)
    check = _Check(repair, join_distance)
    mesh = check.indices(points, corners)
    mesh = check.duplicate_vertices(mesh)
    mesh = check.zero_area(mesh)
    mesh = check.edges(mesh)
    mesh = check.winding(mesh)
    mesh = check.non_manifold_vertices(mesh)
    mesh = check.components(mesh)
    mesh = check.unreferenced(mesh)
    reasons = [str(finding) for finding in check.report.refusals]
    if len(mesh.faces) == 0:
        reasons.append("no face is left")
    if reasons:
        raise MeshError(file, reasons, _repair_hint(check.report, repair) if len(mesh.faces) else "")
    return mesh, check.report


def _repair_hint(report: MeshReport, repair: Sequence[str]) -> str:
    """How to allow the repairs that a refused mesh needs."""
    listed = ", ".join(dict.fromkeys([*repair, *(finding.name for finding in report.refusals)]))
    return f"To have it repaired when it is loaded, configure mesh_map: {{repair: [{listed}]}}"


class _Check:
    """The single checks; each reports its defect and returns the mesh without it."""

    def __init__(self, repair: Sequence[str], join_distance: float) -> None:
        self.repair = frozenset(repair)
        self.join_distance = join_distance
        self.report = MeshReport()
        self._faces: IntArray | None = None

    def neighbours(self, mesh: CheckedMesh) -> tuple[IntArray, IntArray, IntArray]:
        """Faces of every vertex as CSR, and the faces across edges (F, 3); computed once per face list."""
        if mesh.faces is not self._faces:
            offsets, incident = faces_of_vertices(mesh.faces, len(mesh.vertices))
            self._neighbours = offsets, incident, faces_across_edges(mesh.faces, offsets, incident)
            self._faces = mesh.faces
        return self._neighbours

    def found(
        self, name: str, text: str, indices: NDArray[np.integer], harmless: bool = False, always_repaired: bool = False
    ) -> None:
        if len(indices):
            text = text.format(count=len(indices))
            repaired = always_repaired or name in self.repair
            self.report.findings.append(Finding(name, text, indices.astype(np.int64), repaired, harmless))

    def indices(self, points: FloatArray, corners: NDArray[np.int64]) -> CheckedMesh:
        identity = np.arange(len(points), dtype=np.int32)
        outside = ((corners < 0) | (corners >= len(points))).any(axis=1)
        text = f"{{count}} faces name vertices outside 0..{len(points) - 1}"
        self.found("index_out_of_range", text, np.flatnonzero(outside))
        kept = np.flatnonzero(~outside)
        mesh = CheckedMesh(points, corners[kept].astype(np.int32), identity, kept.astype(np.int32), identity)
        broken = np.asarray(~(np.abs(points) <= FARTHEST_COORDINATE).all(axis=1))  # not those with NaN either
        if not broken.any():
            return mesh
        used = mesh.used  # the others do no harm: a grid with voids has a vertex without a height for each of them
        text = "{count} vertices have a coordinate that is NaN, inf or beyond 1e+09 m"
        self.found("non_finite", text, np.flatnonzero(broken & used))
        text = "{count} vertices without a position belong to no face and are left out"
        self.found("holes", text, np.flatnonzero(broken & ~used), harmless=True)
        return mesh.without_faces(np.asarray(broken[mesh.faces].any(axis=1))).without_vertices(broken)

    def duplicate_vertices(self, mesh: CheckedMesh) -> CheckedMesh:
        # Merging is optional: two walls may touch without being joined.
        if "duplicate_vertices" not in self.repair:
            return mesh
        exact = same_position(mesh.vertices)
        moved = mesh.vertex_source[exact != np.arange(len(exact))]
        mesh = mesh.merged(exact)
        distance = self.join_distance or rounding_distance(mesh.vertices[mesh.used])
        target = join_boundaries(mesh.vertices, self.neighbours(mesh)[2], mesh.faces, distance)
        near = mesh.vertex_source[target != np.arange(len(target))]
        text = "{count} vertices repeat a position"
        if len(near):
            text += f", {len(near)} of them to within {distance:.2g} m"
            mesh = mesh.merged(target)
        self.found("duplicate_vertices", text, np.sort(np.concatenate([moved, near])))
        return mesh

    def zero_area(self, mesh: CheckedMesh) -> CheckedMesh:
        flat = faces_without_area(mesh.vertices, mesh.faces, ZERO_AREA_TOLERANCE)
        text, sources = "{count} faces have no area", mesh.face_source[flat]
        if flat.any() and "zero_area" in self.repair:
            mesh, cracks = without_slivers(mesh, ZERO_AREA_TOLERANCE)
            text += f"; at {cracks} of them the neighbours cannot be joined, a crack is left" if cracks else ""
        self.found("zero_area", text, sources)
        return mesh if "zero_area" in self.repair else mesh.without_faces(flat)

    def edges(self, mesh: CheckedMesh) -> CheckedMesh:
        repeated, surplus = superfluous_faces(mesh.faces, *self.neighbours(mesh)[:2])
        self.found("duplicate_faces", "{count} faces have the corners of an earlier face", mesh.face_source[repeated])
        self.found("non_manifold", "{count} faces are the third or later at an edge", mesh.face_source[surplus])
        return mesh.without_faces(repeated | surplus)

    def winding(self, mesh: CheckedMesh) -> CheckedMesh:
        shapes = face_shapes(mesh.vertices, mesh.faces)
        flips, patches, contradictions = winding_flips(mesh.faces, self.neighbours(mesh)[2], shapes[:, 3])
        text = "{count} faces are wound against their neighbours"
        if contradictions:
            text += f", and {contradictions} edges of a one-sided surface cannot agree"
        # Where all neighbours can agree, only one answer makes sense; a one-sided surface has none.
        self.found("flipped_winding", text, mesh.face_source[flips], always_repaired=not contradictions)
        if flips.any():
            mesh = replace(mesh, faces=np.where(flips[:, None], mesh.faces[:, ::-1], mesh.faces))
        return self.facing_down(mesh, np.where(flips, -shapes[:, 2], shapes[:, 2]), shapes[:, 3], patches)

    def facing_down(self, mesh: CheckedMesh, upward: FloatArray, areas: FloatArray, patches: IntArray) -> CheckedMesh:
        sizes = np.bincount(patches, areas)
        down = np.bincount(patches, upward) < -FACING_DOWN_SHARE * sizes
        concerned = down[patches]
        text = f"{{count}} faces face down, those of {int(down.sum())} of {len(sizes)} components"
        harmless = bool(sizes[down].sum() <= UPSIDE_DOWN_SHARE * sizes.sum())
        self.found("facing_down", text, mesh.face_source[concerned], harmless)
        if not down.any() or "facing_down" not in self.repair:
            return mesh
        return replace(mesh, faces=np.where(concerned[:, None], mesh.faces[:, ::-1], mesh.faces))

    def non_manifold_vertices(self, mesh: CheckedMesh) -> CheckedMesh:
        offsets, incident, across = self.neighbours(mesh)
        fans, counts = fans_at_vertices(mesh.faces, across, offsets, incident)
        several = counts > 1
        text = "{count} vertices join groups of faces that touch at this point only"
        self.found("non_manifold_vertices", text, mesh.vertex_source[several], harmless=True)
        if not several.any() or "non_manifold_vertices" not in self.repair:
            return mesh
        entries = np.flatnonzero(fans > 0)
        vertex = np.repeat(np.arange(len(counts), dtype=np.int32), np.diff(offsets))[entries]
        copies_before = np.cumsum(np.maximum(counts - 1, 0)) - np.maximum(counts - 1, 0)
        faces = mesh.faces.copy()
        face, corner = np.nonzero(mesh.faces[incident[entries]] == vertex[:, None])
        faces[incident[entries][face], corner] = len(counts) + (copies_before[vertex] + fans[entries] - 1)[face]
        return mesh.with_copies(np.repeat(np.arange(len(counts)), np.maximum(counts - 1, 0)), faces)

    def components(self, mesh: CheckedMesh) -> CheckedMesh:
        used = mesh.used
        labels = group_of_each(mesh.faces[:, (0, 1, 1, 2)].reshape(-1, 2), len(mesh.vertices))
        names, first, sizes = np.unique(labels[used], return_index=True, return_counts=True)
        if len(names) < 2:
            return mesh
        text = f"{{count}} components, the largest with {sizes.max()} of {sizes.sum()} vertices"
        if "duplicate_vertices" not in self.repair:
            elsewhere = labels != labels[same_position(np.where(used[:, None], mesh.vertices, np.nan))]
            text += f"; {elsewhere.sum()} vertices lie on one of another component" if elsewhere.any() else ""
        numbers = _numbers(mesh)
        self.found("components", text, numbers[np.flatnonzero(used)[first]], harmless=True)
        if "small_components" not in self.repair:
            return mesh
        small = used & (labels != names[np.argmax(sizes)])
        self.found("small_components", "{count} vertices belong to smaller components", numbers[small])
        return mesh.without_faces(small[mesh.faces[:, 0]]).without_vertices(small)

    def unreferenced(self, mesh: CheckedMesh) -> CheckedMesh:
        unused = ~mesh.used
        self.found("unreferenced", "{count} vertices belong to no face", mesh.vertex_source[unused], harmless=True)
        return mesh.without_vertices(unused) if unused.any() and "unreferenced" in self.repair else mesh


def _numbers(mesh: CheckedMesh) -> IntArray:
    """The caller's number of every vertex (V,), that of the original where a repair made a copy."""
    numbers = mesh.vertex_source
    return numbers if (numbers >= 0).all() else numbers[same_position(mesh.vertices)]
