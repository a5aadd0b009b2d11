"""A map as it was at one time of a drive, with the robot, its track, what its sensors hit, and the plan."""

from __future__ import annotations

import numpy as np

from mbf_abstract.drive_log import DriveLog
from mbf_abstract.maps.view import MapView
from terrain.viewer.pictures.colours import SCAN
from terrain.viewer.pictures.picture import draw_marks, draw_paths, draw_track, new_figure, png_bytes
from terrain.viewer.pictures.plan_picture import draw_map, map_extent

SCAN_AGE = 0.5  # s; older scans are not drawn


def map_png(log: DriveLog, time: float, view: MapView) -> bytes:
    """Draw the map of a log at ``time`` [s] as a PNG file; raises ViewerMissing without matplotlib."""
    figure, axes = new_figure(map_extent(view, log.start, log.goals[-1] if log.goals else log.start))
    draw_map(axes, view)
    recent = [scan.points for scan in log.scans if time - SCAN_AGE <= scan.time <= time]
    if recent:
        points = np.concatenate(recent)
        axes.plot(points[:, 0], points[:, 1], ".", color=np.array(SCAN) / 255.0, markersize=2, label="scan", zorder=3)
    draw_paths(axes, [points for when, points in log.paths if when <= time])
    draw_track(axes, log.poses[log.times <= time], log.outline)
    if len(log.times):
        draw_marks(axes, log.start, log.goals)
    title = f"{log.name} · {log.backend} · {time:.1f} s"
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", parse_math=False)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=5, frameon=False, fontsize=9)
    return png_bytes(figure)
