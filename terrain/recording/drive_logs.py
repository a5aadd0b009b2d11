"""Recordings as ``DriveLog``, the form in which other packages read them, and the other way round."""

from __future__ import annotations

import numpy as np

from mbf_abstract.drive_log import DriveLog
from mbf_abstract.maps.view import GridView, MeshView
from terrain.recording.recorded_maps import RecordedGrid, RecordedMesh, add_if_changed
from terrain.recording.recording import Recording, RobotShape
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
        events=log.events,
        verdict=Verdict(log.outcome, log.message),
        grids=[RecordedGrid.of(time, view) for time, view in log.maps if isinstance(view, GridView)],
        meshes=meshes,
    )
