"""What differs between two runs that should be the same: drive, results, versions, code and files."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.provenance.provenance import Provenance
from terrain.recording.recording import Recording
from terrain.recording.run_folder import robots_of

DIGEST = "digest"
ABSENT = "-"


@dataclass(frozen=True)
class Change:
    """A value before and now; ``-`` where there is none."""

    name: str
    before: str
    now: str


@dataclass(frozen=True)
class RunDifferences:
    """Comparison of a run with an earlier one.

    Attributes
    ----------
    same_drive : bool
        Whether poses, commands and events are the same, bit for bit.
    parting : str
        When and where the drives part; empty for the same drive.
    results : tuple of Change
        Outcome, verdict and metrics that differ.
    surroundings : tuple of Change
        Versions, system, CPU, and hashes of code and of map files that differ.
    """

    same_drive: bool
    parting: str
    results: tuple[Change, ...]
    surroundings: tuple[Change, ...]


def compare_runs(before: Path, now: Path, provenances: tuple[Provenance, Provenance]) -> RunDifferences:
    """Compare two folders of finished runs, of which ``provenances`` are known.

    Raises
    ------
    ConfigError
        A folder has no readable metrics.json.
    RecordingError
        The drives differ, and a folder has no readable recording.
    """
    metrics = read_metrics(before), read_metrics(now)
    same = metrics[0][DIGEST] == metrics[1][DIGEST]
    results = tuple(change for change in _changes(*metrics) if change.name != DIGEST)
    return RunDifferences(same, "" if same else _parting(before, now), results, tuple(_surroundings(*provenances)))


def read_metrics(folder: Path) -> dict[str, Any]:
    """Read metrics.json of a finished run; raises ConfigError for a run that was cut short, or a damaged file."""
    file = folder / "metrics.json"
    expected = "the metrics of a finished run, with a digest"
    try:
        metrics = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        got = getattr(error, "strerror", None) or f"no JSON ({error})"
        raise ConfigError([Finding(str(file), 1, "", expected, got)]) from error
    if not isinstance(metrics, dict) or not isinstance(metrics.get(DIGEST), str):
        raise ConfigError([Finding(str(file), 1, "", expected, "none")])
    return metrics


def _changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Change]:
    """Names whose values differ, in the order in which they stand."""
    for name in dict.fromkeys((*before, *now)):
        if before.get(name, ABSENT) != now.get(name, ABSENT):
            yield Change(name, str(before.get(name, ABSENT)), str(now.get(name, ABSENT)))


def _surroundings(before: Provenance, now: Provenance) -> Iterator[Change]:
    yield from _changes(before.versions, now.versions)
    codes = [{name: code.sha256 for name, code in run.code.items()} for run in (before, now)]
    for change in _changes(*codes):
        yield Change(f"code of {change.name}", _code(before, change.name), _code(now, change.name))
    yield from _changes(before.files, now.files)


def _code(run: Provenance, package: str) -> str:
    """Hash of a package and its commit."""
    code = run.code.get(package)
    if code is None:
        return ABSENT
    return code.sha256 + (f" (commit {code.commit})" if code.commit else "")


def _parting(before: Path, now: Path) -> str:
    """The first sample whose pose differs, or the first event, whichever is earlier; of several robots the first."""
    found: list[tuple[float, str]] = []
    for robot in robots_of(before):
        runs = Recording.load(before / robot / "recording.npz"), Recording.load(now / robot / "recording.npz")
        partings = (_first_other_pose(*runs), _first_other_event(*runs))
        whose = f"{robot}: " if robot else ""
        found += [(parting[0], whose + parting[1]) for parting in partings if parting is not None]
    if not found:
        return "between two recorded samples, or in commands that moved nothing"
    return min(found)[1]


def _first_other_pose(before: Recording, now: Recording) -> tuple[float, str] | None:
    count = min(len(before.times), len(now.times))
    other = np.flatnonzero((before.poses[:count] != now.poses[:count]).any(axis=1))
    if len(other):
        index = int(other[0])
        step = float(np.abs(before.poses[index, :3] - now.poses[index, :3]).max())
        time = float(before.times[index])
        how = f"is elsewhere, by {step:.3g} m along one axis" if step else "has another orientation"
        return time, f"at {time:.2f} s the robot {how}"
    if len(before.times) != len(now.times):
        time = float((before if len(before.times) == count else now).times[-1]) if count else 0.0
        return time, f"at {time:.2f} s one of the runs has ended"
    return None


def _first_other_event(before: Recording, now: Recording) -> tuple[float, str] | None:
    for events in zip_longest(before.events, now.events):
        if events[0] != events[1]:
            event = next(event for event in events if event is not None)
            return event.time, f"at {event.time:.2f} s the event {event.kind.value} of {event.source} differs"
    return None
