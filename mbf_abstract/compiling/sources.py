"""The files of a package as its author wrote them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

CACHES = "__pycache__"


def read_source_files(folder: Path, suffix: str = "") -> Iterator[tuple[Path, bytes]]:
    """Regular files in a folder and below whose names end with ``suffix``, sorted, and what is in them.

    Caches and hidden files are left out; caches are not even looked into, as another process may be removing what it
    finds out of date there. So is a file that cannot be read: an editor's copy that has gone since it was listed.
    """
    found: list[Path] = []
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if name != CACHES and not name.startswith(".")]
        found += [Path(place, name) for name in files if not name.startswith(".") and name.endswith(suffix)]
    for file in sorted(file for file in found if file.is_file()):
        try:
            content = file.read_bytes()
        except OSError:
            continue
        yield file, content
