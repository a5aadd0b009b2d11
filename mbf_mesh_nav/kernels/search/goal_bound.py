"""What a search over (vertex, heading) still has to pay, from below: the path to the goal without its turns.

A wave from the goal over moves taken backwards, each at what driving it costs with its roll, ends a little beyond the
start. Where it has settled, its distance is the bound. Where it has not, the triangle through the start is: a vertex
outside the wave is so far away that no path over it costs less than ``settled_below``. Both never overestimate and
never drop by more than a move costs, so A* with them settles a state once (Hart, Nilsson and Raphael 1968).

When to use: searches whose states are many times the vertices, which pays for the wave. When not: A* over vertices, for
which the wave is the whole search.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.search.dijkstra import straight_line_bound

_ROUNDING = np.float32(1.0 - 1e-5)  # of some thousand sums of float32, once from each side


class Arrivals(NamedTuple):
    """The moves of a drive graph by the vertex they lead to.

    Attributes
    ----------
    offsets : (V+1,) int32
        The moves to a vertex begin there.
    origins, moves : (m,) int32
        Vertices they come from, and which moves they are.
    """

    offsets: IntArray
    origins: IntArray
    moves: IntArray


class GoalBound(NamedTuple):
    """Lower bounds of the costs to the goal.

    Attributes
    ----------
    distances : (V,) float32
        Costs [m] of the path from a vertex to the goal, turns left out, where the wave has settled.
    settled_below : float
        The wave has settled where the distance and the straight line to ``start`` sum up to less than this [m].
    vertices : (V, 3) float64
    start, goal : (3,) float64
        [m]
    """

    distances: Float32Array
    settled_below: float
    vertices: FloatArray
    start: FloatArray
    goal: FloatArray


@inner_kernel
def bound_at(bound: GoalBound, vertex: int) -> np.float32:
    """Costs [m] from a vertex to the goal, at least."""
    from_start = straight_line_bound(bound.vertices, vertex, bound.start)
    distance = bound.distances[vertex]
    if distance + from_start < bound.settled_below:
        return np.float32(distance * _ROUNDING)
    outside = (np.float32(bound.settled_below) - from_start) * _ROUNDING
    straight = straight_line_bound(bound.vertices, vertex, bound.goal)
    return outside if outside > straight else straight


@kernel
def weights_of_arrivals(
    arrivals: Arrivals,
    headings: NDArray[np.uint8],
    weights: Float32Array,
    allowed: BoolArray,
    roll: Float32Array,
    roll_cost: float,
    known: NDArray[np.uint8],
    forbidden: int,
) -> Float32Array:
    """Cost (m,) float32 [m] of each arrival with its roll, infinite where it is forbidden.

    ``headings`` (m,) are those of the moves; the other arguments are those of ``heading_astar.search_with_heading``.
    """
    towards = np.empty(len(arrivals.moves), dtype=np.float32)
    for vertex in range(len(arrivals.offsets) - 1):
        for slot in range(Index(arrivals.offsets[vertex]), Index(arrivals.offsets[vertex + 1])):
            move = arrivals.moves[slot]
            heading = headings[move]
            if known[move] != forbidden and allowed[vertex, heading]:
                towards[slot] = weights[move] * (1.0 + roll_cost * abs(roll[vertex, heading]))
            else:
                towards[slot] = np.inf
    return towards
