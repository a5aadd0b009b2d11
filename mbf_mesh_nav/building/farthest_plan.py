"""A test plan on a built map: between the two places that are farthest from each other along the free surface."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.server.standing_server import place_robot, planned, read_config_or_map, standing_server
from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import FORBIDDEN_COST


@dataclass(frozen=True, eq=False)
class FarthestPlan:
    """The test plan of a map.

    Attributes
    ----------
    text : str
        What came out, one sentence.
    start, goal : tuple of float
        x, y and z [m]; both zero where no vertex is free.
    free_share : float
        Share of the vertices that are free in the default layers of a bare mesh.
    path : (n, 3) float64
        Positions [m]; none without a plan.
    """

    text: str
    success: bool
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    free_share: float
    path: FloatArray


def plan_farthest(map_file: Path) -> FarthestPlan:
    """Plan on a map file with the default configuration of a bare mesh, as ``mbf plan`` does."""
    cls, config, _ = read_config_or_map(map_file)
    with standing_server(cls, config) as server:
        mesh_map: MeshMap = server.served["mesh_map"].map  # type: ignore[attr-defined]
        free = ~mesh_map.snapshot().blocked(FORBIDDEN_COST)  # lethal alone would leave the ground beside obstacles
        free_share = float(free.mean())
        ends = farthest_vertices(mesh_map, free)
        if ends is None:
            nowhere = (0.0, 0.0, 0.0)
            return FarthestPlan("no vertex is free, so nothing can be planned", False, nowhere, nowhere, 0.0, NO_PATH)
        frame = config.parameters.global_frame
        start, goal = (Pose.planar(x, y, 0.0, z, frame_id=frame) for x, y, z in mesh_map.vertices[list(ends)].tolist())
        place_robot(server, start)
        result, _ = planned(server, GetPathGoal(goal))
    path = NO_PATH if result.path is None else np.asarray(result.path.positions, dtype=np.float64)
    length = "" if result.path is None else f", {result.path.length:.1f} m"
    text = f"{result.planner}: {result.outcome_name}{length} ({result.message})"
    return FarthestPlan(text, result.success, start.position, goal.position, free_share, path)


NO_PATH: FloatArray = np.zeros((0, 3))


def farthest_vertices(mesh_map: MeshMap, free: BoolArray) -> tuple[int, int] | None:
    """Two vertices far from each other along the edges of the largest free part; None if no vertex is free.

    The first is the farthest from any vertex of the part, the second the farthest from the first: on a tree they would
    be the two farthest of all.
    """
    if not free.any():
        return None
    count = mesh_map.topology.vertex_count
    start, end = mesh_map.topology.edges[free[mesh_map.topology.edges].all(axis=1)].T
    steps = mesh_map.vertices[start] - mesh_map.vertices[end]
    lengths = np.sqrt(np.sum(steps * steps, axis=1))
    graph = csr_array((lengths, (start, end)), (count, count))
    groups: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    sizes = np.bincount(groups[free])
    any_vertex = int(np.flatnonzero(free & (groups == sizes.argmax()))[0])
    first = _farthest_from(graph, any_vertex)
    return first, _farthest_from(graph, first)


def _farthest_from(graph: csr_array, vertex: int) -> int:
    distances = dijkstra(graph, directed=False, indices=vertex)
    return int(np.argmax(np.where(np.isfinite(distances), distances, -1.0)))
