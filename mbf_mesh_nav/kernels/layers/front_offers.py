"""What the faces around a vertex offer it, once wave fronts of a distance have passed two of their corners.

A front is known by what it comes from. A *circular* one has a centre: a source, or a vertex round which paths bend.
Laid flat, the distances of two corners from one centre give its place beside the face (a virtual source), so the
third corner is measured straight from there, however its angles are: exact where the surface can be laid flat, and
never less than a way over it. A *straight* one comes from an edge between sources, or from where two fronts meet; its
centre is only the source that is nearest. Over two corners of different fronts a straight one is laid, see
``straight_arrival``; where it would be ahead of both fronts, the straight line in space to their centres counts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, inner_kernel, plain_kernel

STRAIGHT: Any = Count(2**30)
"""Added to the centre of a straight front."""
GRAZING = 0.2
"""By how much of the side a circular front may miss it and pass nonetheless.

On ground that is not flat, lines from one centre to vertices in a row miss all sides by a little. What is measured is
shorter than the bent line by the square of this, about a fiftieth of an edge.
"""
ALONG_EDGE = 1e-2
"""Share of the side from its end within which a straight front is one along the edge from there."""
OBTUSE = -0.05
"""An angle is obtuse, where two straight fronts meet, if its cosine is below about twice this."""
DIRECT = 0.99999
"""Factor of the last piece of a line from a centre: of two ways as long, but for rounding, the one without a bend is
taken."""


@plain_kernel
def straight_arrival(d1: float, d2: float, bb: float, aa: float, dot: float) -> tuple[float, bool]:
    """Distance of corner v3 by a straight front that passed v1, v2 at ``d1``, ``d2``, and whether it came nearer to v1.

    Parameters
    ----------
    d1, d2 : float
        Distances of v1 and v2 [m].
    bb, aa : float
        Squared lengths of the edges v3-v1 and v3-v2 [m^2].
    dot : float
        Inner product of the edge vectors v1-v3 and v2-v3 [m^2].

    Notes
    -----
    Kimmel and Sethian 1998. With t = d3 - d1 and u = d2 - d1: ``cc t^2 + 2 u (dot - bb) t + bb u^2 - (aa bb - dot^2)
    = 0``, larger root, accepted if ``u < t`` and the front comes through between the two edges. Unlike in
    mesh_navigation the angle at v3 may be obtuse.
    """
    u = d2 - d1
    cc = aa + bb - 2.0 * dot
    half = u * (dot - bb)
    discriminant = half * half - cc * (bb * u * u - (aa * bb - dot * dot))
    if discriminant < 0.0 or cc <= 0.0:
        return np.inf, True
    t = (-half + np.sqrt(discriminant)) / cc
    share1, share2 = aa * t - dot * (t - u), bb * (t - u) - dot * t
    least = ALONG_EDGE * (share1 + share2)
    if u < t and share1 > least and share2 > least:
        return d1 + t, share1 >= share2
    return np.inf, True


@plain_kernel
def circular_arrival(r1: float, r2: float, bb: float, aa: float, dot: float) -> float:
    """Distance of corner v3 from the centre of a front that passed v1, v2 at ``r1``, ``r2``; inf if it misses the face.

    Parameters as of ``straight_arrival``, but for the distances [m], which are from the centre.

    Notes
    -----
    Surazhsky et al. 2005, section 3.1. v1 is the origin, the x axis runs to v2, all is scaled by the length of that
    side; v3 lies above it and the centre below.
    """
    cc, corner_x = aa + bb - 2.0 * dot, bb - dot
    center_x = 0.5 * (cc + (r1 - r2) * (r1 + r2))
    below, above = cc * r1 * r1 - center_x * center_x, aa * bb - dot * dot
    if below < -GRAZING * cc * cc or above <= 0.0:
        return np.inf
    depth, height = np.sqrt(max(below, 0.0)), np.sqrt(above)
    crossing, across = center_x * height + corner_x * depth, cc * (depth + height)
    if crossing < -GRAZING * across or crossing > (1.0 + GRAZING) * across:
        return np.inf
    return np.sqrt(r1 * r1 + bb - 2.0 * (center_x * corner_x - depth * height) / cc)  # type: ignore[no-any-return]


@inner_kernel
def squared_length(vertices: FloatArray, start: int, end: int) -> float:
    """Squared length [m^2] of the straight line between two vertices, the same both ways."""
    squared = 0.0
    for axis in range(3):
        step = vertices[end, axis] - vertices[start, axis]
        squared += step * step
    return squared


@inner_kernel
def comes_first(vertices: FloatArray, front: int, other: int) -> bool:
    """Whether, of two fronts as far, the first one counts: by kind and place, which no numbering changes."""
    if front == other or (front >= STRAIGHT) != (other >= STRAIGHT):
        return front < other
    first, second = Index(front & ~STRAIGHT), Index(other & ~STRAIGHT)
    for axis in range(3):
        if vertices[first, axis] != vertices[second, axis]:
            return bool(vertices[first, axis] < vertices[second, axis])
    return front < other


@inner_kernel
def centre_beyond(made_from: IntArray, vertex: int) -> int:
    """Centre of the front behind a vertex, along an edge: a straight one stays so, a circular one bends there."""
    centre = Count(made_from[vertex, 2])
    return centre if centre >= STRAIGHT else Count(vertex)  # type: ignore[no-any-return]


@inner_kernel
def pair_offer(
    vertices: FloatArray,
    distances: Float32Array,
    made_from: IntArray,
    vertex: int,
    v1: int,
    v2: int,
    limit: float,
) -> tuple[np.float32, int]:
    """Return the distance that a face offers its corner ``vertex`` by the fronts at both others, and its centre.

    Infinite if no front passes, or if it comes to a corner of the side no sooner than to ``vertex``. Beyond ``limit``
    [m] it may be any that is.
    """
    d1, d2 = float(distances[v1]), float(distances[v2])
    front, other = Count(made_from[v1, 2]), Count(made_from[v2, 2])
    aa = bb = dot = 0.0
    for axis in range(3):
        to_v1 = vertices[v1, axis] - vertices[vertex, axis]
        to_v2 = vertices[v2, axis] - vertices[vertex, axis]
        bb += to_v1 * to_v1
        aa += to_v2 * to_v2
        dot += to_v1 * to_v2
    if front == other and front < STRAIGHT:
        to_centre = float(distances[Index(front)])
        arrival = to_centre + circular_arrival(d1 - to_centre, d2 - to_centre, bb, aa, dot)
        arrival += (DIRECT - 1.0) * (arrival - max(d1, d2))
    else:
        arrival, is_nearer_first = straight_arrival(d1, d2, bb, aa, dot)
        straight = (front if is_nearer_first else other) | STRAIGHT
        is_of_one_wall = d1 + d2 == 0.0 or (min(front, other) >= STRAIGHT and dot >= OBTUSE * (aa + bb))
        if arrival <= limit and not is_of_one_wall:
            arrival, front = _where_fronts_meet(
                vertices, distances, vertex, front, other, arrival, straight, bb, aa, dot
            )
        else:
            front = straight
    offer = np.float32(arrival)
    if offer > distances[v1] and offer > distances[v2]:
        return offer, front
    return np.float32(np.inf), front


@inner_kernel
def _where_fronts_meet(
    vertices: FloatArray,
    distances: Float32Array,
    vertex: int,
    front: int,
    other: int,
    arrival: float,
    straight: int,
    bb: float,
    aa: float,
    dot: float,
) -> tuple[float, int]:
    """Return the distance by the straight front laid over two others, and its centre, but ahead of neither.

    Over an angle of more than 135 degrees a straight front could be ahead by half the side, so none is laid.
    """
    if max(front, other) >= STRAIGHT and dot < 0.0 and dot * dot > 0.5 * aa * bb:
        return np.inf, straight
    cc = aa + bb - 2.0 * dot
    least = _least_arrival(vertices, distances, vertex, front, cc)
    least_of_other = _least_arrival(vertices, distances, vertex, other, cc)
    if least_of_other < least or (least_of_other == least and comes_first(vertices, other, front)):
        least, front = least_of_other, other
    return (least, front) if least > arrival else (arrival, straight)


@inner_kernel
def _least_arrival(vertices: FloatArray, distances: Float32Array, vertex: int, front: int, cc: float) -> float:
    """Distance that a vertex has from a front at least: along the straight line in space from its centre.

    A straight front comes from beside its centre, by an edge at most; ``cc`` is the square of an edge's length.
    """
    centre = Index(front & ~STRAIGHT)
    squared = squared_length(vertices, centre, vertex)
    if front >= STRAIGHT:
        squared = max(squared - cc, 0.0)
    return float(distances[centre]) + np.sqrt(squared)  # type: ignore[no-any-return]
