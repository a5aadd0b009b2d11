"""Files as sources of tiles: heights as ``.npy``, elevation models, and every mesh that can be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mbf_mesh_nav.files.elevation_files import ElevationReader, elevation_readers
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.files.vertex_errors import errors_on_mesh, read_vertex_errors
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.densify import densify
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.repair import checked_mesh
from mbf_mesh_nav.tiles.building.sources import HeightSource, MeshSource, TileSource, open_heights

MAX_HEIGHTS = 2**31 - 1
"""Heights of one file."""


def open_source(path: Path, parameters: MeshMapParameters, spacing: float = 0.0) -> TileSource:
    """Open a file to cut tiles from.

    Heights as ``.npy`` are read window by window and never as a whole. Elevation models and meshes are in memory while
    their tiles are built; meshes are checked, repaired and densified as ``mesh_map`` says.

    Parameters
    ----------
    spacing : float
        Of the samples of a ``.npy`` file [m]; 0 for all others, which know it.

    Raises
    ------
    MeshError
        The file cannot be used, a spacing is missing or not wanted, or heights are to be densified.
    """
    ending = path.suffix.lower()
    if (ending == ".npy") != (spacing > 0.0):
        wanted = "needs a spacing (--spacing)" if ending == ".npy" else f"states its own spacing, got {spacing:g} m"
        raise MeshError(str(path), [wanted])
    if (ending == ".npy" or ending in elevation_readers()) and parameters.densify > 0.0:
        text = f"heights keep their grid in tiles: expected a mesh_map with densify 0, got {parameters.densify:g} m"
        raise MeshError(str(path), [text])
    if ending == ".npy":
        return HeightSource(open_heights(path, MAX_HEIGHTS), spacing, spacing)
    if ending in (readers := elevation_readers()):
        if not path.is_file():
            raise MeshError(str(path), ["there is no such file"])
        try:
            read: ElevationReader = readers[ending].load()
            heights, dx, dy = read(path, MAX_HEIGHTS)
            return HeightSource(np.asarray(heights, dtype=np.float32), dx, dy)
        except Exception as error:  # whatever the reader of another package raises
            reason = str(error).removeprefix(f"{path}: ").removeprefix("cannot be read: ")
            raise MeshError(str(path), [f"cannot be read as an elevation model: {reason}"]) from error
    part, up_axis, unit = parameters.mesh_part, parameters.up_axis, parameters.unit
    vertices, faces = read_mesh(path, part, parameters.max_faces, up_axis=up_axis, unit=unit)
    repair = parameters.repairs_for(str(path))
    mesh, _ = checked_mesh(vertices, faces, repair, str(path), parameters.join_distance)
    if parameters.densify > 0.0:
        mesh = densify(mesh, parameters.densify, file=str(path))
    if (errors := read_vertex_errors(path)) is not None:
        errors = errors_on_mesh(errors, mesh.vertex_source, mesh.faces)
    return MeshSource(mesh.vertices, mesh.faces, errors)
