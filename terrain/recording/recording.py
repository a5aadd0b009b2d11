"""What a run left behind, as arrays: the one source of the picture, the metrics, the replay and the report.

A runner fills a ``terrain.recording.recorder.Recorder`` while the robot drives and ends with ``finish``. A
``Recording`` knows no simulator and no viewer and can be saved and read again (``recording.npz``), so a picture can be
made on another day or machine.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.config.bounded_files import read_arrays
from mbf_abstract.events import Event
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import arccos
from mbf_abstract.whole_files import replacing
from terrain.recording.actor_track import ActorTrack, track_arrays, tracks_from
from terrain.recording.recorded_maps import (
    RecordedGrid,
    RecordedLayer,
    RecordedMesh,
    grid_arrays,
    grids_from,
    layer_arrays,
    layers_from,
    mesh_arrays,
    meshes_from,
)
from terrain.recording.recorded_objects import RecordedObjects, object_arrays, objects_from
from terrain.recording.recorded_robot import RobotReports, RobotShape, reports_from
from terrain.recording.verdict import Verdict
from terrain.worlds.surface import Surface

StampedPoints = tuple[float, FloatArray]

MAX_BYTES = 4 * 2**30
"""How large a recording's arrays may be in memory unless a caller allows more."""


class RecordingError(Exception):
    """A recording file cannot be read; the text names the file and the reason."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A finished run of n samples.

    Attributes
    ----------
    times : (n,) float64
        Simulated time of each sample [s], increasing.
    poses : (n, 7) float64
        True pose of base_link in the map: x y z qx qy qz qw.
    twists, commands : (n, 3) float64
        Measured and commanded vx [m/s], vy [m/s], wz [rad/s] in the base frame.
    paths : list of (time, (m, 3) float64)
        Every plan the robot followed, from the time it came.
    scans : list of (time, (k, 3) float64)
        Points a range sensor hit, in the map.
    scan_origins : (len(scans), 3) float64
        Where its rays started [m], in the map; without rows in older recordings.
    reports : RobotReports
        What the robot reported of itself.
    ground, walls, obstacles : Surface or None
        Obstacles are things that are on no map.
    goals : tuple of Pose
        In the order they were given.
    verdict : Verdict
        How it ended.
    grids : list of RecordedGrid
        The map the plans were made on, where it is a grid; seldom enough that the file stays small.
    meshes : list of RecordedMesh
        The same where it is a mesh.
    layers : list of RecordedLayer
        What each layer of that mesh said when the first plan came.
    actors : list of ActorTrack
        What moved by itself.
    objects : list of RecordedObjects
        What the robot knew of that, a few times a second; nothing of runs without a layer that tracks objects.
    """

    scenario: str
    backend: str
    robot: RobotShape
    ground: Surface | None
    walls: Surface | None
    obstacles: Surface | None
    start: Pose
    goals: tuple[Pose, ...]
    times: FloatArray
    poses: FloatArray
    twists: FloatArray
    commands: FloatArray
    paths: list[StampedPoints]
    scans: list[StampedPoints]
    events: tuple[Event, ...]
    verdict: Verdict
    grids: list[RecordedGrid] = field(default_factory=list)
    meshes: list[RecordedMesh] = field(default_factory=list)
    layers: list[RecordedLayer] = field(default_factory=list)
    actors: list[ActorTrack] = field(default_factory=list)
    objects: list[RecordedObjects] = field(default_factory=list)
    scan_origins: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    reports: RobotReports = field(default_factory=RobotReports)

    @cached_property
    def tilt(self) -> FloatArray:
        """(n,) angle [rad] between the robot's z axis and the vertical."""
        x, y = self.poses[:, 3], self.poses[:, 4]
        return np.asarray(arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))

    @property
    def duration(self) -> float:
        """Simulated length of the run [s]."""
        return float(self.times[-1] - self.times[0]) if len(self.times) else 0.0

    def save(self, file: str | Path, compress: bool = True) -> None:
        """Write everything into one npz file, which is there whole or not at all."""
        arrays: dict[str, Any] = {name: getattr(self, name) for name in ("times", "poses", "twists", "commands")}
        arrays |= {"footprint": self.robot.footprint, "wheels": self.robot.wheels}
        arrays["start"], arrays["goals"] = _pose_row(self.start), np.array([_pose_row(goal) for goal in self.goals])
        for name in ("ground", "walls", "obstacles"):
            arrays |= _surface_arrays(name, getattr(self, name))
        for name in ("paths", "scans"):
            arrays |= _stamped_arrays(name, getattr(self, name))
        arrays["scan_origins"] = self.scan_origins
        arrays |= grid_arrays(self.grids) | mesh_arrays(self.meshes) | track_arrays(self.actors)
        arrays |= object_arrays(self.objects) | layer_arrays(self.layers) | self.reports.arrays()
        metadata: dict[str, Any] = {
            "scenario": self.scenario,
            "backend": self.backend,
            "verdict": asdict(self.verdict),
            "robot": self.robot.name,
            "height": self.robot.height,
            "wheel_radius": self.robot.wheel_radius,
            "frame_id": self.start.frame_id,
            "events": [event.to_json() for event in self.events],
            "reports": self.reports.names(),
        }
        arrays["words"] = np.array(json.dumps(metadata))
        with replacing(file) as part, part.open("wb") as out:
            (np.savez_compressed if compress else np.savez)(out, **arrays)

    @classmethod
    def load(cls, file: str | Path, max_bytes: int = MAX_BYTES) -> Recording:
        """Read a file written by ``save``, of at most ``max_bytes`` in memory; raises RecordingError."""
        try:
            return _recording_from(read_arrays(Path(file), max_bytes))
        except FileNotFoundError as error:
            raise RecordingError(f"{file}: expected the recording of a run, got no such file") from error
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise RecordingError(f"{file}: is not a readable recording: {type(error).__name__}: {error}") from error


