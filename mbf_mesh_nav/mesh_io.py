"""Reading meshes from files: PLY, OBJ, STL, OFF, DAE, glTF through trimesh, the HDF5 layouts of lvr2, elevation models.

Whatever is wrong with a file comes out as one ``MeshError`` that names it. A file is only read, never changed.
Coordinates are taken as they stand: an up-axis tag of COLLADA is ignored, as mesh_navigation does.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import rotated, scalar_products
from mbf_mesh_nav.cut_files import refuse_cut_file
from mbf_mesh_nav.elevation_files import elevation_readers, read_elevation
from mbf_mesh_nav.mesh_report import MeshError

TRIMESH_FORMATS = frozenset({".ply", ".obj", ".stl", ".off", ".dae", ".gltf", ".glb"})
HDF5_FORMATS = frozenset({".h5", ".hdf5"})
SPLIT_CORNERS = frozenset({".stl", ".obj", ".dae", ".gltf", ".glb"})
"""Formats whose files, or readers, give faces, materials, parts or seams of a texture corners of their own."""
OBJ_PARTS = {"split_objects": True, "group_material": False}
MAX_FILE_BYTES = 4 * 2**30
MAX_FACES = 30_000_000

MeshArrays = tuple[NDArray[np.float64], NDArray[np.int64]]


def read_mesh(file: str | Path, part: str = "", max_faces: int = MAX_FACES) -> MeshArrays:
    """Read one mesh.

    Parameters
    ----------
    file : path
        The ending decides the format.
    part : str
        Which part of the file: a path of node names through a scene graph ("building/floor_2"), the name of an OBJ
        file's object, or the group of an HDF5 file. "" and "/" mean everything, joined (HDF5: the only mesh in the
        file). Elevation models have none.
    max_faces : int
        Larger meshes are refused before anything is built from them.

    Returns
    -------
    vertices : (V, 3) float64
        In the coordinates of the scene [m].
    faces : (F, 3) int64

    Raises
    ------
    MeshError
        Missing, unreadable, cut off, too large, no such part, or no triangle in it.
    """
    path = Path(file)
    ending = path.suffix.lower()
    if ending not in (known := known_endings()):
        raise MeshError(str(path), [f"unknown ending '{ending}', known are: {', '.join(sorted(known))}"])
    if not path.is_file():
        raise MeshError(str(path), ["there is no such file"])
    if path.stat().st_size > MAX_FILE_BYTES:
        raise MeshError(str(path), [f"{path.stat().st_size} bytes, the limit is {MAX_FILE_BYTES}"])
    if ending in HDF5_FORMATS:
        from mbf_mesh_nav.lvr2_io import read_lvr2_mesh  # h5py only for those who use it

        return read_lvr2_mesh(path, part, max_faces)
    if ending not in TRIMESH_FORMATS:
        vertices, faces = read_elevation(path, max_faces)
    else:
        vertices, faces = _read_with_trimesh(path, part.strip("/"))
    if len(faces) == 0:
        raise MeshError(str(path), ["there is no face in it"])
    if len(faces) > max_faces:
        raise MeshError(str(path), [f"{len(faces)} faces, the limit is {max_faces}"])
    return vertices, faces


def known_endings() -> frozenset[str]:
    """Endings of the files that can be read, with their dots."""
    return TRIMESH_FORMATS | HDF5_FORMATS | frozenset(elevation_readers())


def _read_with_trimesh(path: Path, part: str) -> MeshArrays:
    try:
        refuse_cut_file(path)
        return _read_scene(path, part)
    except MeshError:
        raise
    except Exception as error:  # any parser error of any format; MemoryError of a lying header included
        text = f"cannot be read as {path.suffix[1:].lower()}: {type(error).__name__}: {error}"
        raise MeshError(str(path), [text]) from error


def _read_scene(path: Path, part: str) -> MeshArrays:
    import trimesh

    # Texture coordinates would split the vertices of a PLY and so renumber them. The objects of an OBJ file come as one
    # mesh, or one for each material, unless asked for.
    options = {".ply": {"fix_texture": False}, ".obj": OBJ_PARTS if part else {}}.get(path.suffix.lower(), {})
    scene = trimesh.load_scene(str(path), process=False, **options)
    if not scene.graph.nodes_geometry:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    nodes = [node for node in scene.graph.nodes_geometry if _node_path(scene, node, part)]
    if not nodes:
        parts = sorted("/".join(_names_above(scene, node)) for node in scene.graph.nodes_geometry)
        raise MeshError(str(path), [f"no part '{part}', the parts are: {', '.join(parts)}"])
    vertices: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int64]] = []
    offset = 0
    for node in nodes:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not hasattr(geometry, "faces"):
            continue
        points = np.asarray(geometry.vertices, dtype=np.float64)
        vertices.append(rotated(transform[:3, :3], points) + transform[:3, 3])
        corners = np.asarray(geometry.faces, dtype=np.int64) + offset
        x_axis, y_axis, z_axis = transform[:3, :3].T
        mirrored = float(scalar_products(np.cross(x_axis, y_axis), z_axis)) < 0.0
        faces.append(corners[:, ::-1] if mirrored else corners)  # mirrored parts are inside out
        offset += len(points)
    if not faces:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    return np.vstack(vertices), np.vstack(faces)


def _node_path(scene: Any, node: str, part: str) -> bool:
    """Whether a node is the part, lies below it, or everything is wanted."""
    if not part:
        return True
    names = "/".join(_names_above(scene, node))
    geometry = scene.graph[node][1]
    return names == part or names.startswith(part + "/") or part in (node, geometry)


def _names_above(scene: Any, node: str) -> list[str]:
    """Node names from below the root down to ``node``."""
    parents = scene.graph.transforms.parents
    names = [str(node)]
    while (node := parents.get(node, scene.graph.base_frame)) != scene.graph.base_frame:
        names.insert(0, str(node))
    return names
