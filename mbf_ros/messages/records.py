"""Lists of equal messages whose fields are numbers of one kind, such as points and colours, kept as one array."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray

Record = dict[str, Any]


class Records(Sequence[Record]):
    """A list of messages by field name, made one by one as they are asked for.

    Parameters
    ----------
    array : (n, k) number
        The numbers of each message, in the order of its fields.
    kind : str
        Type of all fields.
    record : callable
        Makes a message of a row, given as a list.
    """

    def __init__(self, array: NDArray[Any], kind: str, record: Callable[[list[Any]], Record]) -> None:
        self.array, self.kind, self._record = array, kind, record

    def __len__(self) -> int:
        return len(self.array)

    def __iter__(self) -> Iterator[Record]:
        return map(self._record, self.array.tolist())

    @overload
    def __getitem__(self, index: int) -> Record: ...

    @overload
    def __getitem__(self, index: slice) -> Records: ...

    def __getitem__(self, index: int | slice) -> Record | Records:
        if isinstance(index, slice):
            return Records(self.array[index], self.kind, self._record)
        return self._record(self.array[index].tolist())


def points(values: FloatArray, kind: str = "float64") -> Records:
    """Return points (n, 3) as a list of geometry_msgs/Point, or with ``float32`` of Point32."""
    return Records(np.reshape(values, (-1, 3)), kind, lambda row: dict(zip("xyz", row, strict=True)))


def colors(values: FloatArray) -> Records:
    """Return red, green, blue and opacity (n, 4) as a list of std_msgs/ColorRGBA."""
    return Records(np.reshape(values, (-1, 4)), "float32", lambda row: dict(zip("rgba", row, strict=True)))


def triangles(faces: NDArray[Any]) -> Records:
    """Return indices (n, 3) as a list of mesh_msgs/MeshTriangleIndices."""
    return Records(np.reshape(faces, (-1, 3)), "uint32", lambda row: {"vertex_indices": np.array(row, np.uint32)})