def _pose_row(pose: Pose) -> list[float]:
    return [*pose.position, *pose.orientation]


def _pose(row: FloatArray, frame_id: str) -> Pose:
    x, y, z, qx, qy, qz, qw = row.tolist()
    return Pose((x, y, z), (qx, qy, qz, qw), frame_id)


def _surface_arrays(name: str, surface: Surface | None) -> dict[str, Any]:
    return {} if surface is None else {f"{name}_vertices": surface.vertices, f"{name}_faces": surface.faces}


def _surface(name: str, arrays: dict[str, Any]) -> Surface | None:
    if f"{name}_vertices" not in arrays:
        return None
    return Surface(arrays[f"{name}_vertices"], arrays[f"{name}_faces"])


def _stamped_arrays(name: str, items: list[StampedPoints]) -> dict[str, Any]:
    """A list of point sets as one array of points, the number in each set, and the stamps."""
    points = np.concatenate([np.zeros((0, 3)), *(points for _, points in items)])
    stamps = np.array([stamp for stamp, _ in items], dtype=np.float64)
    return {name: points, f"{name}_counts": np.array([len(p) for _, p in items], np.int64), f"{name}_stamps": stamps}


def _stamped(name: str, arrays: dict[str, Any]) -> list[StampedPoints]:
    ends = np.cumsum(arrays[f"{name}_counts"])[:-1]
    parts = np.split(arrays[name], ends) if len(arrays[f"{name}_counts"]) else []
    return [(float(stamp), part) for stamp, part in zip(arrays[f"{name}_stamps"], parts, strict=True)]


def _recording_from(arrays: dict[str, Any]) -> Recording:
    metadata = json.loads(str(arrays["words"]))
    ending = metadata["verdict"]
    shape = RobotShape(
        metadata["robot"], arrays["footprint"], metadata["height"], arrays["wheels"], metadata["wheel_radius"]
    )  # fmt: skip
    return Recording(
        scenario=metadata["scenario"],
        backend=metadata["backend"],
        robot=shape,
        ground=_surface("ground", arrays),
        walls=_surface("walls", arrays),
        obstacles=_surface("obstacles", arrays),
        start=_pose(arrays["start"], metadata["frame_id"]),
        goals=tuple(_pose(row, metadata["frame_id"]) for row in arrays["goals"]),
        times=arrays["times"],
        poses=arrays["poses"],
        twists=arrays["twists"],
        commands=arrays["commands"],
        paths=_stamped("paths", arrays),
        scans=_stamped("scans", arrays),
        events=tuple(Event.from_json(line) for line in metadata["events"]),
        verdict=Verdict(**ending | {"failures": tuple(ending["failures"])}),
        grids=grids_from(arrays),
        meshes=meshes_from(arrays),
        layers=layers_from(arrays),
        actors=tracks_from(arrays),
        objects=objects_from(arrays),
        scan_origins=arrays.get("scan_origins", np.zeros((0, 3))),
        reports=reports_from(arrays, metadata.get("reports", {})),
    )
