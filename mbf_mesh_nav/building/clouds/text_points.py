"""Tables of coordinates: .xyz, .txt, .csv and .pts, separated by blanks, tabs, commas or semicolons.

A header line may name the columns; without one the first three are x, y and z. Lines that begin with # or // are left
out, and so is the first line of a .pts file, which holds the number of its points.
"""

from __future__ import annotations

import os
import warnings
from codecs import BOM_UTF8
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.building.clouds.stored_points import StoredPoints, refuse_count
from mbf_mesh_nav.mesh.mesh_report import MeshError

NAMES = {
    "x": ("x", "easting", "e", "east", "x[m]"),
    "y": ("y", "northing", "n", "north", "y[m]"),
    "z": ("z", "height", "elevation", "h", "z[m]"),
}
"""What header lines call the coordinates, in lower case."""
COMMENTS = ("#", "//")
LONGEST_LINE = 4096
HEAD_LINES = 100
CHUNK_BYTES = 2**24


def read_text_points(path: Path, max_points: int) -> StoredPoints:
    """Read a table of coordinates.

    Raises
    ------
    MeshError
        A row without three numbers, more than ``max_points`` rows, or a header that names no x, y and z.
    """
    with path.open("rb") as file:
        begin = len(BOM_UTF8) if file.read(len(BOM_UTF8)) == BOM_UTF8 else 0  # spreadsheets write it
        file.seek(begin)
        skipped, columns, delimiter = _layout(path, file)
        file.seek(begin)
        lines = 0
        while chunk := file.read(CHUNK_BYTES):
            lines += chunk.count(b"\n")
            refuse_count(path, lines - skipped, max_points)
        file.seek(begin)
        for _ in range(skipped):
            file.readline()
        return StoredPoints(read_rows(path, file, columns, delimiter))


def read_rows(
    path: Path, file: BinaryIO, columns: tuple[int, int, int], delimiter: str | None, count: int | None = None
) -> FloatArray:
    """Read the rows of numbers from the present place of a file on.

    Parameters
    ----------
    columns : tuple of int
        Where x, y and z stand in a row.
    delimiter : str, optional
        Blanks and tabs without it.
    count : int, optional
        How many rows to read; all without it.

    Raises
    ------
    MeshError
        A row has no such columns or holds something that is no number, or there are fewer than ``count`` rows.
    """
    start = file.seek(0, os.SEEK_CUR)
    rows = file if count is None else islice((line for line in file if line.strip()), count)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "loadtxt: input contained no data")
        try:
            points: FloatArray = np.loadtxt(
                rows,
                dtype=np.float64,
                comments=COMMENTS,
                delimiter=delimiter,
                usecols=columns,
                ndmin=2,
                encoding="latin-1",
            )
        except ValueError as error:
            reason = _first_wrong_row(file, start, columns, delimiter) or f"expected a table of numbers: {error}"
            raise MeshError(str(path), [reason]) from error
    if count is not None and len(points) < count:
        raise MeshError(str(path), [f"the file is cut off: expected {count} points, found {len(points)}"])
    return points.reshape(-1, 3)


def _first_wrong_row(file: BinaryIO, start: int, columns: tuple[int, int, int], delimiter: str | None) -> str:
    """What is wrong with the first row from byte ``start`` on that has no numbers in three columns; "" = none."""
    file.seek(0)
    before, least = file.read(start).count(b"\n"), max(columns) + 1
    for number, line in enumerate(file, before + 1):
        text = line.decode("latin-1")
        for comment in COMMENTS:
            text = text.split(comment)[0]
        words = text.split(delimiter)
        if not text.strip():
            continue
        if len(words) < least:
            return f"line {number}: expected at least {least} columns, got {len(words)}"
        for column in columns:
            if not _is_number(words[column]):
                return f"line {number}, column {column + 1}: expected a number, got '{words[column].strip():.40}'"
    return ""


def _layout(path: Path, file: BinaryIO) -> tuple[int, tuple[int, int, int], str | None]:
    """Lines before the first row, the columns of x, y and z, and the delimiter (None for blanks)."""
    for number in range(HEAD_LINES):
        line = file.readline(LONGEST_LINE).decode("latin-1").strip()
        is_comment = line.startswith(COMMENTS)
        names = _named_columns(line.lstrip("#/ "))
        if names is not None:
            return number + 1, names, _delimiter(line)
        if not line or is_comment or (path.suffix.lower() == ".pts" and number == 0):
            continue
        if _is_number(line.split(_delimiter(line))[0]):
            return number, (0, 1, 2), _delimiter(line)
        raise MeshError(str(path), [f"line {number + 1}: expected numbers or the names x, y, z, got '{line:.40}'"])
    raise MeshError(str(path), ["there is no point in it"])


def _named_columns(line: str) -> tuple[int, int, int] | None:
    """Columns of x, y and z in a header line, None if it is no header."""
    words = [word.strip().strip('"').lower() for word in line.split(_delimiter(line))]
    found = [next((words.index(name) for name in NAMES[axis] if name in words), -1) for axis in "xyz"]
    return None if min(found) < 0 else (found[0], found[1], found[2])


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (";", ",") if mark in line), None)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
