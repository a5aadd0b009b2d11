"""Weights of the moves of a drive graph: one pass over all of them, for each plan on a map whose costs have changed."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.vectors import Vector, row
from mbf_mesh_nav.kernels.search.heading_astar import Moves


@kernel
def weights_of_moves(
    vertices: FloatArray,
    moves: Moves,
    edges: IntArray,
    left: IntArray,
    right: IntArray,
    edge_weights: Float32Array,
    costs: Float32Array,
    edge_cost_factor: float,
    blocked: BoolArray,
) -> Float32Array:
    """Length plus collected cost (m,) float32 [m] of each move.

    Parameters
    ----------
    vertices : (V, 3) float64 [m]
    moves : Moves
        m moves.
    edges : (m,) int32
        Which edge of the mesh a move is, -1 for a stride.
    left, right : (m,) int32
        Ends of the edge that a stride crosses.
    edge_weights, costs, edge_cost_factor
        Of the snapshot: (2E,) float32 [m], (V,) float32, extra length per length and cost.
    blocked : (V,) bool
        A stride beside such a vertex is infinite.
    """
    weights = np.empty(len(edges), dtype=np.float32)
    for start in range(len(moves.offsets) - 1):
        for move in range(moves.offsets[start], moves.offsets[start + 1]):
            if edges[move] >= 0:
                weights[move] = edge_weights[edges[move]]
                continue
            end, a, b = Count(moves.ends[move]), Count(left[move]), Count(right[move])
            if blocked[start] or blocked[end] or blocked[a] or blocked[b]:
                weights[move] = np.inf
                continue
            # From vertex to crossing to vertex, each half at the mean of the costs at its ends.
            share = moves.shares[move]
            begin, one, other = row(vertices, Count(start)), row(vertices, a), row(vertices, b)
            crossing = (_between(one[0], other[0], share), _between(one[1], other[1], share),
                        _between(one[2], other[2], share))  # fmt: skip
            middle = _between(_finite(costs[a]), _finite(costs[b]), share)
            first = _length(begin, crossing) * (1.0 + edge_cost_factor * 0.5 * (costs[start] + middle))
            second = _length(row(vertices, end), crossing) * (1.0 + edge_cost_factor * 0.5 * (costs[end] + middle))
            weights[move] = first + second
    return weights


@inner_kernel
def _between(first: float, second: float, share: float) -> float:
    return (1.0 - share) * first + share * second


@inner_kernel
def _finite(cost: float) -> float:
    return cost if cost < np.inf else 0.0


@inner_kernel
def _length(start: Vector, end: Vector) -> float:
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    return math.sqrt(x * x + y * y + z * z)
