"""The HDF5 files of lvr2 and mesh_navigation: meshes read from both layouts, maps written in both.

``mesh_io``, the present one: ``<part>/geometry/vertices`` (V, 3) float32 and ``<part>/geometry/face_indices`` (F, 3)
uint32, per-vertex attributes such as layer costs below ``<part>/vertex_attributes``. ``channels``, of lvr2 before
December 2024: all of these in ``<part>/channels``. Write the old one only for a program that reads no other.

Unlike mesh_navigation we never write into the input and never take a stored layer for a computed one: a stored layer
does not say which parameters made it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mbf_abstract.whole_files import replacing
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.mesh_report import MeshError

LAYOUTS: dict[str, tuple[str, str]] = {
    "mesh_io": ("geometry", "vertex_attributes"),
    "channels": ("channels", "channels"),
}
"""Groups below a part that hold its geometry and its per-vertex attributes."""
GEOMETRY_CHANNELS = {"vertices": "fiu", "face_indices": "iu"}
"""Channels of the geometry and the kinds of numbers they may hold."""


def read_lvr2_mesh(path: Path, part: str, max_faces: int) -> tuple[FloatArray, NDArray[np.int64]]:
    """Read vertices (V, 3) and faces (F, 3) of a part; "" takes the only mesh of the file.

    Raises
    ------
    MeshError
        Not an HDF5 file, no or several meshes, a missing or misshapen channel, or more faces than ``max_faces``.
    """
    with _opened(path) as file:
        geometry = _geometry(file, path, part.strip("/"))
        faces, vertices = geometry["face_indices"], geometry["vertices"]
        if faces.shape[0] > max_faces:
            raise MeshError(str(path), [f"{faces.shape[0]} faces, the limit is {max_faces} (max_faces)"])
        if vertices.shape[0] > 3 * max_faces:
            raise MeshError(str(path), [f"{vertices.shape[0]} vertices, the limit is {3 * max_faces} (3 max_faces)"])
        return vertices[()].astype(np.float64), faces[()].astype(np.int64)


def write_lvr2_mesh(
    path: Path,
    vertices: FloatArray,
    faces: NDArray[Any],
    vertex_attributes: Mapping[str, NDArray[Any]] | None = None,
    part: str = "mesh",
    layout: str = "mesh_io",
) -> None:
    """Write a mesh and per-vertex attributes; refuses to overwrite a file, and leaves none if it fails.

    Parameters
    ----------
    vertices : (V, 3) float
        Stored as float32, the layouts' type.
    faces : (F, 3) int
    vertex_attributes : mapping, optional
        Name -> (V,) or (V, n) numbers, e.g. layer costs.
    part : str
        Group of the mesh, with slashes for groups in groups.
    layout : str
        A name of ``LAYOUTS``.

    Raises
    ------
    MeshError
        The file exists or cannot be written, there is no such layout, or an attribute does not fit.
    """
    if path.exists():
        raise MeshError(str(path), ["the file exists; it is not overwritten"])
    attributes = dict(vertex_attributes or {})
    if reasons := _misfits(attributes, len(vertices), part, layout):
        raise MeshError(str(path), reasons)
    try:
        with replacing(path) as unfinished, h5py.File(unfinished, "w") as file:
            _fill(file.create_group(part), vertices, faces, attributes, LAYOUTS[layout])
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise MeshError(str(path), [f"cannot be written: {error}"]) from error


def _misfits(attributes: dict[str, NDArray[Any]], vertex_count: int, part: str, layout: str) -> list[str]:
    """Everything that is wrong with the arguments of a write."""
    reasons = [] if layout in LAYOUTS else [f"unknown layout '{layout}', the layouts are: {', '.join(LAYOUTS)}"]
    if not part.strip("/"):
        reasons.append("a mesh needs a part to be written to")
    for name, values in attributes.items():
        if np.shape(values)[:1] != (vertex_count,):
            reasons.append(f"attribute '{name}' has shape {np.shape(values)}, expected ({vertex_count}, ...)")
        if not name or "/" in name or name in GEOMETRY_CHANNELS:
            reasons.append(f"an attribute cannot be called '{name}'")
    return reasons


def _fill(
    group: Any, vertices: FloatArray, faces: NDArray[Any], attributes: dict[str, NDArray[Any]], layout: tuple[str, str]
) -> None:
    geometry, attribute_group = layout
    group.attrs["IO"] = "MeshIO"
    group.attrs["CLASS"] = "MeshBuffer"
    group[f"{geometry}/vertices"] = np.asarray(vertices, dtype=np.float32)
    group[f"{geometry}/face_indices"] = np.asarray(faces, dtype=np.uint32)
    for name, values in attributes.items():
        group[f"{attribute_group}/{name}"] = np.asarray(values, dtype=np.float32).reshape(len(vertices), -1)


def write_lvr2_map(path: Path, mesh_map: MeshMap, layout: str = "mesh_io") -> None:
    """Write a map with the costs of all its layers, in the caller's numbering as far as vertices come from the caller.

    Vertices that densifying or a repair added follow after them; merged and dropped ones are not in the file.
    Parameters and errors as in ``write_lvr2_mesh``.
    """
    if "vertex_normals" in mesh_map.layers:
        raise MeshError(str(path), ["a layer is called 'vertex_normals': the file has the normals under that name"])
    source = mesh_map.internal_to_input.astype(np.int64)
    order = np.argsort(np.where(source >= 0, source, np.iinfo(np.int64).max), kind="stable")
    position = np.argsort(order, kind="stable")
    attributes: dict[str, NDArray[Any]] = {name: layer.costs[order] for name, layer in mesh_map.layers.items()}
    attributes["vertex_normals"] = mesh_map.vertex_normals[order]
    write_lvr2_mesh(path, mesh_map.vertices[order], position[mesh_map.faces], attributes, layout=layout)


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """Open a file to read, and turn whatever the HDF5 library raises on damaged ones into a ``MeshError``."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except MeshError:
        raise
    except Exception as error:
        raise MeshError(str(path), [f"cannot be read as HDF5: {error}"]) from error


