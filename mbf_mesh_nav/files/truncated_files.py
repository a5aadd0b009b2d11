"""Refuses truncated files of the formats whose readers would accept them as smaller meshes.

After an interrupted download or on a full disk the text of a file may be legal up to its end, and the robot would drive
on half a map. The headers of PLY, OFF and binary STL hold the number of elements, a text STL ends with a keyword. OBJ
has neither: a truncated file is detected only if its last line is too short. The readers of binary PLY, glTF and DAE
check this themselves.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mbf_mesh_nav.mesh.mesh_report import MeshError

MAX_HEADER_LINES = 10_000
LONGEST_LINE = 4096
LONGEST_HEADER_LINE = 2**20  # a comment may be long
STL_HEADER_BYTES, STL_FACE_BYTES = 84, 50
PLY_FORMS = ("ascii", "binary_little_endian", "binary_big_endian")
PLY_LINES = {
    "format": f"'format FORM 1.0' with one of {', '.join(PLY_FORMS)}",
    "element": "'element NAME COUNT' with a whole number",
    "property": "a property",
    "comment": "a comment",
    "obj_info": "a comment",
    "end_header": "'end_header'",
}
"""What the lines of a PLY header are, by their first words."""


def refuse_truncated_file(path: Path) -> None:
    """Compare what a file promises with what is there.

    Raises
    ------
    MeshError
        The file is truncated; the text names what was expected and found.
    ValueError
        The header has no numbers where they belong.
    """
    checks = {".ply": _check_ply, ".off": _check_off, ".stl": _check_stl, ".obj": _check_obj, ".glb": _check_glb}
    check = checks.get(path.suffix.lower())
    if check is not None:
        with path.open("rb") as file:
            check(path, file)


def _check_ply(path: Path, file: BinaryIO) -> None:
    promised: dict[str, int] = {}
    is_text = False
    for number in range(1, MAX_HEADER_LINES):
        line = file.readline(LONGEST_HEADER_LINE)
        match words := line.decode("latin-1").split():
            case ["end_header"]:
                break
            case ["element", name, count] if count.isdecimal():
                promised[name] = int(count)
            case ["ply"] if number == 1:
                pass
            case ["format", form, "1.0"] if form in PLY_FORMS and number > 1:
                is_text = form == "ascii"
            case ["comment" | "obj_info" | "property", *_] if number > 1:
                pass
            case [] if line and number > 1:
                pass
            case _:
                _refuse_ply_line(path, number, words)
    if is_text:
        faces_last = list(promised)[-1:] == ["face"]
        _compare(path, promised, _count_lines((line for line in file if line.strip()), faces_last))


def _refuse_ply_line(path: Path, number: int, words: list[str]) -> None:
    """Raise MeshError for a line of a header, or its end where another line is missing."""
    expected = "'ply'" if number == 1 else "'end_header'"
    if words and number > 1:
        expected = PLY_LINES.get(words[0], f"a line that begins with one of {', '.join(PLY_LINES)}")
    got = repr(" ".join(words)[:60]) if words else "nothing"
    raise MeshError(str(path), [f"line {number}: expected {expected}, got {got}"])


def _check_glb(path: Path, file: BinaryIO) -> None:
    """The header of binary glTF 2.0 holds the length of the file."""
    header = file.read(12)
    if header[:4] != b"glTF" or len(header) < 12:
        return  # the reader reports the error
    expected, found = int.from_bytes(header[8:12], "little"), path.stat().st_size
    if found < expected:
        raise MeshError(str(path), [f"the file is cut off: expected {expected} bytes, found {found}"])


def _check_off(path: Path, file: BinaryIO) -> None:
    lines = (line for raw in file if (line := raw.split(b"#")[0].strip()))
    first = next(lines, b"")
    if b"OFF" not in first:
        return  # the reader reports the error
    counts = (first.split(b"OFF", 1)[1].strip() or next(lines, b"")).split()
    if len(counts) < 2:
        raise MeshError(str(path), ["the file is cut off before the numbers of vertices and faces"])
    _compare(path, {"vertex": int(counts[0]), "face": int(counts[1])}, _count_lines(lines, faces_last=True))


def _count_lines(lines: Iterator[bytes], faces_last: bool) -> int:
    """Count lines; if the last ones are faces, the very last only if it has as many corners as its first number."""
    count, last = 0, b""
    for number, line in enumerate(lines, start=1):
        count, last = number, line
    words = last.split()
    is_short = faces_last and words[:1] != [] and words[0].isdigit() and len(words) <= int(words[0])
    return count - 1 if is_short else count


def _compare(path: Path, promised: dict[str, int], lines: int) -> None:
    """Refuse a file of one line an element that has fewer lines than promised."""
    if lines >= sum(promised.values()):
        return
    left = lines
    found = {}
    for element, count in promised.items():
        found[element] = min(count, left)
        left -= found[element]
    expected = ", ".join(f"{count} of element {element}" for element, count in promised.items())
    present = ", ".join(f"{count} of {element}" for element, count in found.items())
    raise MeshError(str(path), [f"the file is cut off: expected {expected}; found {present}"])


def _check_stl(path: Path, file: BinaryIO) -> None:
    size, head = os.fstat(file.fileno()).st_size, file.read(STL_HEADER_BYTES)
    expected = int.from_bytes(head[80:], "little")
    if len(head) == STL_HEADER_BYTES and size >= STL_HEADER_BYTES + STL_FACE_BYTES * expected:
        return
    # Some binary files begin with "solid", too, but zeros follow, which no text has.
    if head.lstrip().lower().startswith(b"solid") and b"\0" not in head + file.read(STL_FACE_BYTES):
        file.seek(0)
        _check_text_stl(path, file)
    elif len(head) < STL_HEADER_BYTES:
        raise MeshError(str(path), [f"the file is cut off after {size} bytes, within its header"])
    else:
        found = (size - STL_HEADER_BYTES) // STL_FACE_BYTES
        raise MeshError(str(path), [f"the file is cut off: expected {expected} faces, found {found}"])


def _check_text_stl(path: Path, file: BinaryIO) -> None:
    begun = ended = 0
    last = b""
    for line in (line for line in file if line.strip()):
        last = line.split()[0].lower()
        begun += last == b"facet"
        ended += last == b"endfacet"
    if last != b"endsolid":
        text = f"the file is cut off: {begun} faces begin and {ended} end, and there is no endsolid after them"
        raise MeshError(str(path), [text])


def _check_obj(path: Path, file: BinaryIO) -> None:
    file.seek(max(os.fstat(file.fileno()).st_size - LONGEST_LINE, 0))
    last = file.read().rpartition(b"\n")[2]
    words = last.split()
    if words[:1] in ([b"v"], [b"f"]) and len(words) < 4:
        text = last.decode(errors="replace")
        raise MeshError(str(path), [f"the file is cut off: its last line is '{text}', expected three numbers or more"])
