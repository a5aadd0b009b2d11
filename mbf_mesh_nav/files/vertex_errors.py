"""The standard error of the height of each vertex, kept as a property of the vertices of a built map.

A map of ``mbf map build`` is a binary PLY whose vertices have x, y, z and ``height_error`` [m]. Readers of meshes pass
over properties that they do not know. Maps of earlier versions, and those that another program has written again, have
none; then the one number of the header counts (``files.map_header``).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.files.map_header import MAX_HEADER_BYTES
from mbf_mesh_nav.mesh.mesh_report import MeshError

VERTEX = np.dtype([("position", "<f8", (3,)), ("height_error", "<f4")])
COORDINATES = ["property double x", "property double y", "property double z"]
HEIGHT_ERROR = "property float height_error"
FORMAT = "format binary_little_endian 1.0"
UNKNOWN = -1.0


def vertex_records(vertices: FloatArray, errors: FloatArray | None) -> bytes:
    """Bytes of the vertices (V, 3) [m] and, if they are known, their errors (V,) [m]."""
    if errors is None:
        return np.ascontiguousarray(vertices, dtype="<f8").tobytes()
    records = np.empty(len(vertices), dtype=VERTEX)
    records["position"], records["height_error"] = vertices, errors
    return records.tobytes()


def read_vertex_errors(path: Path) -> FloatArray | None:
    """Errors (V,) [m] of the vertices of a map file in the file's order; None if it does not state them.

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
            or lines[7].startswith("property")
        ):
            return None
        count = int(lines[2].split()[2])
        file.seek(len(header) + len(end))
        content = file.read(count * VERTEX.itemsize)
    if len(content) < count * VERTEX.itemsize:
        raise MeshError(str(path), [f"the file is cut off within its {count} vertices"])
    errors = np.frombuffer(content, dtype=VERTEX)["height_error"].astype(np.float64)
    if not (np.isfinite(errors) & (errors >= 0.0)).all():
        raise MeshError(str(path), ["height_error of its vertices: expected finite numbers of at least 0"])
    return errors


def errors_on_mesh(errors: FloatArray, source: IntArray, faces: IntArray) -> FloatArray:
    """Errors (V,) [m] of the vertices of a mesh, of those of the file that they come from.

    A vertex that densifying or a repair has added lies between others: it has the greatest error of its neighbours.

    Parameters
    ----------
    errors : (V_input,) float64
        Of the vertices of the file [m].
    source, faces : (V,), (F, 3) int32
        The vertex of the file that each one is, -1 = added; the corners.
    """
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
