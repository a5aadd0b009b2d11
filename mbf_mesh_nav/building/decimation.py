"""A surface with fewer vertices, no farther from the whole one than a bound, which is measured afterwards.

When to use: maps of gentle ground that are to take less memory. When not: rough ground at a robot's limits, of which
each bump counts. ``fast-simplification`` (Garland and Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997) collapses edges to a number of faces and knows no bound, so the number is found by bisection: the fewest
faces of which no measured place breaks the bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.files.vertex_errors import VertexErrors
from mbf_mesh_nav.kernels.mesh.topology import unit_face_normals
from mbf_mesh_nav.mesh.locate import SurfaceLocator
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.repair import REPAIRS, checked_mesh
from mbf_mesh_nav.mesh.topology import build_topology

LEAST_SHARE = 0.02
"""Of the faces; fewer are not tried."""
BISECTIONS = 7
SKIRT, UPWARD = 1.0, 0.2
"""Height of a skirt [m]; least z of the unit normals of faces that are ground and not of a skirt."""
ALLOWED = [name for name in REPAIRS if name != "small_components"]


@dataclass(frozen=True, eq=False)
class DecimatedMesh:
    """A mesh and how far it is from the one it was made of.

    Attributes
    ----------
    vertices : (V, 3) float64
        [m]
    faces : (F, 3) int32
    error_max, error_rms : float
        Distances between both surfaces [m], measured at the corners, the edges' middles and the middles of the faces of
        either; both 0 where nothing was left out.
    """

    vertices: FloatArray
    faces: IntArray
    error_max: float = 0.0
    error_rms: float = 0.0


def decimated(vertices: FloatArray, faces: IntArray, bound: float) -> DecimatedMesh:
    """Leave out as many faces as a bound on the distance [m] of both surfaces allows; none where it allows none.

    Holes of the mesh, which are obstacles, and its outer boundary are kept within the bound, too: places of the coarse
    surface are measured against the whole one.

    Raises
    ------
    MeshError
        ``fast-simplification`` is not installed.
    """
    whole = _locator(vertices, faces)
    best, kept, broken = DecimatedMesh(vertices, faces), 1.0, LEAST_SHARE
    for _ in range(BISECTIONS):
        share = 0.5 * (kept + broken)
        coarse = _of_share(vertices, faces, whole, share)
        if coarse is not None and coarse.error_max <= bound:
            best, kept = coarse, share
        else:
            broken = share
    return best


def decimated_to(vertices: FloatArray, faces: IntArray, share: float) -> DecimatedMesh:
    """Leave out all but a share of the faces, whatever the distance of both surfaces is then; it is measured.

    Raises
    ------
    MeshError
        ``fast-simplification`` is not installed, or so few faces do not form a sound mesh.
    """
    coarse = _of_share(vertices, faces, _locator(vertices, faces), share)
    if coarse is None:
        raise MeshError("mesh", [f"{share:.1%} of its {len(faces)} faces do not form a sound mesh"])
    return coarse


def carried_errors(mesh: DecimatedMesh, vertices: FloatArray, faces: IntArray, errors: VertexErrors) -> VertexErrors:
    """Standard errors of a decimated mesh, of those of the vertices (n, 3) and faces (m, 3) of the whole one.

    A vertex has the mean square of what lies on the faces around it, by the weights of the places there: the error of
    the whole surface, and its distance from the faces. Those of places are taken at the middles of the whole one's
    edges: what its vertices have of noise and the fewer faces have not is half as large there, as everywhere between
    the vertices.
    """
    if mesh.error_max == 0.0:
        return errors
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    squares = errors.of_places * errors.of_places
    middles = 0.5 * (vertices[starts] + vertices[ends])
    return VertexErrors(
        _carried(mesh, vertices, errors.of_vertices * errors.of_vertices),
        _carried(mesh, middles, 0.5 * (squares[starts] + squares[ends])),
    )


def _carried(mesh: DecimatedMesh, places: FloatArray, squares: FloatArray) -> FloatArray:
    """Roots (V,) [m] of the mean squares around the vertices, of those of places (n, 3) of the whole surface [m2]."""
    topology = build_topology(checked_mesh(mesh.vertices, mesh.faces, ALLOWED)[0])
    found = SurfaceLocator(topology).locate(places)
    corners = topology.internal_to_input[topology.faces[found.faces]].ravel()
    squares = squares + found.distances * found.distances
    count, weights = len(mesh.vertices), found.barycentric
    sums = np.bincount(corners, (weights * squares[:, None]).ravel(), count)
    totals = np.bincount(corners, weights.ravel(), count)
    usual = squares.mean()  # of a corner that no place is near to
    return np.asarray(np.sqrt(np.where(totals > 0.0, sums / np.maximum(totals, 1e-300), usual)))


def require_simplification() -> None:
    """Raise MeshError unless ``fast-simplification`` is installed."""
    if find_spec("fast_simplification") is None:
        raise MeshError("--decimate", ["needs fast-simplification: pip install 'mbf-flex[maps]'"])


def _locator(vertices: FloatArray, faces: IntArray) -> SurfaceLocator:
    return SurfaceLocator(build_topology(checked_mesh(vertices, faces)[0]))


def _of_share(vertices: FloatArray, faces: IntArray, whole: SurfaceLocator, share: float) -> DecimatedMesh | None:
    """The mesh with this share of its faces; None where that leaves no sound mesh."""
    require_simplification()
    import fast_simplification

    points, corners = fast_simplification.simplify(*_with_skirts(vertices, faces), target_reduction=1.0 - share)
    corners = corners[unit_face_normals(points, corners.astype(np.int32))[:, 2] > UPWARD]
    try:
        mesh, _ = checked_mesh(points, corners, ALLOWED)
    except MeshError:
        return None
    coarse = SurfaceLocator(build_topology(mesh))
    distances = np.concatenate(
        [coarse.locate(_places(vertices, faces)).distances, whole.locate(_places(mesh.vertices, mesh.faces)).distances]
    )
    rms = float(np.sqrt((distances * distances).mean()))
    return DecimatedMesh(mesh.vertices, mesh.faces, float(distances.max()), rms)


def _with_skirts(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The mesh with vertical faces below its borders, against which moving a border costs as much as bending a face."""
    starts, ends = (np.concatenate([faces[:, (side + step) % 3] for side in range(3)]) for step in range(2))
    keys = np.minimum(starts, ends).astype(np.int64) * len(vertices) + np.maximum(starts, ends)
    _, edge, counts = np.unique(keys, return_inverse=True, return_counts=True)
    is_border = counts[edge] == 1
    starts, ends = starts[is_border], ends[is_border]
    upper, lower = np.unique(starts), np.zeros(len(vertices), dtype=np.int32)
    lower[upper] = len(vertices) + np.arange(len(upper))
    below = vertices[upper] - np.array([0.0, 0.0, SKIRT])
    skirts = [np.column_stack([ends, starts, lower[starts]]), np.column_stack([ends, lower[starts], lower[ends]])]
    return np.concatenate([vertices, below]), np.concatenate([faces, *skirts]).astype(np.int32)


def _places(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Corners, middles of edges and middles of faces (n, 3)."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    middles = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a), (a + b + c) / 3.0]
    return np.concatenate([vertices, *middles])
