"""Whether a goal on a mesh is permanently unreachable, or a start blocked: by ground that no sensor can open.

On the map of the moment a wall and a movable box look the same. So the search is repeated with what is lethal in layers
that depend on the mesh and their parameters alone: where even that leaves no way, waiting and trying again are useless.
Inflated ground is left out, as is what a layer closes for errors of the map alone: ``relax`` makes both smaller.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.arrays import BoolArray
from mbf_mesh_nav.layers.combinations.combination import CombinationLayer
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.map.height_error import HeightErrorParameters, errors_for
from mbf_mesh_nav.map.layer import MeshLayer
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.surface_point import nearest_corner
from mbf_mesh_nav.mesh.topology import group_of_each


def as_permanent(problem: PlanResult, mesh_map: MeshMap, request: PlanRequest, index: int) -> PlanResult:
    """A failure of the start, or of the way to via pose ``index``, counted from 1, or to the goal behind them.

    It is permanent where the start lies on such ground, or where that separates the pose from it. A tolerance is that
    of the goal.
    """
    if problem.outcome == GetPathOutcome.BLOCKED_START:
        return replace(problem, permanent=is_on_walls(mesh_map, request.start))
    if problem.permanent or problem.outcome not in (GetPathOutcome.BLOCKED_GOAL, GetPathOutcome.NO_PATH_FOUND):
        return problem
    is_last = index > len(request.via)
    goal = request.goal if is_last else (request.start, *request.via)[index]
    walls = what_separates(mesh_map, request.start, goal, request.dist_tolerance if is_last else 0.0)
    text = f"{problem.message}; lethal ground of {', '.join(walls)} separates them"
    return replace(problem, message=text, permanent=True) if walls else problem


def what_separates(mesh_map: MeshMap, start: Pose, goal: Pose, tolerance: float) -> tuple[str, ...]:
    """Names of the layers whose permanent ground separates a start from all vertices near a goal; empty if none does.

    Near are the corners of the goal's face and what lies within ``tolerance`` [m] of it. The answer is conservative: it
    is empty for a start on such ground, for poses off the surface, and wherever other ground might be opened.
    """
    walls = permanent_layers(mesh_map)
    closed = _closed_by(walls, mesh_map)
    ends = mesh_map.locate([start.position, goal.position], np.inf).faces
    if (ends < 0).any() or not closed.any():
        return ()
    first, last = (mesh_map.faces[face] for face in ends)
    if closed[first].any():
        return ()
    edges = mesh_map.topology.edges
    pieces = group_of_each(edges[~closed[edges].any(axis=1)], len(closed))
    near = norm(mesh_map.vertices - np.asarray(goal.position)) <= tolerance
    near[last] = True
    reached = np.isin(pieces, pieces[first]) & ~closed
    if (near & reached).any():
        return ()
    merged = [layer.name for layer in walls if not isinstance(layer, CombinationLayer) and layer.lethal.any()]
    return tuple(sorted(merged) or [layer.name for layer in walls])


def is_on_walls(mesh_map: MeshMap, pose: Pose) -> bool:
    """Whether the vertex nearest to a pose is such ground."""
    place = mesh_map.locate_one(pose.position)
    return place is not None and bool(_closed_by(permanent_layers(mesh_map), mesh_map)[nearest_corner(mesh_map, place)])


def _closed_by(layers: list[MeshLayer], mesh_map: MeshMap) -> BoolArray:
    """Vertices (V,) that are lethal for good in any of some layers."""
    closed = np.zeros(mesh_map.topology.vertex_count, dtype=np.bool_)
    for layer in layers:
        closed |= layer.lethal_for_good
    return closed


def permanent_layers(mesh_map: MeshMap) -> list[MeshLayer]:
    """The layers that no sensor changes, neither directly nor by their inputs, and whose lethal ground the map has.

    Such are the default layer and those that reach it through combinations and inflations, which keep what is lethal.
    """
    if mesh_map.default_layer is None:
        return []
    found: dict[str, MeshLayer] = {}
    todo = [mesh_map.layers[mesh_map.default_layer]]
    while todo:
        layer = todo.pop()
        if isinstance(layer, CombinationLayer | InflationLayer):
            todo += [read for read in layer.inputs if read.parameters.enabled]
        if layer.parameters.enabled and _is_fixed(layer):
            found[layer.name] = layer
    return list(found.values())


def _is_fixed(layer: MeshLayer) -> bool:
    """Whether neither a sensor nor time nor ``relax`` changes what is lethal for good in a layer."""
    kind = type(layer)
    changes = kind.insert_scan is not MeshLayer.insert_scan or kind.update is not MeshLayer.update
    inputs = all(_is_fixed(read) and not _has_margin(read) for read in layer.inputs)
    return inputs and not changes and not isinstance(layer, InflationLayer)


def _has_margin(layer: MeshLayer) -> bool:
    """Whether what a layer closes depends on errors of the map."""
    return isinstance(layer.parameters, HeightErrorParameters) and bool(np.any(errors_for(layer)))
