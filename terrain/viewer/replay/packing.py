"""Arrays as text in a page: differences, split into planes of bytes, compressed by zlib, in base64.

Neighbouring vertices, faces and poses differ little, so that the high bytes of their differences are nearly all zero
and the planes compress well. ``page/data.js`` reverses each step.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray

MILLI = 1e3
UNIT = 32767  # of int16, for quaternions


class Packer:
    """Collects arrays of integers; each is known to the page by its number."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._entries: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any]) -> int:
        """Add integers (n,) or (n, k) and return their number."""
        columns = np.atleast_2d(values.T)
        differences = np.diff(columns, axis=1, prepend=columns.dtype.type(0))
        planes = differences.reshape(-1, 1).view(np.uint8).T
        self._parts.append(np.ascontiguousarray(planes).tobytes())
        shape = {"type": columns.dtype.name, "columns": columns.shape[0], "rows": columns.shape[1]}
        self._entries.append(shape)
        return len(self._entries) - 1

    def add_milli(self, values: FloatArray) -> int:
        """Add numbers in thousandths of their unit, as int32."""
        return self.add(np.round(np.asarray(values) * MILLI).astype(np.int32))

    def add_unit(self, values: FloatArray) -> int:
        """Add numbers between -1 and 1, as int16."""
        return self.add(np.round(np.asarray(values) * UNIT).astype(np.int16))

    def entries(self) -> list[dict[str, Any]]:
        """Type and size of each array, in order."""
        return self._entries

    def text(self) -> str:
        """All arrays, compressed, in base64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 9)).decode("ascii")
