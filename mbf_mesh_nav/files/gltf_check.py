"""What has to hold in a glTF file before a reader may follow its references.

A reader that trusts them fails with an error of its own code, leaves a part of the map out, follows a cycle of nodes
for ever, or allocates the memory that a count asks for. Here every reference that leads to a triangle is followed once,
and errors name their place in the file. Numbers by the glTF 2.0 specification (Khronos Group), sections 3.5, 3.6 and 4.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from mbf_mesh_nav.mesh.mesh_report import MeshError

Table = list[dict[str, Any]]

GLB_MAGIC, JSON_CHUNK = b"glTF", b"JSON"
GLB_HEADER_BYTES, CHUNK_HEADER_BYTES = 12, 8
TRIANGLE_MODES = (4, 5, 6)
COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
COMPONENTS = {"SCALAR": 1, "VEC3": 3}
COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
MAX_REASONS = 10


def check_gltf(path: Path) -> None:
    """Check nodes, triangles and sizes of a .gltf or .glb file.

    Raises
    ------
    MeshError
        A reference leads nowhere, nodes are no tree, an array is not in its buffer, or the mesh is compressed.
    """
    document = _document(path)
    try:
        tables = {
            name: _table(document, name)
            for name in ("nodes", "meshes", "accessors", "bufferViews", "buffers", "scenes")
        }
        used = document.get("extensionsUsed") or []
        reasons = [f"it is compressed by {name}, which is not read" for name in COMPRESSIONS if name in used]
        reasons += _wrong_nodes(tables)
        triangles = list(_primitives(tables["meshes"]))
        reasons += [reason for place, one in triangles for reason in _wrong(place, one, tables)]
        if not triangles and not reasons:
            reasons = ["there is no face in it"]
    except (TypeError, AttributeError, ValueError) as error:
        raise MeshError(str(path), [f"is not a glTF file: {error}"]) from error
    if reasons:
        more = [f"and {len(reasons) - MAX_REASONS} more"] if len(reasons) > MAX_REASONS else []
        raise MeshError(str(path), reasons[:MAX_REASONS] + more)


def _document(path: Path) -> dict[str, Any]:
    """The JSON of a .gltf file, or of the first chunk of a .glb file."""
    content = path.read_bytes() if path.suffix.lower() == ".gltf" else _first_chunk(path)
    try:
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise MeshError(str(path), [f"is not a glTF file: {error}"]) from error
    if not isinstance(document, dict):
        got = type(document).__name__
        raise MeshError(str(path), [f"is not a glTF file: expected an object at the top, got {got}"])
    return document


def _first_chunk(path: Path) -> bytes:
    with path.open("rb") as file:
        head = file.read(GLB_HEADER_BYTES + CHUNK_HEADER_BYTES)
        if head[:4] != GLB_MAGIC or head[16:20] != JSON_CHUNK:
            raise MeshError(str(path), ["is not a glTF file: it does not begin with a header and a chunk of JSON"])
        size = int.from_bytes(head[12:16], "little")
        content = file.read(min(size, path.stat().st_size))
    if len(content) < size:
        raise MeshError(str(path), [f"the file is cut off: expected {size} bytes of JSON, found {len(content)}"])
    return content


def _table(document: dict[str, Any], name: str) -> Table:
    table = document.get(name, [])
    if not isinstance(table, list) or not all(isinstance(entry, dict) for entry in table):
        raise TypeError(f"{name}: expected a list of objects")
    return table


def _entry(table: Table, name: str, number: Any) -> dict[str, Any]:
    """An entry of a table; raises LookupError if the number is none of an entry."""
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < len(table):
        raise LookupError(f"names {name}[{number}], there are {len(table)}")
    return table[number]


def _wrong_nodes(tables: dict[str, Table]) -> list[str]:
    """Reasons why the nodes are no forest, or name meshes that do not exist."""
    nodes, reasons = tables["nodes"], []
    parent: dict[int, int] = {}
    for number, node in enumerate(nodes):
        try:
            if "mesh" in node:
                _entry(tables["meshes"], "meshes", node["mesh"])
            for child in node.get("children", []):
                _entry(nodes, "nodes", child)
                if child in parent:
                    raise LookupError(f"has the child {child}, which is a child of nodes[{parent[child]}], too")
                parent[child] = number
        except LookupError as error:
            reasons.append(f"nodes[{number}]: {error.args[0]}")
    for number, scene in enumerate(tables["scenes"]):
        for root in scene.get("nodes", []):
            if not isinstance(root, int) or not 0 <= root < len(nodes):
                reasons.append(f"scenes[{number}]: names nodes[{root}], there are {len(nodes)}")
    try:
        TopologicalSorter({child: (above,) for child, above in parent.items()}).prepare()
    except CycleError as error:
        reasons.append("the nodes do not form a tree: " + " -> ".join(f"nodes[{one}]" for one in error.args[1]))
    return reasons


def _primitives(meshes: Table) -> Iterator[tuple[str, dict[str, Any]]]:
    """Primitives that are triangles, with their places."""
    for number, mesh in enumerate(meshes):
        for index, primitive in enumerate(mesh.get("primitives", [])):
            if primitive.get("mode", 4) in TRIANGLE_MODES:
                yield f"meshes[{number}].primitives[{index}]", primitive


def _wrong(place: str, primitive: dict[str, Any], tables: dict[str, Table]) -> list[str]:
    """Reasons why the positions or indices of a primitive cannot be read."""
    arrays = {"attributes.POSITION": (primitive.get("attributes", {}).get("POSITION"), "VEC3")}
    if "indices" in primitive:
        arrays["indices"] = (primitive["indices"], "SCALAR")
    reasons = []
    for name, (number, kind) in arrays.items():
        try:
            accessor = _entry(tables["accessors"], "accessors", number)
            _check_accessor(f"accessors[{number}]", accessor, kind, tables)
        except LookupError as error:
            reasons.append(f"{place}.{name}: {error.args[0]}")
    return reasons


def _check_accessor(name: str, accessor: dict[str, Any], kind: str, tables: dict[str, Table]) -> None:
    """Raise LookupError if an accessor's numbers do not lie in a buffer."""
    if accessor.get("type") != kind or accessor.get("componentType") not in COMPONENT_BYTES:
        raise LookupError(f"{name} holds {accessor.get('type')} of {accessor.get('componentType')}, expected {kind}")
    if "bufferView" not in accessor:
        raise LookupError(f"{name} has no bufferView, so nothing is in it")
    view = _entry(tables["bufferViews"], "bufferViews", accessor["bufferView"])
    buffer = _entry(tables["buffers"], "buffers", view.get("buffer"))
    item = COMPONENT_BYTES[accessor["componentType"]] * COMPONENTS[kind]
    count, start, size, stride, view_start, buffer_size = (
        _natural(f"{name}.{key}", value)
        for key, value in (
            ("count", accessor.get("count")),
            ("byteOffset", accessor.get("byteOffset", 0)),
            ("bufferView.byteLength", view.get("byteLength")),
            ("bufferView.byteStride", view.get("byteStride", item)),
            ("bufferView.byteOffset", view.get("byteOffset", 0)),
            ("buffer.byteLength", buffer.get("byteLength")),
        )
    )
    needed = start + (stride * (count - 1) + item if count else 0)
    if stride < 1 or needed > size or view_start + size > buffer_size:
        raise LookupError(f"{name} needs {needed} bytes of a view of {size}, in a buffer of {buffer_size}")


def _natural(name: str, value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise LookupError(f"{name}: expected a whole number of at least 0, got {value!r:.40}")
    return value
