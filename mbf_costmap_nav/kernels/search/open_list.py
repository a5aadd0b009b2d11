"""The open list of the grid searches: a ring of buckets of equal width.

A bucket keeps the cells whose key (g, or g + h) lies in its interval (Dial 1969, Denardo and Fox 1979). Inside a bucket
the order is free; a cell whose g drops later is put back, so results are exact (label correcting, as in delta
stepping; Meyer and Sanders 2003).

Speed comes from two habits. A bucket is relaxed as a whole, and the cells that improved are sorted into buckets
afterwards, so the inner loop has one counter. And nothing in it is a branch: whether a neighbour improves is as good as
random, so an "if" would be mispredicted every other time. Hence every neighbour is written down in ``fresh`` and the
counter only moves on if it improved, and blocked cells simply cost inf.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel, plain_kernel
from mbf_costmap_nav.kernels.search.padded_grid import INF, SQRT2, Integer

RING = 128
"""Buckets of the ring; a power of two."""
IDLE = np.uint8(255)
"""State of a cell that waits in no bucket; any other value is the bucket's place in the ring."""


@plain_kernel
def bucket_width(table: NDArray[np.float32], steps: float) -> np.float32:
    """Width at which the ring holds a growth of the key by ``steps`` of the heaviest diagonal steps, at least 1.

    A step costs 1 or more, so at width 1 no cell falls back into the bucket it is reached from unless a heuristic
    takes the step's cost away again. Wider buckets, which only large costs need, stay exact but relax cells twice.
    """
    heaviest = np.float32(0.0)
    for weight in table:
        if heaviest < weight < INF:
            heaviest = weight
    return np.float32(max(1.0, float(steps * SQRT2 * heaviest / (RING - 3))))


@kernel
def enlarged_if_full(buckets: NDArray[np.int32], counts: NDArray[np.int64], added: Integer) -> NDArray[np.int32]:
    """Buckets (RING, capacity) that hold ``added`` more each; the given array where that does already."""
    fullest = counts[0]
    for slot in range(1, RING):
        fullest = max(fullest, counts[slot])
    needed = fullest + added
    if needed <= buckets.shape[1]:
        return buckets
    larger = np.empty((RING, 2 * needed), dtype=np.int32)
    for slot in range(RING):
        for place in range(counts[slot]):
            larger[slot, place] = buckets[slot, place]
    return larger
