"""The triangles of a scene file (PLY, OBJ, STL, OFF, COLLADA, glTF), through trimesh; a plain PLY without it.

Nodes of the scene are moved into place. Pictures and materials are not read, and of other files only those that lie
beside the mesh and hold a glTF's numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.config.bounded_files import special_file
from mbf_abstract.geometry.arithmetic import rotated, scalar_products
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.files.collada_check import check_collada
from mbf_mesh_nav.files.file_frames import GLTF_FORMATS
from mbf_mesh_nav.files.gltf_check import check_gltf
from mbf_mesh_nav.files.obj_check import check_obj, refuse_obj_line
from mbf_mesh_nav.files.plain_ply import read_plain_ply
from mbf_mesh_nav.files.truncated_files import refuse_truncated_file
from mbf_mesh_nav.mesh.mesh_report import MeshError

MeshArrays = tuple[FloatArray, NDArray[np.int64]]

OBJ_PARTS = {"split_objects": True, "group_material": False}
BARE = {"skip_materials": True}
OPTIONS: dict[str, dict[str, Any]] = {
    # Texture coordinates would split the vertices of a PLY and so renumber them.
    ".ply": {"fix_texture": False, **BARE},
    ".obj": BARE,
    # A part that cannot be read is an error, not a hole in the map.
    ".gltf": {"ignore_broken": False, **BARE},
    ".glb": {"ignore_broken": False, **BARE},
}
"""Options of trimesh's readers by format."""


def read_scene(path: Path, part: str, max_faces: int) -> MeshArrays:
    """Read the triangles of a part of the scene, all of them if it is "".

    Returns
    -------
    vertices : (V, 3) float64
        In the coordinates and units of the file.
    faces : (F, 3) int64

    Raises
    ------
    MeshError
        The file is damaged, cut off, has no such part or more than ``max_faces`` faces, counting every use of a mesh.
    """
    try:
        refuse_truncated_file(path)
        if path.suffix.lower() in GLTF_FORMATS:
            check_gltf(path)
        elif path.suffix.lower() == ".dae":
            check_collada(path)
        elif path.suffix.lower() == ".obj":
            check_obj(path)
        return _read(path, part, max_faces)
    except MeshError:
        raise
    except Exception as error:  # any parser error of any format; MemoryError of a lying header included
        if path.suffix.lower() == ".obj":
            refuse_obj_line(path)
        text = f"cannot be read as {path.suffix[1:].lower()}: {type(error).__name__}: {error}"
        raise MeshError(str(path), [text]) from error


def _read(path: Path, part: str, max_faces: int) -> MeshArrays:
    plain = read_plain_ply(path) if path.suffix.lower() == ".ply" and not part else None
    if plain is not None:
        _limit(path, len(plain[1]), max_faces)
        return plain
    scene = _loaded(path, part)
    nodes = [node for node in scene.graph.nodes_geometry if _belongs_to(scene, node, part)]
    if not nodes and scene.graph.nodes_geometry:
        parts = sorted("/".join(_names_above(scene, node)) for node in scene.graph.nodes_geometry)
        raise MeshError(str(path), [f"no part '{part}', the parts are: {', '.join(parts)}"])
    meshes = [(node, scene.geometry[scene.graph[node][1]]) for node in nodes]
    meshes = [(node, mesh) for node, mesh in meshes if hasattr(mesh, "faces")]
    _limit(path, sum(len(mesh.faces) for _, mesh in meshes), max_faces)
    vertices, faces = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)]
    offset = 0
    for node, mesh in meshes:
        points, mirrored = _placed(scene, node, np.asarray(mesh.vertices, dtype=np.float64))
        corners = np.asarray(mesh.faces, dtype=np.int64) + offset
        vertices.append(points)
        faces.append(corners[:, ::-1] if mirrored else corners)  # mirrored parts are inside out
        offset += len(points)
    return np.vstack(vertices), np.vstack(faces)


def _limit(path: Path, count: int, max_faces: int) -> None:
    if count > max_faces:
        raise MeshError(str(path), [f"{count} faces, the limit is {max_faces} (max_faces)"])


def _placed(scene: Any, node: str, points: FloatArray) -> tuple[FloatArray, bool]:
    """Points (n, 3) of a node in the scene's frame, and whether they are mirrored.

    They go from node to node: trimesh would multiply the transforms, in an order of sums that depends on the CPU.
    """
    forest, mirrored = scene.graph.transforms, False
    while node != scene.graph.base_frame and node in forest.parents:
        parent = forest.parents[node]
        transform = np.asarray(forest.edge_data[parent, node].get("matrix", np.eye(4)), dtype=np.float64)
        points = rotated(transform[:3, :3], points) + transform[:3, 3]
        x_axis, y_axis, z_axis = transform[:3, :3].T
        mirrored ^= float(scalar_products(np.cross(x_axis, y_axis), z_axis)) < 0.0
        node = parent
    return points, mirrored


def _loaded(path: Path, part: str) -> Any:
    import trimesh

    class FilesBeside(trimesh.resolvers.FilePathResolver):  # type: ignore[misc]
        """Gives a glTF the buffers that lie in its folder, and nothing else."""

        def get(self, name: str) -> bytes:
            file = (path.parent / name.strip()).resolve()
            if path.suffix.lower() != ".gltf" or not file.is_relative_to(path.parent.resolve()) or special_file(file):
                raise ValueError(f"'{name}' is not a file of numbers beside the mesh")
            return file.read_bytes()

    ending = path.suffix.lower()
    # The objects of an OBJ file come as one mesh, or one for each material, unless asked for.
    options = OPTIONS.get(ending, {}) | (OBJ_PARTS if part and ending == ".obj" else {})
    return trimesh.load_scene(str(path), process=False, resolver=FilesBeside(str(path)), **options)


def _belongs_to(scene: Any, node: str, part: str) -> bool:
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
