"""The exact cost from one cell to all others on an 8-connected grid, by near and far lists instead of a heap.

When to use: potentials (navfn's job, the heuristic of ``hybrid_astar``), and any question about many cells. When not:
one goal, where ``grid_search`` settles far fewer cells.

Cells below a threshold wait in the near list and are relaxed until none is left; the others wait in the far list. Then
the threshold grows by a few steps and the far list is looked through (Davidson, Baxter, Garland, Owens 2014). A
cell whose value drops is put back, so the result is exact. Costs and padding are those of ``grid_search``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.grid_search import CANCELED, EXHAUSTED, FOUND, SQRT2

THRESHOLD_STEP = np.float32(4.0)
"""Growth of the threshold [free cells]."""
IDLE, NEAR, FAR = np.uint8(0), np.uint8(1), np.uint8(2)


@kernel
def distance_field(
    cells: NDArray[np.uint8],
    stride: int,
    table: NDArray[np.float32],
    source: int,
    until: int,
    cut_corners: bool,
    cancel_flag: NDArray[np.uint8],
) -> tuple[int, NDArray[np.float32]]:
    """Spread from ``source`` over everything reachable, or until the cell ``until`` has its final value.

    Parameters
    ----------
    cells, stride, table, cut_corners, cancel_flag
        As for ``grid_search.search``.
    source, until : int
        Flat padded indices; ``until`` = -1 spreads everywhere.

    Returns
    -------
    status : int
        FOUND (``until`` has its value), EXHAUSTED (everything reachable has) or CANCELED.
    g : (n,) float32
        Cost from the source in traversal times cells, inf where not reached; upper bounds above the threshold if
        the spreading ended early.
    """
    g = np.full(cells.size, np.float32(np.inf), dtype=np.float32)
    halves = (np.float32(0.5) * table).astype(np.float32)
    state = np.zeros(cells.size, dtype=np.uint8)
    # A cell is at most once in each list: its state says in which, and above the threshold it never was below it.
    near = np.empty(cells.size, dtype=np.int32)
    following = np.empty(cells.size, dtype=np.int32)
    far = np.empty(cells.size, dtype=np.int32)
    near[0], g[source], state[source] = source, 0.0, NEAR
    near_count, far_count = 1, 0
    threshold = THRESHOLD_STEP
    straight = np.array([1, -1, stride, -stride])

    while near_count > 0:
        if cancel_flag[0] != 0:
            return CANCELED, g
        # 1. Relax the cells of the near list; what falls below the threshold makes up the next near list.
        following_count = 0
        for i in range(near_count):
            cell = near[i]
            state[cell] = IDLE
            g_cell, here = g[cell], halves[cells[cell]]
            for k in range(4):
                # Two neighbours a round: a straight one, and the diagonal one a turn further.
                side = straight[k]
                quarter = straight[3 - k] if k < 2 else straight[k - 2]
                half_side = halves[cells[cell + side]]
                reached_side = g_cell + here + half_side
                diagonal = cell + side + quarter
                reached_diagonal = g_cell + SQRT2 * (here + halves[cells[diagonal]])
                if not cut_corners and np.isinf(half_side + halves[cells[cell + quarter]]):
                    reached_diagonal = np.float32(np.inf)
                for neighbour, g_new in ((cell + side, reached_side), (diagonal, reached_diagonal)):
                    if g_new >= g[neighbour]:
                        continue
                    g[neighbour] = g_new
                    if g_new < threshold:
                        if state[neighbour] != NEAR:
                            state[neighbour] = NEAR
                            following[following_count] = neighbour
                            following_count += 1
                    elif state[neighbour] != FAR:
                        state[neighbour] = FAR
                        far[far_count] = neighbour
                        far_count += 1
        near, following, near_count = following, near, following_count

        # 2. Nothing is left below the threshold, so all of it is final: raise it until the far list yields cells.
        while near_count == 0 and far_count > 0:
            if until >= 0 and g[until] < threshold:
                return FOUND, g
            threshold += THRESHOLD_STEP
            kept = 0
            for i in range(far_count):
                cell = far[i]
                if state[cell] != FAR:  # came below the threshold meanwhile
                    continue
                if g[cell] < threshold:
                    state[cell] = NEAR
                    near[near_count] = cell
                    near_count += 1
                else:
                    far[kept] = cell
                    kept += 1
            far_count = kept
    return (FOUND if until >= 0 and g[until] < np.inf else EXHAUSTED), g
