"""Geodesic distance from lethal vertices over the surface, from scratch and repaired after a change.

The distance of a vertex is the fixed point of "the least of what the edges and the faces around it offer": an edge
offers its length, a face what the fronts that passed its other two corners make of them (``front_offers``). Since every
offer exceeds what it is made from, the fixed point is unique, though a lower distance of another front may offer more:
vertices may be worked off in any order, and a repair gives the same values as a new start (``distance_wave``).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inlined_kernel, inner_array_kernel, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.layers.distance_wave import (
    DROPPED,
    DROPPED_COUNT,
    TOUCHED_COUNT,
    UNUSED,
    Wave,
    drop,
    drop_dependents,
    enqueue,
    is_any_due,
    lower,
    next_vertex,
    touch,
)
from mbf_mesh_nav.kernels.layers.front_offers import centre_beyond, pair_offer, squared_length
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.search.near_far import UNQUEUED

STEP: Any = np.float32(0.125)
"""Share of the radius by which the threshold of the near list grows: about an edge on usual maps."""
_NOT_LONGER: Any = np.float32(0.998)
"""Of a squared length: an edge that is longer than the gap by more offers nothing, whatever is rounded."""


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
    made_from: IntArray,
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
    distances, made_from : (V,) float32 [m], (V, 3) int32
        Distance to the nearest lethal vertex or edge (inf beyond the radius), the one or two vertices it was made from
        and the centre of its front (-1 without); changed in place.

    Returns
    -------
    touched : (t,) int32
        Vertices whose flag or distance changed, or may have; those whose flag did come first.
    flips : int
        Number of vertices whose flag changed.
    """
    wave = _wave_of(distances, made_from, np.float32(radius))
    counts, touched, dropped, step = wave.counts, wave.touched, wave.dropped, STEP * wave.limits[1]
    # 1. New lethal vertices are at distance 0, former ones at none.
    for changed_vertex in changed:
        vertex = Index(changed_vertex)
        if lethal[vertex] != known_lethal[vertex]:
            known_lethal[vertex] = lethal[vertex]
            _flip(wave, vertex, lethal[vertex])
    flips = Index(counts[TOUCHED_COUNT])
    # 2. Drop every distance that came, directly or not, from what they had before.
    for index in range(flips):
        vertex = Index(touched[index])
        if not lethal[vertex]:
            drop(wave, vertex)
        if wave.flags[vertex] & UNUSED == 0:
            drop_dependents(surface, wave, vertex)
    # 3. Offers come from the boundary of new lethal regions, and from what is known beside the vertices dropped.
    for index in range(flips):
        vertex = Index(touched[index])
        if lethal[vertex] and _is_at_boundary(surface, distances, vertex):
            enqueue(wave, vertex)
    for index in range(Index(counts[DROPPED_COUNT])):
        _enqueue_beside(surface, wave, Index(dropped[index]))
    counts[DROPPED_COUNT] = Index(0)
    # 4. Vertices that were lowered offer to those around them, about in the order of their distance, until none is.
    while is_any_due(wave, step):
        vertex = next_vertex(wave)
        if distances[vertex] < np.inf:
            _offer_along_edges(surface, wave, vertex)
            _offer_across_faces(surface, wave, vertex)
        for index in range(Index(counts[DROPPED_COUNT])):
            _take_best_offer(surface, wave, Index(dropped[index]))
        counts[DROPPED_COUNT] = Index(0)
    return touched[: Index(counts[TOUCHED_COUNT])].copy(), Count(flips)


@inner_array_kernel
def _wave_of(distances: Float32Array, made_from: IntArray, reach: np.float32) -> Wave:
    """Return a wave in which nothing waits."""
    count = len(distances)
    flags, queued = np.empty(count, dtype=np.uint8), np.empty(count, dtype=np.uint8)
    touched, dropped = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    near, far = np.empty(count + 1, dtype=np.int32), np.empty(count, dtype=np.int32)
    counts, limits = np.empty(5, dtype=np.uint64), np.empty(2, dtype=np.float32)
    fill(flags, Count(0))
    fill(queued, Count(UNQUEUED))
    fill(counts, Index(0))
    limits[0], limits[1] = np.float32(0.0), reach
    return Wave(distances, made_from, flags, touched, dropped, near, far, queued, counts, limits)


@inlined_kernel
def _flip(wave: Wave, vertex: int, is_lethal: bool) -> None:
    """Set a vertex that became lethal, or ceased to be."""
    if wave.distances[vertex] == np.inf:
        wave.flags[vertex] |= UNUSED
    wave.distances[vertex] = np.float32(0.0) if is_lethal else np.float32(np.inf)
    wave.made_from[vertex, 0] = wave.made_from[vertex, 1] = -1
    wave.made_from[vertex, 2] = vertex if is_lethal else -1
    touch(wave, vertex)


