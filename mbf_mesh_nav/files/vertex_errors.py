"""The standard errors of the heights of a built map at each vertex, kept as properties of its vertices.

A map of ``mbf map build`` is a binary PLY whose vertices have x, y, z, ``height_error`` and ``place_error`` [m]. The
first is of the vertex, the second of places on the faces around it, where a wheel stands. Readers of meshes pass over
properties that they do not know. Maps of earlier versions have no ``place_error``; then that of the vertex counts. Maps
of still earlier versions, and those that another program has written again, have none; then the one number of the
header counts (``files.map_header``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.files.map_header import MAX_HEADER_BYTES
from mbf_mesh_nav.mesh.mesh_report import MeshError

VERTEX = np.dtype([("position", "<f8", (3,)), ("height_error", "<f4"), ("place_error", "<f4")])
EARLIER_VERTEX = np.dtype([("position", "<f8", (3,)), ("height_error", "<f4")])
COORDINATES = ["property double x", "property double y", "property double z"]
HEIGHT_ERROR, PLACE_ERROR = "property float height_error", "property float place_error"
FORMAT = "format binary_little_endian 1.0"
UNKNOWN = -1.0


class VertexErrors(NamedTuple):
    """Standard errors (V,) [m] of the heights of the vertices, and of places on the faces around them."""

    of_vertices: FloatArray
    of_places: FloatArray

    def of(self, numbers: NDArray[np.integer[Any]]) -> VertexErrors:
        """Those of some vertices."""
        return VertexErrors(self.of_vertices[numbers], self.of_places[numbers])


def vertex_records(vertices: FloatArray, errors: VertexErrors | None) -> bytes:
    """Bytes of the vertices (V, 3) [m] and, if they are known, their errors."""
    if errors is None:
        return np.ascontiguousarray(vertices, dtype="<f8").tobytes()
    records = np.empty(len(vertices), dtype=VERTEX)
    records["position"], records["height_error"], records["place_error"] = vertices, *errors
    return records.tobytes()


def read_vertex_errors(path: Path) -> VertexErrors | None:
    """Errors of the vertices of a map file in the file's order; None if it does not state them.

    Raises
    ------
    MeshError
        They are no errors, or the file is cut off.
    """
    if path.suffix.lower() != ".ply" or not path.is_file():
        return None
    with path.open("rb") as file:
        header, end, _ = file.read(MAX_HEADER_BYTES).partition(b"end_header\n")
        lines = [line for line in header.decode("ascii", "replace").splitlines() if not line.startswith("comment")]
        if (
            not end
            or lines[:2] != ["ply", FORMAT]
            or lines[3:7] != [*COORDINATES, HEIGHT_ERROR]
            or lines[7 + (lines[7] == PLACE_ERROR)].startswith("property")
        ):
            return None
        vertex = VERTEX if lines[7] == PLACE_ERROR else EARLIER_VERTEX
        count = int(lines[2].split()[2])
        file.seek(len(header) + len(end))
        content = file.read(count * vertex.itemsize)
    if len(content) < count * vertex.itemsize:
        raise MeshError(str(path), [f"the file is cut off within its {count} vertices"])
    records = np.frombuffer(content, dtype=vertex)
    for name in (vertex.names or ())[1:]:
        if not (np.isfinite(records[name]) & (records[name] >= 0.0)).all():
            raise MeshError(str(path), [f"{name} of its vertices: expected finite numbers of at least 0"])
    of_vertices, of_places = (records[name].astype(np.float64) for name in ("height_error", (vertex.names or ())[-1]))
    return VertexErrors(of_vertices, of_places)


def errors_on_mesh(errors: VertexErrors, source: IntArray, faces: IntArray) -> VertexErrors:
    """Errors of the vertices of a mesh, of those of the file that they come from.

    A vertex that densifying or a repair has added lies between others: it has the greatest errors of its neighbours.

    Parameters
    ----------
    errors : VertexErrors
        Of the vertices of the file (V_input,).
    source, faces : (V,), (F, 3) int32
        The vertex of the file that each one is, -1 = added; the corners.
    """
    return VertexErrors(*(_carried_over(each, source, faces) for each in errors))


def _carried_over(errors: FloatArray, source: IntArray, faces: IntArray) -> FloatArray:
    known = np.where(source >= 0, errors[source], UNKNOWN)
    starts, ends = faces[:, [0, 1, 2, 1, 2, 0]].ravel(), faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    while (missing := known == UNKNOWN).any():
        wanted = missing[starts]
        filled = known.copy()
        np.maximum.at(filled, starts[wanted], known[ends[wanted]])
        if (filled == known).all():
            return np.maximum(known, 0.0)
        known = filled
    return known
