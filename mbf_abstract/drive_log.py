"""What a robot did and saw over some time, as arrays: passed between packages that know each other by entry points.

A package that keeps recordings offers two functions by entry points of the group ``mbf.drive_logs``: ``read(folder)``
returns the ``DriveLog`` of a run's folder, and ``write(folder, log, report)`` writes recording, pictures, a log for
viewers and a report, and returns the problems that kept it from some of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from mbf_abstract.events import Event
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.maps.view import MapView

DRIVE_LOGS_GROUP = "mbf.drive_logs"


@dataclass(frozen=True, eq=False)
class LoggedScan:
    """What a range sensor hit.

    Attributes
    ----------
    time : float
        [s]
    origin : (3,) float64
        Where the rays started [m].
    points : (k, 3) float64
        [m]
    """

    time: float
    origin: FloatArray
    points: FloatArray


@dataclass(frozen=True, eq=False)
class DriveLog:
    """A drive of n samples; all coordinates are in one frame.

    Attributes
    ----------
    name, backend : str
        Names, for titles.
    frame_id : str
        Frame of poses, paths, scans and maps.
    outline : (m, 2) float64
        The robot's footprint [m], counter-clockwise.
    times : (n,) float64
        Time of each sample [s], increasing.
    poses : (n, 7) float64
        Pose of the robot's base: x y z qx qy qz qw.
    twists, commands : (n, 3) float64
        Measured and commanded vx [m/s], vy [m/s], wz [rad/s] in the base frame.
    paths : list of (time, (m, 3) float64)
        Plans, from the time they came.
    maps : list of (time, MapView)
        The map at several times.
    outcome : int or None
        Of the last goal.
    message : str
        How the drive ended.
    """

    name: str
    backend: str
    frame_id: str
    outline: FloatArray
    start: Pose
    goals: tuple[Pose, ...]
    times: FloatArray
    poses: FloatArray
    twists: FloatArray
    commands: FloatArray
    paths: list[tuple[float, FloatArray]] = field(default_factory=list)
    scans: list[LoggedScan] = field(default_factory=list)
    maps: list[tuple[float, MapView]] = field(default_factory=list)
    events: tuple[Event, ...] = ()
    outcome: int | None = None
    message: str = ""


@dataclass(frozen=True)
class LogTable:
    """A table of a report."""

    title: str
    header: tuple[str, ...]
    rows: Sequence[tuple[Any, ...]]


@dataclass(frozen=True)
class LogReport:
    """What a report says of a log beside its pictures: a line on the result, notes, and tables."""

    result: str
    notes: Sequence[str]
    tables: Sequence[LogTable]


def read_drive_log(folder: Path) -> DriveLog:
    """Read the recording of a run's folder; raises RuntimeError if no installed package can, and what that raises."""
    log: DriveLog = _function("read")(folder)
    return log


def write_drive_log(folder: Path, log: DriveLog, report: LogReport) -> list[str]:
    """Write everything that is made of a log, and return problems; raises RuntimeError if no installed package can."""
    problems: list[str] = _function("write")(folder, log, report)
    return problems


def _function(name: str) -> Callable[..., Any]:
    found = list(entry_points(group=DRIVE_LOGS_GROUP, name=name))
    if not found:
        raise RuntimeError("no installed package keeps recordings: pip install 'mbf-flex[sim]'")
    function: Callable[..., Any] = found[0].load()
    return function
