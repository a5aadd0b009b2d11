"""A* over (vertex, heading): the same hill may be climbed straight up and forbidden sideways.

A state is ``vertex * HEADINGS + heading``. The robot turns on the spot to the heading of a move, over headings that
are all allowed there, and drives the move: along an edge, or straight across two faces. That costs the move's weight,
lengthened by the roll it brings, plus the turn. Whether the tilt allows a move at its very heading, all along it, is
found out once: when a search wants to take it, or for a path that a search has found.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, inner_kernel, plain_kernel
from mbf_mesh_nav.kernels.layers.chassis import Chassis, Scratch
from mbf_mesh_nav.kernels.layers.footprint_sweep import move_use
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.search.dijkstra import CANCEL_POLL_INTERVAL
from mbf_mesh_nav.kernels.search.goal_bound import GoalBound, bound_at
from mbf_mesh_nav.kernels.search.indexed_heap import push_or_decrease, remove_top, top_item, top_key

HEADINGS = 16
HEADING_STEP = 2.0 * math.pi / HEADINGS
UNKNOWN, DRIVABLE, FORBIDDEN = 0, 1, 2
"""What is known of a move."""


class Moves(NamedTuple):
    """What can be driven straight from vertex to vertex, m moves in the order of their first vertex.

    Attributes
    ----------
    offsets : (V+1,) int32
        The moves of a vertex begin there.
    ends : (m,) int32
        Vertices they lead to.
    headings : (m,) uint8
        0 to 15.
    shares : (m,) float64
        Where a move crosses the edge between two faces, see ``search.drive_graph``; NaN for one along an edge.
    """

    offsets: IntArray
    ends: IntArray
    headings: NDArray[np.uint8]
    shares: FloatArray


@plain_kernel
def search_with_heading(
    surface: Surface,
    moves: Moves,
    weights: Float32Array,
    blocked: BoolArray,
    allowed: BoolArray,
    roll: Float32Array,
    roll_cost: float,
    turning_cost: float,
    distances: Float32Array,
    predecessors: IntArray,
    seeds: IntArray,
    targets: IntArray,
    target_offsets: Float32Array,
    target_headings: IntArray,
    bound: GoalBound,
    known: NDArray[np.uint8],
    chassis: Chassis,
    scratch: Scratch,
    find_out: bool,
    heap: NDArray[np.uint64],
    positions: IntArray,
    cancel_flag: FlagArray,
) -> tuple[int, float]:
    """Relax ``distances`` and ``predecessors`` in place until the best target state is settled.

    Parameters
    ----------
    surface
    moves, weights : Moves, (m,) float32 [m]
        What can be driven, and at what cost.
    blocked : (V,) bool
        Vertices that are never entered.
    allowed, roll : (V, 16) bool, (V, 16) float32 [rad]
        Where the robot may stand with which heading, and how it rolls there.
    roll_cost, turning_cost : float
        Extra lengths per length and rad of roll; extra length [m] per rad turned.
    distances, predecessors : (16 V,) float32 [m], (16 V,) int32
        Per state; inf and -1 except at seeds.
    seeds : (s,) int32
        Start states.
    targets, target_offsets : (t,) int32, (t,) float32 [m]
        Goal vertices and what is left from them to the goal.
    target_headings : (t,) int32
        Turning to it at the goal vertex costs, too, and has to be allowed; -1 = any heading will do.
    bound : GoalBound
        Of the costs to the goal.
    known : (m,) uint8
        Whether a move may be driven.
    chassis, scratch
        The robot and its limits, and memory, see ``footprint_sweep``.
    find_out : bool
        Whether an ``UNKNOWN`` move is looked at and the answer written to ``known``, or counts as drivable.
    heap, positions : (16 V,) uint64, (16 V,) int32
        Memory for states that wait, of any content; -1 everywhere.
    cancel_flag : (1,) uint8

    Returns
    -------
    state : int
        The best target state, -1 if there is none, -2 if cancelled.
    total : float
        Cost of the path there [m], the rest to the goal and the last turn included.
    """
    size = Count(0)
    for seed in seeds:
        key = distances[seed] + bound_at(bound, Index(seed // HEADINGS))
        size = push_or_decrease(heap, positions, size, Index(seed), key)
    best_state, best_total = -1, np.inf
    settled = 0
    while size > 0 and top_key(heap) < best_total:
        if settled % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
            return -2, np.inf
        state = Count(top_item(heap))
        size = remove_top(heap, positions, size)
        settled += 1
        vertex, heading = state // HEADINGS, state % HEADINGS
        for i in range(len(targets)):
            if targets[i] == vertex:
                turn = 0 if target_headings[i] < 0 else _shortest_turn(heading, Count(target_headings[i]))
                total = distances[state] + target_offsets[i] + turning_cost * HEADING_STEP * abs(turn)
                if total < best_total and _may_turn(allowed, vertex, heading, turn):
                    best_state, best_total = state, total
        for slot in range(moves.offsets[vertex], moves.offsets[vertex + 1]):
            neighbour, new_heading = moves.ends[slot], Count(moves.headings[slot])
            if blocked[neighbour] or not allowed[neighbour, new_heading]:
                continue
            turn = _shortest_turn(heading, new_heading)
            if not _may_turn(allowed, vertex, heading, turn):
                continue
            drive = weights[slot] * (1.0 + roll_cost * abs(roll[neighbour, new_heading]))
            candidate = np.float32(distances[state] + drive + turning_cost * HEADING_STEP * abs(turn))
            following = neighbour * HEADINGS + new_heading
            if candidate < distances[following]:
                if find_out and known[slot] == UNKNOWN:
                    use = move_use(surface, chassis, scratch, Count(vertex), Count(neighbour), moves.shares[slot])
                    known[slot] = DRIVABLE if use <= 1.0 else FORBIDDEN
                if known[slot] == FORBIDDEN:
                    continue
                distances[following] = candidate
                predecessors[following] = state
                key = candidate + bound_at(bound, Index(neighbour))
                size = push_or_decrease(heap, positions, size, Index(following), key)
    return best_state, best_total


@plain_kernel
def find_out_along(
    surface: Surface, moves: Moves, chain: IntArray, known: NDArray[np.uint8], chassis: Chassis, scratch: Scratch
) -> bool:
    """Find out which moves between the vertices ``chain`` (n,) int32 may be driven; return whether all of them may.

    The other arguments are those of ``search_with_heading``.
    """
    drivable = True
    for place in range(len(chain) - 1):
        vertex, following = chain[place], chain[place + 1]
        slot = Count(moves.offsets[vertex])
        while moves.ends[slot] != following:
            slot += 1
        if known[slot] == UNKNOWN:
            use = move_use(surface, chassis, scratch, Count(vertex), Count(following), moves.shares[slot])
            known[slot] = DRIVABLE if use <= 1.0 else FORBIDDEN
        drivable = drivable and known[slot] == DRIVABLE
    return drivable


@inner_kernel
def _shortest_turn(heading: int, new_heading: int) -> int:
    """Steps to turn from one heading to another the short way, left positive."""
    turn = (int(new_heading) - int(heading)) % HEADINGS
    return turn if turn <= HEADINGS // 2 else turn - HEADINGS


@inner_kernel
def _may_turn(allowed: BoolArray, vertex: int, heading: int, turn: int) -> bool:
    """Whether all headings the robot passes, the new one included, are allowed at the vertex."""
    step = 1 if turn > 0 else -1
    for passed in range(1, abs(turn) + 1):
        if not allowed[vertex, (heading + step * passed) % HEADINGS]:
            return False
    return True
