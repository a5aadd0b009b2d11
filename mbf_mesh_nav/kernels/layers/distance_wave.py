"""A wave of distances that is lowered, and taken back where what it was made from changes.

Every distance names the one or two vertices it was made from. When one of those gets another distance, what was made
from it is dropped, directly or not, and made anew. So a vertex has at any time what its neighbours offer now, and the
order in which vertices are worked off changes the time only. It is that of ``near_far.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inlined_kernel, inner_kernel
from mbf_mesh_nav.kernels.layers.front_offers import comes_first
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.search.near_far import IN_FAR, IN_NEAR, UNQUEUED, after, raise_threshold

TOUCHED: Any = np.uint8(1)
"""Flag of a vertex that is listed as touched."""
UNUSED: Any = np.uint8(2)
"""Flag of a vertex that has offered nothing since its distance was set: nothing was made from it."""
DROPPED: Any = np.uint8(4)
"""Flag of a vertex that is listed as dropped."""
TOUCHED_COUNT, DROPPED_COUNT, HEAD, TAIL, FAR_COUNT = range(5)
"""Places in ``Wave.counts``."""


class Wave(NamedTuple):
    """The arrays of a wave.

    ``distances`` (V,) float32 [m], inf where there is none, and ``made_from`` (V, 3) int32, the vertices each was made
    from and its centre, -1 without, are the result. ``flags`` (V,) uint8; ``touched`` and ``dropped`` (V,) int32 lists.
    ``near``, ``far`` and ``queued`` are ``near``, ``far`` and ``state`` of ``near_far``. ``counts`` (5,) uint64 has
    their lengths, ``limits`` (2,) float32 the threshold and the reach [m].
    """

    distances: Float32Array
    made_from: IntArray
    flags: NDArray[np.uint8]
    touched: IntArray
    dropped: IntArray
    near: IntArray
    far: IntArray
    queued: NDArray[np.uint8]
    counts: NDArray[np.uint64]
    limits: Float32Array


@inner_kernel
def touch(wave: Wave, vertex: int) -> None:
    """List a vertex as touched."""
    if wave.flags[vertex] & TOUCHED == 0:
        wave.touched[wave.counts[TOUCHED_COUNT]] = vertex
        wave.counts[TOUCHED_COUNT] += ONE
        wave.flags[vertex] |= TOUCHED


@inner_kernel
def enqueue(wave: Wave, vertex: int) -> None:
    """Let a vertex wait for its turn to offer; without room in the far list it is near."""
    queued, counts = wave.queued[vertex], wave.counts
    is_far = wave.distances[vertex] >= wave.limits[0] and counts[FAR_COUNT] < Index(len(wave.far))
    if queued == IN_NEAR or (is_far and queued == IN_FAR):
        return
    if is_far:
        wave.queued[vertex] = IN_FAR
        wave.far[counts[FAR_COUNT]] = vertex
        counts[FAR_COUNT] += ONE
        return
    wave.queued[vertex] = IN_NEAR
    wave.near[counts[TAIL]] = vertex
    counts[TAIL] = after(counts[TAIL], wave.near)


@inner_kernel
def is_any_due(wave: Wave, step: np.float32) -> bool:
    """Whether a vertex waits in the near list; if none does, and any in the far list, the threshold is raised."""
    counts, limits = wave.counts, wave.limits
    if counts[HEAD] == counts[TAIL] and counts[FAR_COUNT] > 0:
        counts[TAIL], counts[FAR_COUNT], limits[0] = raise_threshold(
            wave.near, wave.far, wave.queued, wave.distances, counts[TAIL], counts[FAR_COUNT], limits[0], step
        )
    return bool(counts[HEAD] != counts[TAIL])


@inlined_kernel
def next_vertex(wave: Wave) -> int:
    """Take the vertex whose turn it is off the near list."""
    vertex = Index(wave.near[wave.counts[HEAD]])
    wave.counts[HEAD] = after(wave.counts[HEAD], wave.near)
    wave.queued[vertex] = UNQUEUED
    wave.flags[vertex] &= ~UNUSED
    return vertex  # type: ignore[no-any-return]


@inner_kernel
def drop(wave: Wave, vertex: int) -> None:
    """Take the distance of a vertex back and list it as dropped."""
    wave.distances[vertex] = np.float32(np.inf)
    wave.made_from[vertex, 0] = wave.made_from[vertex, 1] = wave.made_from[vertex, 2] = -1
    touch(wave, vertex)
    if wave.queued[vertex] == IN_FAR:  # where keys have to be finite
        wave.queued[vertex] = UNQUEUED
    if wave.flags[vertex] & DROPPED == 0:
        wave.dropped[wave.counts[DROPPED_COUNT]] = vertex
        wave.counts[DROPPED_COUNT] += ONE
        wave.flags[vertex] |= DROPPED


@inner_kernel
def drop_dependents(surface: Surface, wave: Wave, vertex: int) -> None:
    """Drop every distance that was made, directly or not, from that of ``vertex``."""
    offsets, made_from = surface.neighbour_offsets, wave.made_from
    reader, giver = wave.counts[DROPPED_COUNT], Index(vertex)
    while True:
        for slot in range(Index(offsets[giver]), Index(offsets[giver + ONE])):
            other = Index(surface.neighbours[slot])
            if Index(made_from[other, 0]) == giver or Index(made_from[other, 1]) == giver:
                drop(wave, other)
        if reader == wave.counts[DROPPED_COUNT]:
            return
        giver = Index(wave.dropped[reader])
        reader += ONE


@inner_kernel
def lower(surface: Surface, wave: Wave, vertex: int, distance: np.float32, v1: int, v2: int, centre: int) -> None:
    """Set a distance if it is lower, or as low and of a front that comes first, and drop what was made of the other."""
    before, made_from = wave.distances[vertex], wave.made_from
    if distance > wave.limits[1] or distance > before:
        return
    if distance == before and not comes_first(surface.vertices, centre, Count(made_from[vertex, 2])):
        return
    wave.distances[vertex] = distance
    made_from[vertex, 0], made_from[vertex, 1], made_from[vertex, 2] = v1, v2, centre
    touch(wave, vertex)
    is_used = before < np.inf and wave.flags[vertex] & UNUSED == 0
    wave.flags[vertex] |= UNUSED
    enqueue(wave, vertex)
    if is_used:
        drop_dependents(surface, wave, vertex)