def _geometry(file: h5py.File, path: Path, part: str) -> Any:
    """Group with the channels ``vertices`` and ``face_indices`` of a part, whichever layout."""
    found: dict[str, Any] = {}
    groups = {geometry for geometry, _ in LAYOUTS.values()}

    def visit(name: str, item: Any) -> None:
        above, _, last = name.rpartition("/")
        if last in groups and isinstance(item, h5py.Group) and all(channel in item for channel in GEOMETRY_CHANNELS):
            found[above] = item

    file.visititems(visit)
    chosen = [part] if part else list(found)
    if len(chosen) != 1 or chosen[0] not in found:
        wanted = f"no mesh '{part}'." if part else "which mesh?"
        raise MeshError(str(path), [f"{wanted} The meshes in it are: {', '.join(found) or 'none'}"])
    geometry = found[chosen[0]]
    wrong = [text for name, kinds in GEOMETRY_CHANNELS.items() if (text := _wrong_channel(geometry, name, kinds))]
    kind = np.ravel(geometry.parent.attrs.get("IO", "MeshIO"))[0]
    if (kind.decode() if isinstance(kind, bytes) else kind) != "MeshIO":
        wrong.append(f"{geometry.parent.name} holds '{kind}', expected 'MeshIO'")
    if wrong:
        raise MeshError(str(path), wrong)
    return geometry


def _wrong_channel(geometry: Any, name: str, kinds: str) -> str:
    """What is wrong with a channel of the geometry, or ""."""
    channel = geometry[name]
    if not isinstance(channel, h5py.Dataset):
        return f"{geometry.name}/{name} is a group, expected an array"
    if channel.external or channel.is_virtual or channel.file.filename != geometry.file.filename:
        return f"{geometry.name}/{name} lies in another file"
    if channel.ndim != 2 or channel.shape[1] != 3:
        return f"{geometry.name}/{name} has shape {channel.shape}, expected (n, 3)"
    wanted = "numbers" if "f" in kinds else "integers"
    return "" if _is_numbers(channel, kinds) else f"{geometry.name}/{name} holds {channel.dtype}, expected {wanted}"


def _is_numbers(item: Any, kinds: str) -> bool:
    return isinstance(item, h5py.Dataset) and item.shape is not None and item.dtype.kind in kinds
