"""Continuous wave over a triangle mesh: distances whose level sets cross faces instead of following edges.

The update rule is that of mesh_navigation's continuous vector planner: the triangle is unfolded into the plane, the
two known distances define a virtual source on the far side of their edge, and the third corner's distance is the
straight line to it if that line crosses the edge, else a walk along a side. The original compares the angles at the
third corner for that; where the line crosses the edge's own line gives the same answer without an arc cosine.

Deviations, each for accuracy:

- The original looks at a face once, when two of its corners are settled. At an obtuse corner the front may come
  through the side opposite to it, whose far end is settled last (Kimmel and Sethian 1998 split such corners). So an
  obtuse corner is looked at again once all three are settled.
- Where the path bends round a corner, the front behind it spreads from there, not from the source. So each vertex
  remembers its last bend, and the virtual source is found from the distances after it.
- Where two fronts meet, no virtual source describes both (``fronts.py``). Near the source, where an error is a large
  share, at obtuse corners and beside bends the corner behind the side is asked which of them goes on.
- A straight line may run along a side while no face at it has two known corners yet. So a vertex that turns out to be
  nearer along a side is taken once more.

Every vertex has a predecessor nearer to the source, so predecessors always lead there. Exact for a point source on
flat ground; on curved ground within 2 %, but for about one vertex in 5,000 on rough meshes. Cost: about 100 ns a
vertex.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.lowest_bit import BITS, lowest_bit
from mbf_mesh_nav.kernels.mesh.corners import ENDS, TWO, WEIGHTS, is_obtuse, prefetch_records
from mbf_mesh_nav.kernels.search.dijkstra import CANCEL_POLL_INTERVAL
from mbf_mesh_nav.kernels.wave.bucket_queue import (
    BUCKETS_PER_STEP,
    EMPTY,
    RING,
    entry_of,
    item_of,
    key_of,
    next_bucket,
    put,
    remove_least,
)
from mbf_mesh_nav.kernels.wave.due_faces import (
    ALL_SETTLED,
    ALONG_EDGES,
    FREE,
    ONE_FREE,
    SETTLED,
    THROUGH_FACES,
    THROUGH_SETTLED,
    due_faces,
)
from mbf_mesh_nav.kernels.wave.fronts import NO_BEND, distance_where_fronts_meet, unfolded_distance

ALONG_EDGE = -1
LARGE = 4_000  # vertices; of smaller meshes the nearest caches hold all
_ZERO: Any = np.float32(0)
NEAR_STEPS: Any = np.float32(10)  # typical edges from the source up to which all corners are asked for two fronts
_INFINITE: Any = np.float32(np.inf)


@kernel
def propagate_wave(
    vertex_face_offsets: IntArray,
    corner_ends: IntArray,
    corner_weights: Float32Array,
    obtuse_around: BoolArray,
    blocked: BoolArray,
    distances: Float32Array,
    predecessors: IntArray,
    cut_records: IntArray,
    bends: IntArray,
    seeds: IntArray,
    targets: IntArray,
    overshoot: float,
    step: float,
    cancel_flag: FlagArray,
    along_edges: bool = False,
) -> int:
    """Propagate a wave from ``seeds`` over the faces whose corners are all free.

    Parameters
    ----------
    vertex_face_offsets, corner_ends, corner_weights : (V+1,) int32, (6F,) int32, (9F,) float32
        Faces around a vertex as corner records with weights [m], see ``corners.py``, one after the other: an array
        with two dimensions costs a multiplication more.
    obtuse_around : (V,) bool
        Whether a face around a vertex has an obtuse corner elsewhere, see ``corners.write_corner_weights``.
    blocked : (V,) bool
        Vertices never entered.
    distances : (V,) float32
        In: 0 or a known distance [m] at the seeds, inf elsewhere. Out: weighted distances [m], inf where not reached.
    predecessors : (V,) int32
        Out: the nearer one (to the source) of the corners of the last crossed edge, or the end of the last followed
        edge; -1 at seeds and where not reached.
    cut_records : (V,) int32
        Out: the predecessor's corner record whose face the ray crosses, ``ALONG_EDGE`` where it follows an edge.
    bends : (V,) int32
        In: ``NO_BEND``. Out: the vertex at which the path to a vertex bends last, the centre of the front it came with.
    seeds : (s,) int32
        Start vertices; they keep their distances.
    targets : (t,) int32
        Once all of them are settled the wave goes on for ``overshoot`` [m] and ends; empty: the whole field.
    step : float
        Typical weight of an edge [m]: for the queue's buckets, where it changes the speed only, and for what is near
        the source, see ``NEAR_STEPS``.
    cancel_flag : (1,) uint8
        Polled; nonzero ends the call.
    along_edges : bool
        Whether the wave also walks along single edges of free vertices, where no free face leads on.

    Returns
    -------
    int
        Number of settled vertices, -1 if cancelled.
    """
    # 1. The queue (see ``bucket_queue.py``). A record adds one entry, three with edges; what is taken again none.
    state = blocked.astype(np.uint8)  # FREE, or 1 where it is blocked
    room = (3 if along_edges else 1) * (len(corner_ends) >> 1) + len(seeds)
    heads, links = np.empty(RING, dtype=np.int32), np.empty(room, dtype=np.int32)
    fill(heads, Count(EMPTY))
    entries, near = np.empty(room, dtype=np.uint64), np.empty(room, dtype=np.uint64)
    used, near_size, bucket = Index(0), Index(0), Count(0)
    inverse_width, near_source = BUCKETS_PER_STEP / np.float32(step), NEAR_STEPS * np.float32(step)
    for seed in seeds:
        entry = entry_of(distances[seed], Index(seed))
        used, near_size = put(heads, links, entries, near, used, near_size, bucket, inverse_width, entry)
        state[seed] = SETTLED  # their distances are exact from the start
    going_on = ALONG_EDGES if along_edges else THROUGH_FACES
    limit, is_large, pops, targets_settled = np.float32(np.inf), len(distances) > LARGE, 0, Index(0)
    nobody = awaited = Index(len(distances))  # the first target that is not settled; not known yet
    while True:
        # 2. The vertex with the least distance is settled; entries from before it was lowered are dropped.
        if near_size == Index(0):
            bucket, near_size = next_bucket(heads, links, entries, near, bucket, inverse_width)
        if near_size == Index(0) or key_of(near[0]) > limit:
            return pops
        vertex, key = item_of(near[0]), key_of(near[0])
        near_size = remove_least(near, near_size)
        if key != distances[vertex]:
            continue
        if pops % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
            return -1
        state[vertex] = SETTLED
        pops += 1
        if vertex == awaited or pops == 1:
            while targets_settled < Index(len(targets)) and state[Index(targets[targets_settled])] == SETTLED:
                targets_settled += ONE
                limit = np.float32(distances[vertex] + overshoot) if targets_settled == Index(len(targets)) else limit
            awaited = Index(targets[targets_settled]) if targets_settled < Index(len(targets)) else nobody
        # 3. Faces around it with one free corner propagate the wave; so do those with an obtuse corner, once more.
        u1, own_bend, sums = key, bends[vertex], going_on | THROUGH_SETTLED if obtuse_around[vertex] else going_on
        to_own_bend = distances[Index(own_bend)] if own_bend != NO_BEND else _ZERO
        begin, end = Index(vertex_face_offsets[vertex]), Index(vertex_face_offsets[vertex + ONE])
        while begin < end:
            chunk, begin = begin, min(begin + BITS, end)
            due = due_faces(corner_ends, state, chunk, begin, sums)
            while due != 0:
                record = chunk + lowest_bit(due)
                due &= due - ONE
                first, second = Index(corner_ends[record * ENDS]), Index(corner_ends[record * ENDS + ONE])
                to_first, to_second = corner_weights[record * WEIGHTS], corner_weights[record * WEIGHTS + ONE]
                between, states = corner_weights[record * WEIGHTS + TWO], state[first] + state[second]
                if states < ONE_FREE:
                    for side in range(2):
                        other, distance = (first, key + to_first) if side == 0 else (second, key + to_second)
                        if state[other] == FREE and distance < distances[other]:
                            distances[other], predecessors[other] = distance, vertex
                            cut_records[other], bends[other] = ALONG_EDGE, vertex
                            entry = entry_of(distances[other], other)
                            used, near_size = put(
                                heads, links, entries, near, used, near_size, bucket, inverse_width, entry
                            )
                    continue
                # An obtuse corner lies opposite to the longest side.
                is_second = (state[first] == FREE) | ((states == ALL_SETTLED) & (to_second > to_first))
                known, free = (second, first) if is_second else (first, second)
                to_known, to_free = (to_second, to_first) if is_second else (to_first, to_second)
                if states == ALL_SETTLED and not is_obtuse(to_known, to_free, between):
                    continue
                u2, bend = distances[known], bends[known]
                if u2 + to_known < u1 and predecessors[vertex] >= 0:
                    # No face had two known corners to bring the path along this side: the vertex is taken once more.
                    distances[vertex] = u2 + to_known
                    predecessors[vertex], cut_records[vertex], bends[vertex] = known, ALONG_EDGE, known
                    entry = entry_of(distances[vertex], vertex)
                    used, near_size = put(heads, links, entries, near, used, near_size, bucket, inverse_width, entry)
                    pops -= 1
                    begin = end
                    break
                to_bend = to_own_bend if bend == own_bend else _ZERO
                distance, side = unfolded_distance(u1 - to_bend, u2 - to_bend, to_known, to_free, between)
                distance += to_bend
                if not distance < distances[free]:
                    continue
                last_bend = Count(bend)
                if side == 0 and (bend != own_bend or distance < near_source or is_obtuse(to_known, to_free, between)):
                    distance, side, last_bend = distance_where_fronts_meet(
                        vertex_face_offsets, corner_ends, corner_weights, distances, bends, vertex, known, free,
                        to_free, between, distance,
                    )  # fmt: skip
                if (states == ALL_SETTLED and predecessors[free] < 0) or not distance < distances[free]:
                    continue  # a seed, or no gain
                nearer = vertex if side == 1 or (side == 0 and u1 < u2) else known
                if distance <= distances[nearer]:  # an obtuse corner close behind its long side
                    distance = np.nextafter(distances[nearer], _INFINITE)
                    if distance >= distances[free]:
                        continue
                distances[free] = distance
                bends[free] = last_bend if side == 0 else Count(nearer)
                predecessors[free] = nearer
                cut_records[free] = Count(record) if side == 0 else Count(ALONG_EDGE)
                if state[free] == FREE:
                    if is_large:  # its faces come from memory while it waits
                        prefetch_records(corner_ends, corner_weights, Index(vertex_face_offsets[free]))
                    entry = entry_of(np.float32(distance), free)
                    used, near_size = put(heads, links, entries, near, used, near_size, bucket, inverse_width, entry)
