"""The memory of a sweep: one JSON line per finished run, only ever appended to, so that a kill loses no finished run.

A line counts once its newline is on the disk. A line that a kill cut short is taken away when the log is opened again,
and its run is done again.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any


class SweepLog:
    """Finished runs by key, kept in a file; a context manager.

    Parameters
    ----------
    file : Path
        Made if it does not exist.

    Attributes
    ----------
    rows : dict of str to dict
        All finished runs: key -> what is known of the run.
    """

    def __init__(self, file: Path) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        file.parent.mkdir(parents=True, exist_ok=True)
        self._file = file.open("a+b")
        self._read()

    def _read(self) -> None:
        self._file.seek(0)
        content = self._file.read()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            self._file.truncate(whole)
        for line in content[:whole].splitlines():
            row = json.loads(line)
            self.rows.setdefault(row["key"], row)

    def append(self, key: str, row: dict[str, Any]) -> None:
        """Add a finished run and wait until it is on the disk; a key that is there already changes nothing."""
        if key in self.rows:
            return
        self.rows[key] = {"key": key, **row}
        self._file.write(json.dumps(self.rows[key], sort_keys=True).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> SweepLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
