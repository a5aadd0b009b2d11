"""Through which faces around a vertex a wave goes on, by the states of their corners: marked as bits, without branches.

A vertex is free, blocked or settled. No two pairs of states have the same sum, so the sum of the two other corners of a
face says what the face is to the wave.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Index, inlined_kernel
from mbf_mesh_nav.kernels.mesh.corners import ENDS

FREE, SETTLED = 0, 3
"""States; 1 is that of a blocked vertex."""
ONE_FREE, ALL_SETTLED = 3, 6
"""Sums of states: one other corner is settled and one free; both are settled."""
THROUGH_FACES: Any = Index(1 << ONE_FREE)
"""The sums with which a wave over faces goes on, as bits."""
ALONG_EDGES: Any = Index((2 << ONE_FREE) - 1)
"""The same for a wave that also walks along edges: all with a free corner, and those with none but blocked ones."""
THROUGH_SETTLED: Any = Index(1 << ALL_SETTLED)
"""The sum of faces that are looked at once more if they have an obtuse corner, as a bit."""


@inlined_kernel
def due_faces(corner_ends: IntArray, state: NDArray[np.uint8], begin: int, end: int, sums: int) -> int:
    """The records from ``begin`` to before ``end`` through which a wave goes on, as bits.

    Those whose sum of states is among the bits of ``sums``. A third of the records are, and nobody knows which, so this
    is without branches, see ``lowest_bit.py``.
    """
    due, ends = Index(0), end * ENDS
    for _ in range(begin, end):
        ends -= ENDS
        states = state[Index(corner_ends[ends])] + state[Index(corner_ends[ends + ONE])]
        due += due + ((sums >> states) & ONE)
    return due  # type: ignore[no-any-return]
