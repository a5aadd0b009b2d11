"""Straight wave fronts over triangles laid down in the plane: predicting the distance of a corner from the known ones.

A front is known by its centre, the source or the corner round which its path bends last, and by the distances from
there. Two corners that one front has passed give its centre, a virtual source; the next corner is as far
as the straight line from there, if that line crosses the side between the two. Where the two were passed by different
fronts, the virtual source of both is a fiction. Then the corner behind their side helps: with the one of the two that
was passed by the same front it gives the centre of that front, and whether the front passes through the side.

Sides and distances are weighted lengths; where costs stretch them so that they form no triangle, no straight line has
a meaning. All is float32: a plain number in a formula would turn it into float64.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inner_kernel, plain_kernel
from mbf_mesh_nav.kernels.mesh.corners import ENDS, TWO, WEIGHTS

NO_BEND = -1
"""The path comes straight from the source."""
NOBODY = -1
MISMATCH: Any = np.float32(0.1)  # of a side: by how much later than predicted a front may reach the corner behind
SLACK: Any = np.float32(1.001)
PASSING: Any = np.float32(0.3)  # of a side: how far past the corner behind it a front may go that reached that corner
GRAZING: Any = np.float32(0.001)  # of a side: the same if the other path bends round that corner, so that it is an end
_ZERO: Any = np.float32(0)
_HALF: Any = np.float32(0.5)
_INFINITE: Any = np.float32(np.inf)


@inner_kernel
def _unfolded(u1: float, u2: float, c: float, b: float, a: float) -> tuple[float, float, float, float]:
    """Virtual source below side 12 (x, depth) and corner 3 above it (x, height); the x axis runs from 1 to 2.

    Differences of squares are written as products: far from the source float32 would lose them otherwise.
    """
    half_inverse = _HALF / c
    source_x = (c * c + (u1 - u2) * (u1 + u2)) * half_inverse
    corner_x = (c * c + (b - a) * (b + a)) * half_inverse
    source_depth = math.sqrt(max((u1 - source_x) * (u1 + source_x), _ZERO))
    corner_height = math.sqrt(max((b - corner_x) * (b + corner_x), _ZERO))
    return source_x, source_depth, corner_x, corner_height


@plain_kernel
def unfolded_distance(u1: float, u2: float, c: float, b: float, a: float) -> tuple[float, int]:
    """Distance of corner 3 of an unfolded triangle from the distances ``u1``, ``u2`` of corners 1 and 2.

    Parameters
    ----------
    u1, u2 : float
        Distances.
    c, b, a : float
        Lengths of the sides 12, 13 and 23.

    Returns
    -------
    distance : float32
        The candidate.
    side : int
        0 if the path crosses side 12, else the corner (1 or 2) from which it runs along a side.
    """
    source_x, source_depth, corner_x, corner_height = _unfolded(u1, u2, c, b, a)
    no_triangle = abs(source_x) > SLACK * u1 or abs(corner_x) > SLACK * b
    across = corner_height + source_depth
    crossing = source_x * corner_height + corner_x * source_depth  # times ``across``: where the ray crosses side 12
    if _ZERO < crossing < c * across and not no_triangle:
        along = corner_x - source_x
        return math.sqrt(across * across + along * along), 0
    return (u1 + b, 1) if u1 + b < u2 + a else (u2 + a, 2)


@inner_kernel
def corner_behind(
    offsets: IntArray, corner_ends: IntArray, corner_weights: Float32Array, vertex: int, known: int, free: int
) -> tuple[int, float, float, float]:
    """Return the corner behind the side from ``vertex`` to ``known``, that side, and the sides from there to both."""
    for record in range(Index(offsets[vertex]), Index(offsets[vertex + ONE])):
        ends, weights = record * ENDS, record * WEIGHTS
        first, second = Index(corner_ends[ends]), Index(corner_ends[ends + ONE])
        to_first, to_second = corner_weights[weights], corner_weights[weights + ONE]
        between = corner_weights[weights + TWO]
        if first == known and second != free:
            return Count(second), to_first, to_second, between
        if second == known and first != free:
            return Count(first), to_second, to_first, between
    return Count(NOBODY), _ZERO, _ZERO, _ZERO


@inner_kernel
def predicted_behind(u1: float, u2: float, c: float, b: float, a: float) -> float:
    """Distance that the virtual source of corners 1 and 2 predicts for the corner on its own side of side 12."""
    source_x, source_depth, corner_x, corner_depth = _unfolded(u1, u2, c, b, a)
    deeper, along = source_depth - corner_depth, source_x - corner_x
    return math.sqrt(deeper * deeper + along * along)


@inner_kernel
def distance_by_own_front(
    u: float, u_behind: float, c: float, b: float, a: float, to_free: float, between: float, passing: float
) -> float:
    """Distance of a corner beyond a side by the front that passed an end of the side and the corner behind it.

    The centre may lie on either side of the line from the end to the corner behind. It is taken to lie off the other
    end, which that front did not pass; so its ray enters between the two.

    Parameters
    ----------
    u, u_behind : float
        Distances from the front's centre to the end and to the corner behind.
    c, b, a : float
        The side; lengths from the corner behind it to the end and to the other one.
    to_free, between : float
        Lengths from the corner beyond the side to the end and to the other one.
    passing : float
        How far beyond the corner behind the ray may enter, by the other side.

    Returns
    -------
    float32
        Infinite if the front does not come through the side.
    """
    # The end is the origin, the x axis runs to the other one; the corner behind lies below, the free one above.
    half_inverse = _HALF / c
    behind_x = (c * c + (b - a) * (b + a)) * half_inverse
    behind_depth = math.sqrt(max((b - behind_x) * (b + behind_x), _ZERO))
    free_x = (c * c + (to_free - between) * (to_free + between)) * half_inverse
    free_height = math.sqrt(max((to_free - free_x) * (to_free + free_x), _ZERO))
    towards = (b * b + (u - u_behind) * (u + u_behind)) * (_HALF / b)
    missed: float = _INFINITE
    if abs(towards) > SLACK * u:
        return missed
    aside = math.sqrt(max((u - towards) * (u + towards), _ZERO)) if u_behind > _ZERO else _ZERO
    source_x = (towards * behind_x - aside * behind_depth) / b
    source_depth = (towards * behind_depth + aside * behind_x) / b
    across, along = free_height + source_depth, free_x - source_x
    crossing = source_x * free_height + free_x * source_depth
    if not (source_depth > _ZERO and _ZERO < crossing < c * across):
        return missed
    length = math.sqrt(across * across + along * along)
    if along * (source_depth - behind_depth) - across * (behind_x - source_x) > passing * length:
        return missed
    return length


@inner_kernel
def distance_where_fronts_meet(
    offsets: IntArray,
    corner_ends: IntArray,
    corner_weights: Float32Array,
    distances: Float32Array,
    bends: IntArray,
    vertex: int,
    known: int,
    free: int,
    to_free: float,
    between: float,
    virtual: float,
) -> tuple[float, int, int]:
    """Distance of the corner ``free`` beyond the side from ``vertex`` to ``known``, if two fronts may meet there.

    Parameters
    ----------
    offsets, corner_ends, corner_weights, distances, bends
        See ``cvp.propagate_wave``.
    to_free, between : float
        Lengths from ``free`` to ``vertex`` and to ``known``.
    virtual : float
        Distance by the virtual source of both ends.

    Returns
    -------
    distance, side, bend
        Side as of ``unfolded_distance``; the last bend of a path through the side.
    """
    own_bend, bend = Count(bends[vertex]), Count(bends[known])
    along_vertex, along_known = distances[vertex] + to_free, distances[known] + between
    best, side, last_bend = (along_vertex, 1, NO_BEND) if along_vertex < along_known else (along_known, 2, NO_BEND)
    # 1. Without a face behind the side, or before the wave came there, nothing comes through the side.
    behind, c, b, a = corner_behind(offsets, corner_ends, corner_weights, vertex, known, free)
    if behind == NOBODY or distances[behind] == _INFINITE:
        return best, side, last_bend
    # 2. One front has reached the corner behind about when its virtual source predicts it.
    if bend == own_bend:
        to_bend = distances[bend] if bend != NO_BEND else _ZERO
        predicted = predicted_behind(distances[vertex] - to_bend, distances[known] - to_bend, c, b, a)
        if distances[behind] - to_bend - predicted < MISMATCH * c:
            return virtual, 0, bend
    # 3. Of two fronts either may come through the side.
    for end in range(2):
        front, other = (own_bend, bend) if end == 0 else (bend, own_bend)
        if behind != front and bends[behind] != front:
            continue
        to_center = distances[front] if front != NO_BEND else _ZERO
        passing = (GRAZING if behind == other else PASSING) * c
        to_end, to_other = (b, a) if end == 0 else (a, b)
        u = to_end if behind == front else (distances[vertex] if end == 0 else distances[known]) - to_center
        from_end, from_other = (to_free, between) if end == 0 else (between, to_free)
        distance = to_center + distance_by_own_front(
            u, distances[behind] - to_center, c, to_end, to_other, from_end, from_other, passing
        )
        if distance < best:
            best, side, last_bend = distance, 0, front
    # 4. Beside a bend the fronts before and behind it differ little, so their virtual source is a fair guess; but not
    #    alone if another one is known, or if it predicts the corner before an end of the side that it comes through.
    if bend == own_bend or best <= virtual:
        return best, side, last_bend
    if side != 0 and virtual >= max(distances[vertex], distances[known]):
        return virtual, 0, NO_BEND
    return _HALF * (virtual + best), 0, last_bend
