"""The files of a package as its author wrote them."""

from __future__ import annotations

import os
from pathlib import Path

CACHES = "__pycache__"


def source_files(folder: Path) -> list[Path]:
    """Regular files in a folder and below, sorted, but for caches and hidden ones.

    Caches are not even looked into: another process may be removing what it finds out of date there.
    """
    found: list[Path] = []
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if name != CACHES and not name.startswith(".")]
        found += [Path(place, name) for name in files if not name.startswith(".")]
    return sorted(file for file in found if file.is_file())
