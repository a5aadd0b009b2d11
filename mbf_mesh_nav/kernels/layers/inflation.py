"""Geodesic distance from lethal vertices over the surface, from scratch and repaired after a change.

The distance of a vertex is the fixed point of "the least of what the edges and the faces around it offer". A face
offers the arrival of a straight wave front (Kimmel and Sethian 1998, with the acceptance test of mesh_navigation), an
edge offers its length; the edge offers let an isolated lethal vertex spread, which mesh_navigation cannot. Since every
offer exceeds what it is made from, the fixed point is unique: vertices may be worked off in any order, and a repair
gives the same values as a new start. The order is first come, first served: the waves are only some rings wide, and a
stack visits a fifth more.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inner_kernel, kernel, plain_kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.search.near_far import after

RIGHT_ANGLE_TOLERANCE = 1e-9
_WAITING: Any = np.uint8(1)
_TOUCHED: Any = np.uint8(2)


@plain_kernel
def front_arrival(d1: float, d2: float, bb: float, aa: float, dot: float) -> float:
    """Distance of corner v3 offered by its face whose corners v1, v2 are at ``d1``, ``d2``; inf if the front misses it.

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
    With t = d3 - d1 and u = d2 - d1: ``cc t^2 + 2 u (dot - bb) t + bb u^2 - (aa bb - dot^2) = 0``, larger root,
    accepted if ``u < t`` and the front comes through between the two edges.
    """
    u = d2 - d1
    cc = aa + bb - 2.0 * dot
    half = u * (dot - bb)
    discriminant = half * half - cc * (bb * u * u - (aa * bb - dot * dot))
    if discriminant < 0.0 or cc <= 0.0 or dot < -RIGHT_ANGLE_TOLERANCE * (aa + bb):
        return np.inf
    t = (-half + np.sqrt(discriminant)) / cc
    if u < t and dot * t < bb * (t - u) and dot * (t - u) < aa * t:
        arrival: float = d1 + t
        return arrival
    return np.inf


@inner_kernel
def face_offer(vertices: FloatArray, vertex: int, v1: int, d1: float, v2: int, d2: float) -> tuple[float, int, int]:
    """Return the least distance one face offers its corner ``vertex``, and the one or two corners it comes from."""
    aa = bb = dot = 0.0
    for axis in range(3):
        to_v1 = vertices[v1, axis] - vertices[vertex, axis]
        to_v2 = vertices[v2, axis] - vertices[vertex, axis]
        bb += to_v1 * to_v1
        aa += to_v2 * to_v2
        dot += to_v1 * to_v2
    arrival = front_arrival(d1, d2, bb, aa, dot) if d1 < np.inf and d2 < np.inf else np.inf
    along_first, along_second = d1 + np.sqrt(bb), d2 + np.sqrt(aa)
    if arrival < min(along_first, along_second):
        return arrival, v1, v2
    if along_first <= along_second:
        return along_first, v1, v1
    return along_second, v2, v2


@kernel
def update_sources(
    lethal: BoolArray,
    costs: Float32Array,
    source_cost: np.float32,
    changed: IntArray,
    known_lethal: BoolArray,
    is_source: BoolArray,
) -> IntArray:
    """Bring the flags of changed vertices up to date: lethal as the input, a source if lethal or costly.

    Parameters
    ----------
    lethal, costs : (V,) bool, (V,) float32
        Of the input.
    source_cost : np.float32
        Cost from which a vertex is a source.
    changed : (c,) int32
    known_lethal, is_source : (V,) bool
        Changed in place.

    Returns
    -------
    (k,) int32
        Vertices whose lethal flag changed, but not whether they are a source; in the order of ``changed``.
    """
    flipped = np.empty(len(changed), dtype=np.int32)
    size = Index(0)
    for changed_vertex in changed:
        vertex = Index(changed_vertex)
        source_now = lethal[vertex] or costs[vertex] >= source_cost
        if lethal[vertex] != known_lethal[vertex] and source_now == is_source[vertex]:
            flipped[size] = vertex
            size += ONE
        known_lethal[vertex], is_source[vertex] = lethal[vertex], source_now
    return flipped[:size].copy()


@kernel
def repair_distances(
    surface: Surface,
    radius: float,
    lethal: BoolArray,
    known_lethal: BoolArray,
    changed: IntArray,
    distances: Float32Array,
    sources: IntArray,
) -> tuple[IntArray, int]:
    """Bring the distances up to date after some vertices became lethal or ceased to be; from scratch is a case of it.

    Parameters
    ----------
    radius : float
        Vertices farther [m] get no distance.
    lethal, known_lethal : (V,) bool
        The flags now, and those the distances are of; the latter are brought up to date.
    changed : (c,) int32
        Vertices whose flags may differ.
    distances, sources : (V,) float32 [m], (V, 2) int32
        Distance to the nearest lethal vertex (inf beyond the radius) and the one or two vertices it was made from
        (-1 without); changed in place.

    Returns
    -------
    touched : (t,) int32
        Vertices whose flag or distance changed, or may have; those whose flag did come first.
    flips : int
        Number of vertices whose flag changed.
    """
    vertices, faces, face_offsets = surface.vertices, surface.faces, surface.vertex_face_offsets
    neighbour_offsets, neighbours = surface.neighbour_offsets, surface.neighbours
    count, reach = len(vertices), np.float32(radius)
    touched = np.empty(count, dtype=np.int32)
    queue = np.empty(count + 1, dtype=np.int32)
    state = np.empty(count, dtype=np.uint8)
    fill(state, Count(0))
    size, head, tail = Index(0), Index(0), Index(0)
    # 1. New lethal vertices are at distance 0, former ones at none.
    for changed_vertex in changed:
        vertex = Index(changed_vertex)
        if lethal[vertex] == known_lethal[vertex]:
            continue
        known_lethal[vertex] = lethal[vertex]
        distances[vertex] = np.float32(0.0) if lethal[vertex] else np.float32(np.inf)
        sources[vertex, 0] = sources[vertex, 1] = -1
        state[vertex] = _TOUCHED
        touched[size] = vertex
        size += ONE
    flips = size
    # 2. Invalidate every distance that came, directly or not, from a former one.
    reader = Index(0)
    while reader < size:
        vertex = Index(touched[reader])
        reader += ONE
        if lethal[vertex]:
            continue
        for slot in range(Index(neighbour_offsets[vertex]), Index(neighbour_offsets[vertex + ONE])):
            other = Index(neighbours[slot])
            if Index(sources[other, 0]) == vertex or Index(sources[other, 1]) == vertex:
                distances[other] = np.inf
                sources[other, 0] = sources[other, 1] = -1
                state[other] = _TOUCHED
                touched[size] = other
                size += ONE
    # 3. Offers come from the boundary of new lethal regions, and from what is known beside the invalidated.
    for index in range(size):
        vertex = Index(touched[index])
        for slot in range(Index(neighbour_offsets[vertex]), Index(neighbour_offsets[vertex + ONE])):
            other = Index(neighbours[slot])
            offering = vertex if lethal[vertex] else other
            offers = distances[other] > 0.0 if lethal[vertex] else distances[other] < np.inf
            if offers and state[offering] & _WAITING == 0:
                state[offering] |= _WAITING
                queue[tail] = offering
                tail = after(tail, queue)
    # 4. Vertices that were lowered offer to the faces around it, first come first served, until nothing is lowered.
    while head != tail:
        vertex = Index(queue[head])
        head = after(head, queue)
        state[vertex] &= ~_WAITING
        reached = distances[vertex]
        for position in range(Index(face_offsets[vertex]), Index(face_offsets[vertex + ONE])):
            face = Index(surface.vertex_faces[position])
            for corner in range(3):
                other = Index(faces[face, corner])
                if distances[other] <= reached:
                    continue
                # Corners in the order of the winding, so that rounding does not depend on the order of arrival.
                v1, v2 = Index(faces[face, (corner + 1) % 3]), Index(faces[face, (corner + 2) % 3])
                exact, first, second = face_offer(vertices, other, v1, distances[v1], v2, distances[v2])
                offer = np.float32(exact)
                if offer > reach or not offer < distances[other]:
                    continue
                distances[other] = offer
                sources[other, 0], sources[other, 1] = first, second
                if state[other] & _TOUCHED == 0:
                    touched[size] = other
                    size += ONE
                if state[other] & _WAITING == 0:
                    queue[tail] = other
                    tail = after(tail, queue)
                state[other] = _TOUCHED | _WAITING
    return touched[:size].copy(), Count(flips)
