"""The memory of a sweep: one JSON line per finished run, only ever appended to, so that a kill loses no finished run.

A line counts once its newline is on the disk. A line that a kill cut short is taken away when the log is opened again,
and its run is done again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from mbf_abstract.config.findings import ConfigError, Finding, describe_value
from terrain.sweeps.worker_pool import run_in_workers

J = TypeVar("J")


class SweepLog:
    """Finished runs by key, kept in a file; a context manager.

    Parameters
    ----------
    file : Path
        Made if it does not exist.

    Raises
    ------
    ConfigError
        A whole line of the file is no finished run.

    Attributes
    ----------
    rows : dict of str to dict
        All finished runs: key -> what is known of the run.
    """

    def __init__(self, file: Path) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        file.parent.mkdir(parents=True, exist_ok=True)
        self._file = file.open("a+b")
        try:
            self._read()
        except BaseException:
            self._file.close()
            raise

    def _read(self) -> None:
        self._file.seek(0)
        content = self._file.read()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            self._file.truncate(whole)
        for number, line in enumerate(content[:whole].split(b"\n")[:-1], start=1):
            row = self._row(line, number)
            self.rows[row["key"]] = row  # a run that was forgotten and done again has two lines

    def _row(self, line: bytes, number: int) -> dict[str, Any]:
        expected = "a JSON object with the text 'key'"
        try:
            row = json.loads(line)
        except ValueError as error:  # UnicodeDecodeError is one, too
            raise ConfigError([Finding(self._file.name, number, "", expected, str(error))]) from error
        if not isinstance(row, dict) or not isinstance(row.get("key"), str):
            raise ConfigError([Finding(self._file.name, number, "", expected, describe_value(row))])
        return row

    def append(self, key: str, row: dict[str, Any]) -> None:
        """Add a finished run and wait until it is on the disk; a key that is there already changes nothing."""
        if key in self.rows:
            return
        self.rows[key] = {**row, "key": key}
        self._file.write(json.dumps(self.rows[key], sort_keys=True).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def forget(self, key: str) -> None:
        """Let a run be appended again; until then its line stays, so that a kill loses nothing."""
        self.rows.pop(key, None)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> SweepLog:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def rows_of(
    keys: Mapping[J, str], file: Path, do: Callable[[J], dict[str, Any]], workers: int, **more: Any
) -> Iterator[tuple[J, dict[str, Any]]]:
    """Yield each job with its row: first those that a file holds, then the others as workers finish them.

    Parameters
    ----------
    keys : mapping
        Key of each job in the file, see ``SweepLog``.
    do : callable
        Makes a row; of a module, so that a worker can import it.
    **more
        What every new row holds beside what it was made of.
    """
    with SweepLog(file) as log:
        yield from ((job, log.rows[key]) for job, key in keys.items() if key in log.rows)
        for job, row in run_in_workers(do, [job for job, key in keys.items() if key not in log.rows], workers):
            log.append(keys[job], row := {**row, **more})
            yield job, row
