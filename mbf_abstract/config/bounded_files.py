"""Opening untrusted files: no pipes and devices, and no array larger than a limit.

When to use: by every reader of a file whose name or content a configuration, a download or a colleague chose. A pipe
blocks its reader until it is written to, and a compressed file of a megabyte may hold gigabytes.
"""

from __future__ import annotations

import math
import stat
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

_SPECIAL = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def configured_file(folder: Path | str, name: Path | str) -> Path:
    """The file that a configuration names: ``~`` is the home folder, other relative names count from ``folder``.

    A name with ``~`` whose home folder is not known stays as it is: there is no such file, and its reader reports that.
    """
    try:
        return Path(folder) / Path(name).expanduser()
    except RuntimeError:
        return Path(folder) / name


class ArrayFileError(ValueError):
    """A file of arrays is damaged, or holds more than its reader's limit; the text does not name the file."""


def is_there(path: Path) -> bool:
    """Whether there is a file, a folder or anything else of this name."""
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long, or has a null character
        return False


def is_file(path: Path) -> bool:
    """Whether there is a file with contents of this name; not so for what may not be looked at."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def special_file(path: Path) -> str:
    """What a path is if it is no file with contents: "a pipe", "a socket" or "a device"; "" otherwise.

    Also "" where there is nothing, or a folder: opening it raises the operating system's error.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # ValueError: a name with a null character
        return ""
    return next((name for is_kind, name in _SPECIAL if is_kind(mode)), "")


def read_arrays(path: Path, max_bytes: int, wanted: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Read arrays of an ``.npz`` file, after the sizes that all their headers promise are known.

    Parameters
    ----------
    max_bytes : int
        Limit on the sum of the arrays' sizes in memory.
    wanted : collection of str, optional
        Names of the arrays to read; names that are not in the file are left out. All without it.

    Raises
    ------
    OSError
        The file cannot be opened.
    ArrayFileError
        It is no such file, is damaged, holds Python objects, or more than ``max_bytes``.
    """
    if kind := special_file(path):
        raise ArrayFileError(f"expected a file, got {kind}")
    try:
        with zipfile.ZipFile(path) as archive:
            members = [name for name in archive.namelist() if name.endswith(".npy")]
            names = {member[:-4]: member for member in members if wanted is None or member[:-4] in wanted}
            size = sum(_promised_bytes(archive, member) for member in names.values())
            if size > max_bytes:
                raise ArrayFileError(f"its arrays take {size} bytes, the limit is {max_bytes}")
            return {name: _read_member(archive, member) for name, member in names.items()}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        if isinstance(error, ArrayFileError):
            raise
        raise ArrayFileError(f"is not a valid .npz file: {error}") from error


def _promised_bytes(archive: zipfile.ZipFile, member: str) -> int:
    """Size in memory of an array by its header, which alone is read."""
    with archive.open(member) as file:
        shape, _, dtype = _read_header(file)  # type: ignore[arg-type]
    if min(shape, default=0) < 0:
        raise ArrayFileError(f"'{member}' has the shape {shape}")
    return math.prod(shape) * dtype.itemsize


def _read_header(file: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(file)
    readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    if version not in readers:
        raise ArrayFileError(f"holds an array in version {version} of the format, expected 1.0 or 2.0")
    return readers[version](file)


def _read_member(archive: zipfile.ZipFile, member: str) -> NDArray[Any]:
    with archive.open(member) as file:
        values: NDArray[Any] = npy.read_array(file, allow_pickle=False)
    return values
