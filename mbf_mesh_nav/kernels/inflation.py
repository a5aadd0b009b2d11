"""Geodesic distance from lethal vertices over the surface, from scratch and repaired after a change.

The distance of a vertex is the fixed point of "the least of what the edges and the faces around it offer". A face
offers the arrival of a straight wave front (Kimmel and Sethian 1998, with the acceptance test of mesh_navigation), an
edge offers its length; the edge offers let an isolated lethal vertex spread, which mesh_navigation cannot. Since every
offer exceeds what it is made from, the fixed point is unique: vertices may be worked off in any order, and a repair
gives the same values as a new start.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import ONE, Index, inner_kernel, kernel

IntArray = NDArray[np.int32]
FloatArray = NDArray[np.float64]
CostArray = NDArray[np.float32]

RIGHT_ANGLE_TOLERANCE = 1e-9
_WAITING: Any = np.uint8(1)
_LOWERED: Any = np.uint8(2)


@kernel
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
def spread(
    vertices: FloatArray,
    faces: IntArray,
    face_offsets: IntArray,
    incident: IntArray,
    radius: float,
    step: float,
    start: IntArray,
    distances: CostArray,
    sources: IntArray,
) -> IntArray:
    """Lower ``distances`` (V,) and set ``sources`` (V, 2) until no vertex has a better offer from within ``radius``.

    Vertices to work off, at first ``start``, wait in a near list (below a threshold) or a far list; the threshold
    grows by ``step`` [m]. One ring of vertices beyond the radius gets a distance, too. Returns the vertices whose
    distance was lowered.
    """
    count = len(vertices)
    state = np.zeros(count, dtype=np.uint8)
    near, far, lowered = (
        np.empty(count, dtype=np.int32),
        np.empty(count, dtype=np.int32),
        np.empty(count, dtype=np.int32),
    )
    near_size, far_size, lowered_size = Index(0), Index(0), Index(0)
    for vertex in start:
        if state[vertex] & _WAITING == 0:
            state[vertex] |= _WAITING
            far[far_size] = vertex
            far_size += ONE
    while far_size > 0:
        # The next threshold starts at the least waiting distance, so empty ranges cost nothing.
        threshold = np.float32(np.inf)
        for index in range(far_size):
            threshold = min(threshold, distances[Index(far[index])])
        threshold += np.float32(step)
        kept = Index(0)
        for index in range(far_size):
            if distances[Index(far[index])] <= threshold:
                near[near_size] = far[index]
                near_size += ONE
            else:
                far[kept] = far[index]
                kept += ONE
        far_size = kept
        # The near list is a stack of everything below the threshold.
        while near_size > 0:
            near_size -= ONE
            vertex = Index(near[near_size])
            state[vertex] &= ~_WAITING
            reached = distances[vertex]
            if reached > radius:
                continue
            for position in range(Index(face_offsets[vertex]), Index(face_offsets[vertex + ONE])):
                face = Index(incident[position])
                for corner in range(3):
                    other = Index(faces[face, corner])
                    if distances[other] <= reached:
                        continue
                    # Corners in the order of the winding, so that rounding does not depend on who came first.
                    v1, v2 = Index(faces[face, (corner + 1) % 3]), Index(faces[face, (corner + 2) % 3])
                    d1 = float(distances[v1]) if distances[v1] <= radius else np.inf
                    d2 = float(distances[v2]) if distances[v2] <= radius else np.inf
                    exact, first, second = face_offer(vertices, other, v1, d1, v2, d2)
                    offer = np.float32(exact)
                    if not offer < distances[other]:
                        continue
                    distances[other] = offer
                    sources[other, 0], sources[other, 1] = first, second
                    if state[other] & _LOWERED == 0:
                        state[other] |= _LOWERED
                        lowered[lowered_size] = other
                        lowered_size += ONE
                    if state[other] & _WAITING != 0:
                        continue
                    state[other] |= _WAITING
                    if offer <= threshold:
                        near[near_size] = other
                        near_size += ONE
                    else:
                        far[far_size] = other
                        far_size += ONE
    return lowered[:lowered_size].copy()


@kernel
def forget_dependents(
    offsets: IntArray, neighbours: IntArray, removed: IntArray, distances: CostArray, sources: IntArray
) -> IntArray:
    """Set to inf every distance that came, directly or not, from the ``removed`` seeds; return those vertices."""
    forgotten = np.empty(distances.shape[0], dtype=np.int32)
    size = 0
    for index in range(removed.shape[0]):
        distances[removed[index]] = np.inf
        sources[removed[index], 0] = sources[removed[index], 1] = -1
        forgotten[size] = removed[index]
        size += 1
    head = 0
    while head < size:
        vertex = forgotten[head]
        head += 1
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = neighbours[entry]
            if sources[other, 0] == vertex or sources[other, 1] == vertex:
                distances[other] = np.inf
                sources[other, 0] = sources[other, 1] = -1
                forgotten[size] = other
                size += 1
    return forgotten[:size].copy()


@kernel
def finite_rim(offsets: IntArray, neighbours: IntArray, forgotten: IntArray, distances: CostArray) -> IntArray:
    """Vertices with a distance next to forgotten ones: where a repair starts."""
    size = 0
    for index in range(forgotten.shape[0]):
        size += offsets[forgotten[index] + 1] - offsets[forgotten[index]]
    rim = np.empty(size, dtype=np.int32)
    size = 0
    for index in range(forgotten.shape[0]):
        for entry in range(offsets[forgotten[index]], offsets[forgotten[index] + 1]):
            if distances[neighbours[entry]] < np.inf:
                rim[size] = neighbours[entry]
                size += 1
    return rim[:size].copy()
