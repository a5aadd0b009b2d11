"""What a run keeps of its robot: what it looks like, and what it reported of itself, right or wrong.

Poses and velocities of a ``Recording`` are true ones, where they are known; those here are what the navigation had.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Quaternion, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.view import GridView, MapView
from terrain.physics.robot_models import Drive, RobotSpec
from terrain.recording.recorded_maps import RecordedGrid, grid_arrays, grids_from

MAX_LOCAL_COSTS = 100_000_000  # of all local maps of a run together, a byte each; later ones are not recorded
REPORTED = 17  # numbers of a ``Report``
NOWHERE = [np.nan] * 7


@dataclass(frozen=True, eq=False)
class RobotShape:
    """What a robot looks like, roughly: a body and wheels in base_link.

    Attributes
    ----------
    footprint : (n, 2) float64
        Outline [m], counter-clockwise.
    height, wheel_radius : float
        [m]
    wheels : (k, 3) float64
        Centres of the wheels [m].
    """

    name: str
    footprint: FloatArray
    height: float
    wheels: FloatArray
    wheel_radius: float

    @classmethod
    def of(cls, spec: RobotSpec) -> RobotShape:
        """Shape of one of the simulated robots."""
        return cls(spec.name, spec.footprint_array(), spec.height, _wheel_positions(spec), spec.wheel_radius)


def _wheel_positions(spec: RobotSpec) -> FloatArray:
    """Centres (k, 3) of the wheels in base_link, which lies under the rear axle of a car and amidships else."""
    if spec.wheel_positions or spec.drive is Drive.HOLONOMIC:
        return np.array(spec.wheel_positions, dtype=np.float64).reshape(-1, 3)
    axles = {
        Drive.ACKERMANN: (0.0, spec.wheelbase),
        Drive.SKID_STEER: (-0.5 * spec.wheelbase, 0.5 * spec.wheelbase),
        Drive.DIFFERENTIAL: (0.0,),
    }[spec.drive]
    return np.array([(x, side * spec.track / 2, spec.wheel_radius) for x in axles for side in (1.0, -1.0)])


class Report(NamedTuple):
    """What a robot reports of itself at one time; None where it reports nothing.

    Attributes
    ----------
    estimate : Pose, optional
        Where its localisation has it, in the map.
    odometry : Pose, optional
        Where its odometry has it, in odom.
    velocity : Twist, optional
        Measured velocity.
    """

    estimate: Pose | None = None
    odometry: Pose | None = None
    velocity: Twist | None = None

    def row(self) -> list[float]:
        """Return ``REPORTED`` numbers; nan for what is not reported."""
        v = self.velocity
        return [
            *_numbers(self.estimate),
            *_numbers(self.odometry),
            *([np.nan] * 3 if v is None else (v.vx, v.vy, v.wz)),
        ]


NO_REPORT = Report()


def _numbers(pose: Pose | None) -> list[float]:
    return NOWHERE if pose is None else [*pose.position, *pose.orientation]


@dataclass(frozen=True, eq=False)
class RobotReports:
    """All reports of a run, and what the navigation knew around the robot; nothing in older recordings.

    Attributes
    ----------
    rows : (n, REPORTED) float64
        Of each sample, see ``Report``: estimate and odometry, x y z qx qy qz qw, then vx, vy [m/s], wz [rad/s].
    outlines : list of (time, (k, 3) float64)
        Corners [m] of the robot with which the navigation planned, in base_link; one for each change.
    local_grids : list of RecordedGrid
        The map around the robot, where there is one.
    local_frame : str
        Frame of these maps.
    mounts : dict of str to (7,) float64
        Where each range sensor is in base_link.
    scan_sensors : list of str
        Which sensor each recorded scan came from; empty = unknown.
    scan_orientations : (s, 4) float64
        Orientation of that sensor in the map at that time.
    """

    rows: FloatArray = field(default_factory=lambda: np.zeros((0, REPORTED)))
    outlines: list[tuple[float, FloatArray]] = field(default_factory=list)
    local_grids: list[RecordedGrid] = field(default_factory=list)
    local_frame: str = ""
    mounts: dict[str, FloatArray] = field(default_factory=dict)
    scan_sensors: list[str] = field(default_factory=list)
    scan_orientations: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))

    @property
    def estimates(self) -> FloatArray:
        """(n, 7) poses of the localisation in the map; nan where there was none."""
        return self.rows[:, :7]

    @property
    def odometry(self) -> FloatArray:
        """(n, 7) poses in odom; nan without odometry."""
        return self.rows[:, 7:14]

    @property
    def velocities(self) -> FloatArray:
        """(n, 3) measured vx, vy [m/s], wz [rad/s]; nan where none was measured."""
        return self.rows[:, 14:]

    def arrays(self) -> dict[str, Any]:
        """Return everything but names as arrays for a file."""
        return {
            "report_rows": self.rows,
            "outline_times": np.array([time for time, _ in self.outlines], np.float64),
            "outline_counts": np.array([len(corners) for _, corners in self.outlines], np.int64),
            "outline_corners": np.concatenate([np.zeros((0, 3)), *(corners for _, corners in self.outlines)]),
            "mounts": np.array(list(self.mounts.values()), np.float64).reshape(-1, 7),
            "scan_orientations": self.scan_orientations,
            **grid_arrays(self.local_grids, "local_grid"),
        }

    def names(self) -> dict[str, Any]:
        """Return the names that belong to ``arrays``."""
        return {
            "local_frame": self.local_frame, "mounted": list(self.mounts), "scan_sensors": self.scan_sensors
        }  # fmt: skip


def reports_from(arrays: dict[str, Any], names: dict[str, Any]) -> RobotReports:
    """Read what ``arrays`` and ``names`` of ``RobotReports`` made; older recordings have neither."""
    if "report_rows" not in arrays:
        return RobotReports()
    corners = np.split(arrays["outline_corners"], np.cumsum(arrays["outline_counts"])[:-1])
    return RobotReports(
        rows=arrays["report_rows"],
        outlines=list(zip(arrays["outline_times"].tolist(), corners, strict=False)),
        local_grids=grids_from(arrays, "local_grid"),
        local_frame=names["local_frame"],
        mounts=dict(zip(names["mounted"], arrays["mounts"], strict=True)),
        scan_sensors=names["scan_sensors"],
        scan_orientations=arrays["scan_orientations"],
    )


@dataclass(eq=False)
class ReportRecorder:
    """Collects reports while a run goes on; everything given is copied.

    Parameters
    ----------
    mounts : dict of str to (7,) float64
        As of ``RobotReports``; may be filled later.
    map_budget : int
        How many costs of maps may still be recorded.
    """

    mounts: dict[str, FloatArray] = field(default_factory=dict)
    map_budget: int = MAX_LOCAL_COSTS
    outlines: list[tuple[float, FloatArray]] = field(default_factory=list)
    local_grids: list[RecordedGrid] = field(default_factory=list)
    local_frame: str = ""
    scan_sensors: list[str] = field(default_factory=list)
    scan_orientations: list[Quaternion] = field(default_factory=list)

    def scan(self, sensor: str, orientation: Quaternion) -> None:
        """Add which sensor, empty if unknown, made the scan that is recorded now, and its orientation in the map."""
        self.scan_sensors.append(sensor)
        self.scan_orientations.append(orientation)

    def local_map(self, time: float, frame: str, view: MapView | None) -> None:
        """Add what the map around the robot looks like now, in its frame; other maps than grids are left out."""
        if isinstance(view, GridView) and view.costs.size <= self.map_budget:
            self.map_budget -= view.costs.size
            self.local_frame = frame
            self.local_grids.append(RecordedGrid.of(time, view))

    def outline(self, time: float, corners: FloatArray) -> None:
        """Add the corners (k, 2) [m] with which the navigation plans, in base_link, if they changed."""
        flat = np.column_stack([corners, np.zeros(len(corners))])
        if not self.outlines or not np.array_equal(self.outlines[-1][1], flat):
            self.outlines.append((time, flat))

    def between(self, rows: FloatArray, scans: slice, outlines: slice, local_grids: slice) -> RobotReports:
        """Return these parts of what has come; ``rows`` (n, REPORTED) are those of the samples."""
        return RobotReports(
            rows,
            self.outlines[outlines],
            self.local_grids[local_grids],
            self.local_frame,
            dict(self.mounts),
            self.scan_sensors[scans],
            np.array(self.scan_orientations[scans], dtype=np.float64).reshape(-1, 4),
        )


def joined_reports(parts: Sequence[RobotReports]) -> RobotReports:
    """Return the reports of at least one part that follow each other as one."""
    return RobotReports(
        np.concatenate([part.rows for part in parts]),
        [outline for part in parts for outline in part.outlines],
        [grid for part in parts for grid in part.local_grids],
        parts[-1].local_frame,
        parts[-1].mounts,
        [sensor for part in parts for sensor in part.scan_sensors],
        np.concatenate([part.scan_orientations for part in parts]),
    )


def as_mount(T_base_sensor: Transform) -> FloatArray:
    """Return a transform as x y z qx qy qz qw (7,)."""
    return np.array([*T_base_sensor.translation, *T_base_sensor.rotation])
