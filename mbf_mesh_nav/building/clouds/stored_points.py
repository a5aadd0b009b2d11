"""What every reader of a point cloud gives, and the checks that all of them share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.mesh.mesh_report import MeshError


class StoredPoints(NamedTuple):
    """Contents of one file.

    Attributes
    ----------
    points : (n, 3) float64
        In the coordinates and units of the file.
    single_precision : bool
        Whether the file holds four-byte floats.
    notes : tuple of str
        What a user should know, e.g. how many points were marked as noise.
    unit : float
        Length [m] of the file's unit if the file states it, else 0.
    crs : str
        Coordinate system that the file states, as "EPSG:25832" or by its name; "" = none.
    """

    points: FloatArray
    single_precision: bool = False
    notes: tuple[str, ...] = ()
    unit: float = 0.0
    crs: str = ""


def refuse_count(path: Path, count: int, max_points: int) -> None:
    """Refuse a file by the number of points that its header promises.

    Raises
    ------
    MeshError
        No point, or more than ``max_points``.
    """
    if count < 0:
        raise MeshError(str(path), [f"its header promises {count} points"])
    if count > max_points:
        raise MeshError(str(path), [f"{count} points, the limit is {max_points} (max_points)"])


def read_records(path: Path, file: BinaryIO, record: np.dtype[np.void], count: int) -> NDArray[np.void]:
    """Read ``count`` binary records from the present place of a file; none is read if they are not all there.

    Raises
    ------
    MeshError
        The file is cut off, or a record has no field.
    """
    if record.itemsize == 0:
        raise MeshError(str(path), ["its points have no properties"])
    found = bytes_left(file) // record.itemsize
    if found < count:
        raise MeshError(str(path), [f"the file is cut off: expected {count} points, found {found}"])
    return np.fromfile(file, dtype=record, count=count)


def bytes_left(file: BinaryIO) -> int:
    """Bytes from the present place of a file to its end."""
    return os.fstat(file.fileno()).st_size - file.seek(0, os.SEEK_CUR)


def coordinates(path: Path, records: NDArray[np.void]) -> StoredPoints:
    """Take the fields x, y and z out of records.

    Raises
    ------
    MeshError
        One of them is missing or is no single number.
    """
    names = records.dtype.names or ()
    if missing := [name for name in "xyz" if name not in names]:
        text = f"its points have no {', '.join(missing)}; they have: {', '.join(names) or 'nothing'}"
        raise MeshError(str(path), [text])
    kinds = [records.dtype[name] for name in "xyz"]
    if any(kind.shape for kind in kinds):
        raise MeshError(str(path), ["x, y and z are not single numbers"])
    points = np.empty((len(records), 3), dtype=np.float64)
    for axis, name in enumerate("xyz"):
        points[:, axis] = records[name]
    return StoredPoints(points, any(kind == np.float32 for kind in (kind.newbyteorder("=") for kind in kinds)))
