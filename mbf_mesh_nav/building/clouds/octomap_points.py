"""Octrees of OctoMap as point clouds: the binary format .bt and the full format .ot, read by ourselves.

Format: Hornung, Wurm, Bennewitz, Stachniss and Burgard, "OctoMap: an efficient probabilistic 3D mapping framework
based on octrees" (2013), and what its library writes. A text header gives the kind of tree, the number of its nodes and
the edge of a voxel in metres; the nodes follow (``kernels.building.octree``). Points are the centres of occupied
voxels; a larger occupied cube counts as all of its voxels. What is free or unknown gives none.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.building.clouds.stored_points import StoredPoints, bytes_left, refuse_count
from mbf_mesh_nav.kernels.building.octree import (
    LEVELS,
    TOO_DEEP,
    cubes_of_all_nodes,
    cubes_of_inner_nodes,
    voxels_of_cubes,
)
from mbf_mesh_nav.mesh.mesh_report import MeshError

FIRST_LINES = {".bt": "# Octomap OcTree binary file", ".ot": "# Octomap OcTree file"}
NODES = {
    "OcTree": np.dtype([("log_odds", "<f4"), ("children", "u1")]),
    "ColorOcTree": np.dtype([("log_odds", "<f4"), ("colour", "u1", 3), ("children", "u1")]),
}
"""What a full file holds of a node, by the kind of the tree."""
INNER_NODE = np.dtype("<u2")
MAX_HEADER_LINES = 100
MOST_NODES = 8
"""Nodes that one inner node adds to a tree, at most."""


class _Header(NamedTuple):
    tree: str
    nodes: int
    voxel: float


def read_octomap_points(path: Path, max_points: int) -> StoredPoints:
    """Read the occupied voxels of a .bt or .ot file.

    Raises
    ------
    MeshError
        No OctoMap file, another kind of tree, cut off, damaged, or more than ``max_points`` occupied voxels.
    """
    with path.open("rb") as file:
        header = _read_header(path, file)
        is_binary = path.suffix.lower() == ".bt"
        cubes = _binary_cubes(path, file, header) if is_binary else _full_cubes(path, file, header)
    edges = cubes[:, 3].astype(np.int64)
    count = int((edges * edges * edges).sum())
    refuse_count(path, count, max_points)
    voxels = np.empty((count, 3), dtype=np.int32)
    voxels_of_cubes(cubes, voxels)
    points = (voxels + (0.5 - 2 ** (LEVELS - 1))) * header.voxel
    return StoredPoints(points, notes=(f"{len(points)} occupied voxels of {header.voxel:g} m",))


def _read_header(path: Path, file: BinaryIO) -> _Header:
    first = file.readline(256).decode("ascii", "replace").strip()
    if first != FIRST_LINES[path.suffix.lower()]:
        expected = FIRST_LINES[path.suffix.lower()]
        raise MeshError(str(path), [f"is not an OctoMap {path.suffix} file: expected '{expected}', got {first!r:.60}"])
    values: dict[str, str] = {}
    for _ in range(MAX_HEADER_LINES):
        line = file.readline(4096)
        if not line:
            raise MeshError(str(path), ["the file is cut off within its header: there is no line 'data'"])
        words = line.decode("ascii", "replace").split()
        if words[:1] == ["data"]:
            break
        if words and not words[0].startswith("#"):
            values[words[0]] = " ".join(words[1:])
    else:
        raise MeshError(str(path), [f"there is no line 'data' among the first {MAX_HEADER_LINES} of its header"])
    try:
        header = _Header(values["id"], int(values["size"]), float(values["res"]))
    except (KeyError, ValueError) as error:
        raise MeshError(str(path), [f"its header has no usable id, size and res: {error}"]) from error
    if header.tree not in NODES:
        raise MeshError(str(path), [f"id: expected {' or '.join(NODES)}, got '{header.tree:.40}'"])
    if header.nodes < 1:
        raise MeshError(str(path), [f"size: its tree has {header.nodes} nodes"])
    if not (math.isfinite(header.voxel) and header.voxel > 0.0):
        raise MeshError(str(path), [f"res: expected the edge of a voxel in metres, got {header.voxel:g}"])
    return header


def _binary_cubes(path: Path, file: BinaryIO, header: _Header) -> IntArray:
    """Occupied cubes (m, 4) of a binary file; see ``cubes_of_inner_nodes``."""
    found = bytes_left(file) // INNER_NODE.itemsize
    if header.nodes > 1 + MOST_NODES * found:
        raise _cut_off(path, header, f"at most {1 + MOST_NODES * found}")
    kinds = np.frombuffer(file.read(), dtype=INNER_NODE, count=found).astype(np.int32)
    read, nodes, count = cubes_of_inner_nodes(kinds, np.empty((0, 4), dtype=np.int32))
    _refuse_damaged(path, header, read, nodes)
    cubes = np.empty((count, 4), dtype=np.int32)
    cubes_of_inner_nodes(kinds, cubes)
    return cubes


def _full_cubes(path: Path, file: BinaryIO, header: _Header) -> IntArray:
    """Occupied cubes (m, 4) of a full file: a leaf is occupied where its odds are at least even."""
    found = bytes_left(file) // NODES[header.tree].itemsize
    if header.nodes > found:
        raise _cut_off(path, header, str(found))
    nodes = np.frombuffer(file.read(), dtype=NODES[header.tree], count=header.nodes)
    children, is_occupied = nodes["children"].astype(np.int32), nodes["log_odds"] >= 0.0
    read, count = cubes_of_all_nodes(children, is_occupied, np.empty((0, 4), dtype=np.int32))
    _refuse_damaged(path, header, read, read)
    cubes = np.empty((count, 4), dtype=np.int32)
    cubes_of_all_nodes(children, is_occupied, cubes)
    return cubes


def _cut_off(path: Path, header: _Header, found: str) -> MeshError:
    return MeshError(str(path), [f"the file is cut off: expected {header.nodes} nodes, found {found}"])


def _refuse_damaged(path: Path, header: _Header, read: int, nodes: int) -> None:
    if read == TOO_DEEP:
        raise MeshError(str(path), [f"it is damaged: its tree is deeper than {LEVELS} levels"])
    if read < 0:
        raise _cut_off(path, header, "an end within its tree")
    if nodes != header.nodes:
        raise MeshError(str(path), [f"it is damaged: expected {header.nodes} nodes, its tree has {nodes}"])
