"""The HDF5 files of lvr2 and mesh_navigation: both layouts read, the present one ("MeshIO") written.

Layout of a part: ``geometry/vertices`` (V, 3) float32 and ``geometry/face_indices`` (F, 3) uint32, per-vertex
attributes such as layer costs below ``vertex_attributes``. Files made before December 2024 keep everything in
``<part>/channels``.

Unlike mesh_navigation we never write into the input and never take a stored layer for a computed one: a stored layer
does not say which parameters made it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.repair import MeshError

FloatArray = NDArray[np.float64]
GEOMETRIES = ("geometry", "channels")
VERTEX_ATTRIBUTES = ("vertex_attributes", "channels")


def read_lvr2_mesh(path: Path, part: str, max_faces: int) -> tuple[FloatArray, NDArray[np.int64]]:
    """Read vertices (V, 3) and faces (F, 3) of a part; "" takes the only mesh of the file.

    Raises
    ------
    MeshError
        Not an HDF5 file, no or several meshes, a missing or misshapen channel, or more faces than ``max_faces``.
    """
    try:
        with h5py.File(path, "r") as file:
            geometry = _geometry(file, path, part.strip("/"))
            faces, vertices = geometry["face_indices"], geometry["vertices"]
            if faces.shape[0] > max_faces or vertices.shape[0] > 3 * max_faces:
                raise MeshError(str(path), [f"{faces.shape[0]} faces, the limit is {max_faces}"])
            return vertices[()].astype(np.float64), faces[()].astype(np.int64)
    except OSError as error:
        raise MeshError(str(path), [f"cannot be read as HDF5: {error}"]) from error


def read_lvr2_vertex_attributes(path: Path, part: str = "") -> dict[str, NDArray[np.float32]]:
    """Read all per-vertex numbers of a part, e.g. costs that mesh_navigation saved, in the file's numbering.

    Returns
    -------
    dict
        Name -> (V,) or (V, n) float32.
    """
    with h5py.File(path, "r") as file:
        geometry = _geometry(file, path, part.strip("/"))
        count = geometry["vertices"].shape[0]
        groups = [geometry.parent[name] for name in VERTEX_ATTRIBUTES if name in geometry.parent]
        attributes: dict[str, Any] = dict(groups[0]) if groups else {}
        return {
            name: np.squeeze(values[()]).astype(np.float32)
            for name, values in attributes.items()
            if name not in ("vertices", "face_indices") and values.shape[:1] == (count,)
        }


def write_lvr2_mesh(
    path: Path,
    vertices: FloatArray,
    faces: NDArray[Any],
    vertex_attributes: Mapping[str, NDArray[Any]] | None = None,
    part: str = "mesh",
) -> None:
    """Write a mesh and per-vertex attributes in the MeshIO layout; refuses to overwrite a file.

    Parameters
    ----------
    vertices : (V, 3) float
        Stored as float32, the layout's type.
    faces : (F, 3) int
    vertex_attributes : mapping, optional
        Name -> (V,) or (V, n) numbers, e.g. layer costs.
    """
    if path.exists():
        raise MeshError(str(path), ["the file exists; it is not overwritten"])
    with h5py.File(path, "w") as file:
        group = file.create_group(part)
        group.attrs["IO"] = "MeshIO"
        group.attrs["CLASS"] = "MeshBuffer"
        group["geometry/vertices"] = np.asarray(vertices, dtype=np.float32)
        group["geometry/face_indices"] = np.asarray(faces, dtype=np.uint32)
        for name, values in (vertex_attributes or {}).items():
            group[f"vertex_attributes/{name}"] = np.asarray(values, dtype=np.float32).reshape(len(vertices), -1)


def write_lvr2_map(path: Path, mesh_map: MeshMap, part: str = "mesh") -> None:
    """Write a map with the costs of all its layers, in the caller's numbering as far as vertices come from the caller.

    Vertices that densifying added follow after them; merged and dropped ones are not in the file.
    """
    source = mesh_map.internal_to_input.astype(np.int64)
    order = np.argsort(np.where(source >= 0, source, np.iinfo(np.int64).max), kind="stable")
    position = np.argsort(order)
    attributes: dict[str, NDArray[Any]] = {name: layer.costs[order] for name, layer in mesh_map.layers.items()}
    attributes["vertex_normals"] = mesh_map.vertex_normals[order]
    write_lvr2_mesh(path, mesh_map.vertices[order], position[mesh_map.faces], attributes, part)


def _geometry(file: h5py.File, path: Path, part: str) -> Any:
    """Group with the channels ``vertices`` and ``face_indices`` of a part, whichever layout."""
    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        above, _, last = name.rpartition("/")
        if last in GEOMETRIES and isinstance(item, h5py.Group) and "vertices" in item and "face_indices" in item:
            found[above] = item

    file.visititems(visit)
    chosen = [part] if part else list(found)
    if len(chosen) != 1 or chosen[0] not in found:
        wanted = f"no mesh '{part}'" if part else "which mesh?"
        raise MeshError(str(path), [f"{wanted} The meshes in it are: {', '.join(found) or 'none'}"])
    geometry = found[chosen[0]]
    wrong = [
        f"{geometry.name}/{name} has shape {geometry[name].shape}, expected (n, 3)"
        for name in ("vertices", "face_indices")
        if geometry[name].ndim != 2 or geometry[name].shape[1] != 3
    ]
    kind = geometry.parent.attrs.get("IO", "MeshIO")
    if (kind.decode() if isinstance(kind, bytes) else kind) != "MeshIO":
        wrong.append(f"{geometry.parent.name} holds '{kind}', expected 'MeshIO'")
    if wrong:
        raise MeshError(str(path), wrong)
    return geometry
