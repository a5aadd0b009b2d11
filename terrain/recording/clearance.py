"""How far a robot kept from everything that stands or moves around it, from its recording alone.

The distance is that between outlines as seen from above. What is above the robot or below its wheels does not count,
nor does the ground, however steep. The robot's own tilt is left out.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import arctan2, norm, plane_rotation, rotated
from terrain.physics.contact_depth import placed
from terrain.recording.recording import Recording
from terrain.worlds.surface import Surface

PIECE = 0.5  # m; longer edges are cut, so that few pieces are near a robot
NEAR_GROUND = 0.03  # m above the wheels; what ends below is driven over


def clearances(recording: Recording) -> FloatArray:
    """Distance (n,) [m] of the robot's outline from the nearest wall, obstacle or actor; inf without any."""
    outline, height = recording.robot.footprint, recording.robot.height
    reach = float(norm(outline).max(initial=0.0))
    standing = [surface for surface in (recording.walls, recording.obstacles) if surface is not None]
    pieces, heights = _edges(standing)
    middles = pieces.mean(axis=1)
    actors = [(track, *_edges([Surface(track.vertices, track.faces)])) for track in recording.actors]
    found = np.full(len(recording.poses), np.inf)
    yaws = yaws_of(recording.poses[:, 3:])
    for index, ((x, y, z), yaw) in enumerate(zip(recording.poses[:, :3].tolist(), yaws.tolist(), strict=True)):
        corners, centre, low, high = placed(outline, x, y, yaw), np.array([x, y]), z + NEAR_GROUND, z + height
        beside = (heights[:, 1] >= low) & (heights[:, 0] <= high)
        nearest = _nearest(corners, centre, reach, pieces[beside], middles[beside])
        for track, edges, spans in actors:
            pose = track.poses[index]
            if norm(pose[:2] - centre) - reach - norm(edges).max(initial=0.0) >= nearest:
                continue
            beside = (spans[:, 1] + pose[2] >= low) & (spans[:, 0] + pose[2] <= high)
            turned = rotated(plane_rotation(float(yaws_of(pose[None, 3:])[0])), edges[beside]) + pose[:2]
            nearest = min(nearest, _nearest(corners, centre, reach, turned, turned.mean(axis=1)))
        found[index] = nearest
    return found


def yaws_of(orientations: FloatArray) -> FloatArray:
    """Headings (n,) [rad] of quaternions (n, 4) x y z w."""
    x, y, z, w = orientations.T
    return np.asarray(arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _edges(surfaces: list[Surface]) -> tuple[FloatArray, FloatArray]:
    """Edges of all triangles from above, in pieces (k, 2, 2) [m], and the heights that each reaches over (k, 2)."""
    triangles = np.concatenate([np.zeros((0, 3, 3)), *(surface.vertices[surface.faces] for surface in surfaces)])
    spans = np.column_stack([triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)])
    edges = np.concatenate([triangles[:, [i, j], :2] for i, j in ((0, 1), (1, 2), (2, 0))])
    rows, kept = np.unique(np.column_stack([edges.reshape(-1, 4), np.tile(spans, (3, 1))]), axis=0), []
    for row, count in zip(rows, np.maximum(1, np.ceil(norm(rows[:, 2:4] - rows[:, :2]) / PIECE)), strict=True):
        shares = np.linspace(0.0, 1.0, int(count) + 1)[:, None]
        points = row[:2] + shares * (row[2:4] - row[:2])
        kept.append(np.column_stack([points[:-1], points[1:], np.tile(row[4:], (len(points) - 1, 1))]))
    cut = np.concatenate([np.zeros((0, 6)), *kept])
    return cut[:, :4].reshape(-1, 2, 2), cut[:, 4:]


def _nearest(
    corners: FloatArray, centre: FloatArray, reach: float, pieces: FloatArray, middles: FloatArray
) -> float:  # fmt: skip
    """Distance [m] of a convex outline (n, 2) around ``centre`` to the nearest of pieces (k, 2, 2); inf for none."""
    if not len(pieces):
        return np.inf
    far = norm(middles - centre)
    near = pieces[far <= far.min() + reach + 0.5 * PIECE]  # no other can be the nearest of the outline
    if _crosses(corners, near):
        return 0.0
    edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    return min(_least(near.reshape(-1, 2), edges), _least(corners, near))


def _least(points: FloatArray, pieces: FloatArray) -> float:
    """Least distance [m] between points (n, 2) and straight pieces (k, 2, 2)."""
    starts, along = pieces[:, 0], pieces[:, 1] - pieces[:, 0]
    squared = np.maximum(np.sum(along**2, axis=1), 1e-12)
    offsets = points[:, None] - starts
    share = np.clip(np.sum(offsets * along, axis=2) / squared, 0.0, 1.0)
    return float(norm(offsets - share[..., None] * along).min())


def _crosses(corners: FloatArray, pieces: FloatArray) -> bool:
    """Whether any of the pieces (k, 2, 2) has a point in the convex outline (n, 2), counter-clockwise (Cyrus, Beck)."""
    along = np.roll(corners, -1, axis=0) - corners
    begin, end = (  # how far (k, n) the ends of each piece are beyond each side of the outline
        (pieces[:, None, side, 0] - corners[:, 0]) * along[:, 1]
        - (pieces[:, None, side, 1] - corners[:, 1]) * along[:, 0]
        for side in (0, 1)
    )
    slope = end - begin
    crossing = -begin / np.where(slope == 0.0, 1.0, slope)
    enters = np.where(slope < 0.0, crossing, 0.0).max(axis=1)
    leaves = np.where(slope > 0.0, crossing, np.where((slope == 0.0) & (begin > 0.0), -1.0, 1.0)).min(axis=1)
    return bool((np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)).any())
