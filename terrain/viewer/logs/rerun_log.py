"""A run as a Rerun recording (``run.rrd``), on request: Rerun's packages are large (the extra ``rerun``).

For looking at a run in Rerun's own viewer, or for its queries; ``run.mcap`` has the same contents and more topics.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.whole_files import replacing
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import BODY, DRIVEN, PLANNED, SCAN, Colour
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.pictures.shading import vertex_colours
from terrain.viewer.pictures.shapes import marks, robot_body, standing_things
from terrain.viewer.reports.event_lines import event_text
from terrain.worlds.surface import Surface

TIMELINE = "run"
LINE = 0.06  # m
BALL = 0.3  # m
SCAN_POINT = 0.04  # m


def write_rrd(file: str | Path, recording: Recording) -> None:
    """Write a recording; raises ViewerMissing without rerun."""
    try:
        import rerun
    except ImportError as error:
        raise ViewerMissing(f"run.rrd needs rerun (Python >= 3.11): pip install 'mbf-flex[rerun]' ({error})") from error
    with replacing(file) as part, rerun.RecordingStream("mbf-flex", recording_id=recording.scenario) as stream:
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.save(part)
        stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.send_recording_name(f"{recording.scenario} on {recording.backend}: {recording.verdict.title}")
        _log_world(rerun, stream, recording)
        _log_motion(rerun, stream, recording)
        _log_happenings(rerun, stream, recording)


def _log_world(rerun: Any, stream: Any, recording: Recording) -> None:
    """What does not move."""
    if recording.ground is not None:
        _log_mesh(rerun, stream, "world/ground", recording.ground, vertex_colours(recording.ground))
    for name, surface, paint in standing_things(recording):
        _log_mesh(rerun, stream, f"world/{name}", surface, paint)
    names, poses, colours = zip(*marks(recording), strict=True)
    places = [pose.position for pose in poses]
    stream.log("world/marks", rerun.Points3D(places, radii=BALL, colors=colours, labels=names), static=True)
    _log_mesh(rerun, stream, "world/robot/body", robot_body(recording.robot), BODY)


def _log_mesh(rerun: Any, stream: Any, name: str, surface: Surface, paint: NDArray[np.uint8] | Colour) -> None:
    colours = np.broadcast_to(np.array(paint, np.uint8), surface.vertices.shape)
    mesh = rerun.Mesh3D(vertex_positions=surface.vertices, triangle_indices=surface.faces, vertex_colors=colours)
    stream.log(name, mesh, static=True)


def _log_motion(rerun: Any, stream: Any, recording: Recording) -> None:
    """The robot's poses and its numbers, a column each."""
    nanoseconds = np.round(recording.times * 1e9).astype("timedelta64[ns]")
    times = [rerun.TimeColumn(TIMELINE, duration=nanoseconds)]
    poses = rerun.Transform3D.columns(translation=recording.poses[:, :3], quaternion=recording.poses[:, 3:])
    stream.send_columns("world/robot", indexes=times, columns=poses)
    numbers = {
        "speed/measured": recording.twists[:, 0],
        "speed/commanded": recording.commands[:, 0],
        "yaw_rate/measured": recording.twists[:, 2],
        "yaw_rate/commanded": recording.commands[:, 2],
        "tilt_deg": np.degrees(recording.tilt),
    }
    for name, values in numbers.items():
        stream.send_columns(f"motion/{name}", indexes=times, columns=rerun.Scalars.columns(scalars=values))
    track = rerun.LineStrips3D([recording.poses[:, :3]], radii=LINE, colors=DRIVEN)
    stream.log("world/track", track, static=True)


def _log_happenings(rerun: Any, stream: Any, recording: Recording) -> None:
    """Plans, scans and events, each at its time."""
    for time, path in recording.paths:
        stream.set_time(TIMELINE, duration=time)
        stream.log("world/plan", rerun.LineStrips3D([path], radii=LINE, colors=PLANNED))
    for time, points in recording.scans:
        stream.set_time(TIMELINE, duration=time)
        stream.log("world/scan", rerun.Points3D(points, radii=SCAN_POINT, colors=SCAN))
    for event in recording.events:
        stream.set_time(TIMELINE, duration=event.time)
        stream.log("events", rerun.TextLog(f"{event.source}: {event.kind.value}: {event_text(event)}"))
