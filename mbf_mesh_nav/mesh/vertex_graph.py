"""The mesh as a networkx graph, for users' own algorithms.

Use it to try an idea in ten lines. Do not use it in a loop of a running robot: it costs about a kilobyte a vertex
and its searches are some hundred times slower than the planners on the flat arrays.
"""

from __future__ import annotations

import networkx
import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array
from mbf_mesh_nav.mesh.topology import MeshTopology


def vertex_names(topology: MeshTopology) -> NDArray[np.int64]:
    """Name (V,) of every vertex as a node of the graph: the caller's number if it has one.

    Vertices that densifying or a repair made have none; they are called ``-1 - internal number``.
    """
    internal = np.arange(topology.vertex_count)
    return np.where(topology.internal_to_input >= 0, topology.internal_to_input, -1 - internal)


def build_vertex_graph(topology: MeshTopology, costs: Float32Array, edge_weights: Float32Array) -> networkx.Graph[int]:
    """Graph whose nodes are the caller's vertex numbers, see ``vertex_names``.

    Parameters
    ----------
    costs : (V,) float32
        Becomes the node attribute ``cost``; ``position`` is the (x, y, z) tuple [m].
    edge_weights : (2E,) float32
        Becomes the edge attribute ``weight``, beside ``length`` [m]. Impassable edges (infinite) are left out.
    """
    names = vertex_names(topology).tolist()
    graph: networkx.Graph[int] = networkx.Graph()
    positions = topology.vertices.tolist()
    graph.add_nodes_from(
        (name, {"position": tuple(position), "cost": cost})
        for name, position, cost in zip(names, positions, costs.tolist(), strict=True)
    )
    starts = np.repeat(np.arange(topology.vertex_count), np.diff(topology.neighbour_offsets))
    once = (starts < topology.neighbours) & np.isfinite(edge_weights)
    graph.add_edges_from(
        (names[start], names[end], {"weight": weight, "length": length})
        for start, end, weight, length in zip(
            starts[once].tolist(),
            topology.neighbours[once].tolist(),
            edge_weights[once].tolist(),
            topology.neighbour_lengths[once].tolist(),
            strict=True,
        )
    )
    return graph
