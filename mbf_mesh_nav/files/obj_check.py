"""What has to hold in an OBJ file: corners that name its vertices, counted from 1; and what is wrong in which line.

A corner 0, as a script writes it that counts from 0, is taken for another vertex by readers: the mesh has its faces at
wrong places, and no error. Numbers by the format's specification (Wavefront, Advanced Visualizer, appendix B1).
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Iterator
from pathlib import Path

from mbf_mesh_nav.mesh.mesh_report import MeshError

ZERO = re.compile(rb"^[ \t]*f[ \t](?:[^\r\n]*[ \t])?0+(?=[ \t/\r\n]|\Z)", re.MULTILINE)
LONGEST_SHOWN = 60


def check_obj(path: Path) -> None:
    """Refuse a file with a corner 0.

    Raises
    ------
    MeshError
        With the line.
    """
    with path.open("rb") as file:
        if not path.stat().st_size:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            if found := ZERO.search(text):
                number = text[: found.start()].count(b"\n") + 1
                line = text[found.start() : found.end()].decode("latin-1").strip()
                raise _error(path, number, "corners counted from 1", line)


def refuse_obj_line(path: Path) -> None:
    """Look for the line because of which an OBJ cannot be read.

    Raises
    ------
    MeshError
        There is one.
    """
    lines = list(_lines(path))
    vertices = sum(words[0] == "v" for _, words in lines)
    before = 0
    for number, words in lines:
        before += words[0] == "v"
        expected = _vertex_fault(words) if words[0] == "v" else _face_fault(words, vertices, before)
        if expected:
            raise _error(path, number, expected, " ".join(words))


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Numbers and words of the lines with vertices and faces; what a backslash continues belongs to the first one."""
    begun: list[str] = []
    first = 0
    with path.open(encoding="latin-1") as file:
        for number, line in enumerate(file, 1):
            text = line.strip()
            first = first if begun else number
            begun += text.removesuffix("\\").split()
            if not text.endswith("\\"):
                if begun and begun[0] in ("v", "f"):
                    yield first, begun
                begun = []


def _vertex_fault(words: list[str]) -> str:
    """What was expected instead of a line with a vertex; empty if it is right."""
    try:
        return "" if len([float(word) for word in words[1:]]) >= 3 else "'v' and three numbers"
    except ValueError:
        return "'v' and three numbers"


def _face_fault(words: list[str], vertices: int, before: int) -> str:
    """What was expected instead of a line with a face; ``before`` it stand so many of the vertices."""
    if len(words) < 4:
        return "'f' and three corners or more"
    for word in words[1:]:
        corner = word.partition("/")[0]
        if not corner.removeprefix("-").isdecimal():
            return "'f' and whole numbers of vertices"
        if not (1 <= int(corner) <= vertices or -before <= int(corner) <= -1):
            return f"corners among the {vertices} vertices of the file"
    return ""


def _error(path: Path, number: int, expected: str, got: str) -> MeshError:
    return MeshError(str(path), [f"line {number}: expected {expected}, got {got[:LONGEST_SHOWN]!r}"])
