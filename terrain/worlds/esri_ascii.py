"""The text of an ESRI ASCII grid: a header of names and numbers, then heights, the northern row first.

What is wrong is named with its line, as such files are often written by hand or by a script.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LARGEST_DEGREES = 0.01
"""Cells of less, at a corner within the degrees of the earth, are degrees: no survey of a robot's world has cells of
less than a centimetre."""
SHOWN = 40


def read_header(path: Path) -> dict[str, float]:
    """Names, in small letters, and numbers of the first lines; raises ValueError with the line of what is no number."""
    header: dict[str, float] = {}
    with path.open(encoding="ascii") as file:
        for number, line in enumerate(file, 1):
            fields = line.split()
            if len(fields) != 2 or not re.match(r"[A-Za-z_]+$", fields[0]):
                break
            try:
                header[fields[0].lower()] = float(fields[1])
            except ValueError:
                raise ValueError(f"line {number}: {fields[0]}: expected a number, got {fields[1][:SHOWN]!r}") from None
    return header


def read_heights(path: Path, header: dict[str, float]) -> NDArray[np.float64]:
    """All heights behind a header, in the order of the file; raises ValueError with the line of what is none."""
    text = path.read_text(encoding="ascii")
    try:
        return np.array(text.split()[2 * len(header) :], dtype=np.float64)
    except ValueError:
        for number, line in enumerate(text.splitlines(), 1):
            if number > len(header):
                _refuse_words(number, line.split())
        raise


def _refuse_words(number: int, words: list[str]) -> None:
    for word in words:
        try:
            float(word)
        except ValueError:
            expected = "heights with spaces between them"
            raise ValueError(f"line {number}: expected {expected}, got {word[:SHOWN]!r}") from None


def is_in_degrees(header: Mapping[str, float]) -> bool:
    """Whether the cells of a grid are given in degrees, as those of surveys of whole countries are."""
    x = header.get("xllcorner", header.get("xllcenter", np.inf))
    y = header.get("yllcorner", header.get("yllcenter", np.inf))
    return 0.0 < header["cellsize"] < LARGEST_DEGREES and abs(x) <= 180.0 and abs(y) <= 90.0 and (x, y) != (0.0, 0.0)
