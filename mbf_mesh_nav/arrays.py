"""Types of the arrays of a mesh, named by the numbers they hold, and the set of the numbers of one.

Docstrings give the shapes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
FlagArray = NDArray[np.uint8]
"""Of one element: whether a search was cancelled."""


def sorted_once(numbers: IntArray) -> IntArray:
    """Return the different ones of some numbers, of any shape, ascending: ``np.unique``, which hashes and is slower."""
    ascending = np.sort(numbers, axis=None)
    is_new = np.ones(len(ascending), dtype=np.bool_)
    np.not_equal(ascending[1:], ascending[:-1], out=is_new[1:])
    return ascending[is_new]