@inner_kernel
def _is_at_boundary(surface: Surface, distances: Float32Array, vertex: int) -> bool:
    """Whether a lethal vertex has a neighbour that is not."""
    for slot in range(Index(surface.neighbour_offsets[vertex]), Index(surface.neighbour_offsets[vertex + ONE])):
        if distances[Index(surface.neighbours[slot])] > 0.0:
            return True
    return False


@inner_kernel
def _enqueue_beside(surface: Surface, wave: Wave, vertex: int) -> None:
    """Let the neighbours of a dropped vertex that have a distance offer theirs once more."""
    wave.flags[vertex] &= ~DROPPED
    for slot in range(Index(surface.neighbour_offsets[vertex]), Index(surface.neighbour_offsets[vertex + ONE])):
        other = Index(surface.neighbours[slot])
        if wave.distances[other] < np.inf:
            enqueue(wave, other)


@inlined_kernel
def _offer_along_edges(surface: Surface, wave: Wave, vertex: int) -> None:
    """Lower the vertices around one along its edges."""
    reached, centre = wave.distances[vertex], centre_beyond(wave.made_from, vertex)
    for slot in range(Index(surface.neighbour_offsets[vertex]), Index(surface.neighbour_offsets[vertex + ONE])):
        other = Index(surface.neighbours[slot])
        gap = wave.distances[other] - reached
        if gap > 0.0:
            squared = squared_length(surface.vertices, vertex, other)
            if gap * gap > _NOT_LONGER * squared:
                lower(surface, wave, other, np.float32(reached + np.sqrt(squared)), vertex, vertex, centre)


@inlined_kernel
def _offer_across_faces(surface: Surface, wave: Wave, vertex: int) -> None:
    """Lower the farthest corners of the faces around a vertex by the fronts at the other two.

    Where the third corner waits it offers the same later.
    """
    distances, offsets = wave.distances, surface.vertex_face_offsets
    reached = distances[vertex]
    for position in range(Index(offsets[vertex]), Index(offsets[vertex + ONE])):
        v1, v2 = _other_corners(surface, Index(surface.vertex_faces[position]), vertex)
        far, near, first, second = (v1, v2, v2, vertex) if distances[v1] > distances[v2] else (v2, v1, vertex, v1)
        if distances[far] > reached and distances[far] > distances[near] and wave.queued[near] == UNQUEUED:
            limit = min(distances[far], wave.limits[1])
            offer, centre = pair_offer(surface.vertices, distances, wave.made_from, far, first, second, limit)
            lower(surface, wave, far, offer, first, second, centre)


@inner_kernel
def _take_best_offer(surface: Surface, wave: Wave, vertex: int) -> None:
    """Give a dropped vertex the least of what is offered around it; what is set anew itself offers when it is due."""
    vertices, distances, flags, made_from = surface.vertices, wave.distances, wave.flags, wave.made_from
    flags[vertex] &= ~DROPPED
    for position in range(Index(surface.vertex_face_offsets[vertex]), Index(surface.vertex_face_offsets[vertex + ONE])):
        v1, v2 = _other_corners(surface, Index(surface.vertex_faces[position]), vertex)
        offers1 = distances[v1] < distances[vertex] and flags[v1] & UNUSED == 0
        offers2 = distances[v2] < distances[vertex] and flags[v2] & UNUSED == 0
        for giver, offers in ((v1, offers1), (v2, offers2)):
            if offers:
                offer = np.float32(distances[giver] + np.sqrt(squared_length(vertices, giver, vertex)))
                lower(surface, wave, vertex, offer, giver, giver, centre_beyond(made_from, giver))
        if offers1 and offers2:
            limit = min(distances[vertex], wave.limits[1])
            offer, centre = pair_offer(vertices, distances, made_from, vertex, v1, v2, limit)
            lower(surface, wave, vertex, offer, v1, v2, centre)


@inner_kernel
def _other_corners(surface: Surface, face: int, vertex: int) -> tuple[int, int]:
    """Return the other two corners of a face in the order of its winding, so that rounding is always the same."""
    v0, v1, v2 = Index(surface.faces[face, 0]), Index(surface.faces[face, 1]), Index(surface.faces[face, 2])
    return (v1, v2) if v0 == vertex else (v2, v0) if v1 == vertex else (v0, v1)
