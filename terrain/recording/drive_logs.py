"""Recordings as ``DriveLog``, the form in which other packages read them, and the other way round."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mbf_abstract.drive_log import DriveLog, LoggedScan
from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.view import GridView, MapView, MeshView
from terrain.recording.recorded_maps import RecordedGrid, RecordedMesh, add_if_changed
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recording import Recording, RecordingError
from terrain.recording.run_folder import read_run, robots_of
from terrain.recording.verdict import Verdict

BODY_HEIGHT = 0.3  # m, of a robot of which only the outline is known


def recording_of(log: DriveLog) -> Recording:
    """Return a log as a recording, of a robot without wheels in a world that nobody knows."""
    meshes: list[RecordedMesh] = []
    for time, view in log.maps:
        if isinstance(view, MeshView):
            add_if_changed(meshes, time, view)
    return Recording(
        scenario=log.name,
        backend=log.backend,
        robot=RobotShape(log.name, log.outline, BODY_HEIGHT, np.zeros((0, 3)), 0.0),
        ground=None,
        walls=None,
        obstacles=None,
        start=log.start,
        goals=log.goals,
        times=log.times,
        poses=log.poses,
        twists=log.twists,
        commands=log.commands,
        paths=log.paths,
        scans=[(scan.time, scan.points) for scan in log.scans],
        scan_origins=np.array([scan.origin for scan in log.scans]).reshape(-1, 3),
        events=log.events,
        verdict=Verdict(log.outcome, log.message),
        grids=[RecordedGrid.of(time, view) for time, view in log.maps if isinstance(view, GridView)],
        meshes=meshes,
    )


def read_drive_log(folder: Path) -> DriveLog:
    """Read the recording in the folder of a run with one robot, or of one robot of a run.

    Raises
    ------
    RecordingError
        There is none, it cannot be read, or there are those of several robots.
    """
    names = robots_of(folder)
    if names != [""]:
        known = ", ".join(str(folder / name) for name in names)
        raise RecordingError(
            f"{folder}: expected the folder of one robot, got that of {len(names)}; name one of {known}"
        )
    return drive_log_of(read_run(folder)[0])


def drive_log_of(recording: Recording) -> DriveLog:
    """Return a recording as a log; scans of older ones, without origins, begin where the robot was."""
    grids: list[tuple[float, MapView]] = [(one.time, GridView(one.costs, one.extent)) for one in recording.grids]
    meshes = [(one.time, MeshView(one.vertices, one.faces, one.costs.astype(np.float32))) for one in recording.meshes]
    origins: list[FloatArray] = list(recording.scan_origins)
    if len(origins) != len(recording.scans):
        samples = np.searchsorted(recording.times, [time for time, _ in recording.scans])
        origins = list(recording.poses[np.minimum(samples, len(recording.poses) - 1), :3])
    return DriveLog(
        name=recording.scenario,
        backend=recording.backend,
        frame_id=recording.start.frame_id,
        outline=recording.robot.footprint,
        start=recording.start,
        goals=recording.goals,
        times=recording.times,
        poses=recording.poses,
        twists=recording.twists,
        commands=recording.commands,
        paths=recording.paths,
        scans=[LoggedScan(time, o, points) for (time, points), o in zip(recording.scans, origins, strict=True)],
        maps=[*grids, *meshes],
        events=recording.events,
        outcome=recording.verdict.outcome,
        message=recording.verdict.message,
    )
