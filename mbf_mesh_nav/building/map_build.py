"""From files of points to a map file, in one call.

    facts, surface = build_map([Path("scan.las")], Path("map.ply"))

The map is a binary PLY that every reader of meshes reads. Comments in its header keep what a mesh has no place for: the
origin in the coordinates of the survey, and the error of the surface (``files.map_header``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mbf_abstract.whole_files import replacing
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.building.clouds.point_cloud import MAX_POINTS, PointCloud, read_clouds
from mbf_mesh_nav.building.decimation import DecimatedMesh, carried_errors, decimated, require_simplification
from mbf_mesh_nav.building.map_facts import MapFacts, map_facts
from mbf_mesh_nav.building.surface import BuiltSurface, SurfaceParameters, build_surface
from mbf_mesh_nav.files.map_header import MapHeader, header_comments
from mbf_mesh_nav.files.vertex_errors import (
    COORDINATES,
    FORMAT,
    HEIGHT_ERROR,
    PLACE_ERROR,
    VertexErrors,
    vertex_records,
)
from mbf_mesh_nav.mesh.mesh_report import MeshError

FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])


def build_map(
    files: Sequence[Path],
    out: Path,
    parameters: SurfaceParameters | None = None,
    *,
    up_axis: str = "",
    unit: float = 0.0,
    crs: str = "",
    max_points: int = MAX_POINTS,
    drop_invalid: bool = False,
    on_step: Callable[[str], None] = lambda text: None,
) -> tuple[MapFacts, BuiltSurface, PointCloud]:
    """Read point clouds, build the surface under them and write it as a map; the same files give the same bytes.

    Parameters
    ----------
    files : sequence of path
        Point clouds, or meshes to sample, all in one coordinate system; see ``clouds.point_cloud``.
    out : path
        A .ply file. It is replaced when the map is complete; until then, and if anything fails, it stays what it was.
    up_axis, unit, crs, max_points, drop_invalid
        As in ``read_clouds``.
    on_step : callable, optional
        Called with a text before each step. What it raises ends the building.

    Raises
    ------
    MeshError
        A file cannot be used, there is no surface in them, or ``out`` cannot be written.
    """
    if out.suffix.lower() != ".ply":
        raise MeshError(str(out), [f"a map is written as .ply, not as '{out.suffix}'"])
    if not out.parent.is_dir():
        raise MeshError(str(out), ["there is no such folder"])
    if any(file.exists() and out.exists() and file.samefile(out) for file in files):
        raise MeshError(str(out), ["is one of the inputs, which are never changed"])
    parameters = parameters or SurfaceParameters()
    is_decimated = parameters.decimation_bound > 0.0
    if is_decimated:
        require_simplification()
    cloud = read_clouds(
        files,
        up_axis=up_axis,
        unit=unit,
        crs=crs,
        max_points=max_points,
        drop_invalid=drop_invalid,
        clearance=parameters.clearance,
        on_file=lambda file: on_step(f"reading {file.name}"),
    )
    try:
        surface = build_surface(cloud.points, parameters, on_step)
    except MeshError as error:
        raise MeshError(", ".join(map(str, files)), error.reasons, error.hint) from error
    facts, errors = map_facts(cloud, surface), VertexErrors(surface.height_errors, surface.place_errors)
    mesh = DecimatedMesh(surface.vertices, surface.faces)
    if is_decimated:
        on_step("decimation")
        mesh = decimated(surface.vertices, surface.faces, parameters.decimation_bound)
        errors = carried_errors(mesh, surface.vertices, surface.faces, errors)
        facts = facts.of_decimated(mesh, errors.of_vertices)
    on_step(f"writing {out.name}")
    write_map(
        out,
        mesh.vertices,
        mesh.faces,
        MapHeader(cloud.origin, facts.error_rms, facts.error_95, facts.height_error, facts.crs),
        errors,
    )
    return facts, surface, cloud


def write_map(
    out: Path, vertices: FloatArray, faces: IntArray, header: MapHeader, errors: VertexErrors | None = None
) -> None:
    """Write a mesh as a binary PLY of eight-byte coordinates; a file of that name is replaced when it is complete.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (F, 3) int32
    errors : VertexErrors, optional
        Standard errors of the heights; None = the header's holds for all.

    Raises
    ------
    MeshError
        It cannot be written.
    """
    lines = ["ply", FORMAT, *header_comments(header), f"element vertex {len(vertices)}"]
    lines += COORDINATES if errors is None else [*COORDINATES, HEIGHT_ERROR, PLACE_ERROR]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    records = np.empty(len(faces), dtype=FACE)
    records["count"], records["corners"] = 3, faces
    try:
        with replacing(out) as unfinished, unfinished.open("wb") as file:
            file.write("\n".join(lines).encode("ascii"))
            file.write(vertex_records(vertices, errors))
            file.write(records.tobytes())
    except OSError as error:
        raise MeshError(str(out), [f"cannot be written: {error.strerror or error}"]) from error
