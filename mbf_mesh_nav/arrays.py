"""Types of the arrays of a mesh, named by the numbers they hold; docstrings give the shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
FlagArray = NDArray[np.uint8]
"""Of one element: whether a search was cancelled."""
