"""What has to hold in a COLLADA file before a reader unfolds it: nodes that instance nodes are no cycle, and few.

A few lines of ``instance_node``, each using the one before several times, ask for billions of copies of a mesh. Here
the copies are counted, not made. Numbers by the COLLADA 1.4.1 specification (Khronos Group), chapter 5.
"""

from __future__ import annotations

from collections.abc import Iterable
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from mbf_mesh_nav.mesh.mesh_report import MeshError

MAX_INSTANCES = 100_000
"""Uses of geometries in a scene; the largest of the field's own maps has a few hundred."""
GEOMETRY, NODE_USE, NODE = "instance_geometry", "instance_node", "node"
SCENES, SHOWN = "visual_scene", "instance_visual_scene"


def check_collada(path: Path) -> None:
    """Count the uses of geometries in every visual scene.

    Raises
    ------
    MeshError
        No scene is shown, nodes instance each other in a cycle, or geometries are used more than ``MAX_INSTANCES``
        times.
    """
    from lxml import etree

    try:
        # Entities are left alone: they could name other files, or grow without end. Large files are legal here.
        parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)
        root = etree.parse(str(path), parser).getroot()
    except (etree.XMLSyntaxError, ValueError) as error:
        raise MeshError(str(path), [f"cannot be read as dae: {error}"]) from error
    elements = [element for element in root.iter() if isinstance(element.tag, str)]
    if not any(_name(element) == SHOWN for element in elements):
        raise MeshError(str(path), [f"expected a <scene> with an <{SHOWN}>, got a file that shows nothing"])
    nodes = {element.get("id"): element for element in elements if _name(element) == NODE and element.get("id")}
    counts = _count_uses(nodes, path)
    for scene in elements:
        if _name(scene) == SCENES and (used := _uses(scene, counts)) > MAX_INSTANCES:
            raise MeshError(str(path), [f"{used} uses of geometries through its nodes, the limit is {MAX_INSTANCES}"])


def _count_uses(nodes: dict[str, Any], path: Path) -> dict[str, int]:
    """Uses of geometries in each named node: those below it, and those of the nodes it instances."""
    used = {name: [other for other in _used_nodes(node) if other in nodes] for name, node in nodes.items()}
    counts: dict[str, int] = {}
    try:
        for name in TopologicalSorter(used).static_order():
            counts[name] = _uses(nodes[name], counts)
    except CycleError as error:
        text = f"its nodes instance each other in a cycle, e.g. '{error.args[1][0]:.40}'"
        raise MeshError(str(path), [text]) from error
    return counts


def _uses(element: Any, counts: dict[str, int]) -> int:
    own = sum(1 for below in element.iter() if _name(below) == GEOMETRY)
    return own + sum(counts.get(name, 0) for name in _used_nodes(element))


def _used_nodes(element: Any) -> Iterable[str]:
    return (below.get("url", "").removeprefix("#") for below in element.iter() if _name(below) == NODE_USE)


def _name(element: Any) -> str:
    """Name of an element without its namespace; empty for comments and such."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
