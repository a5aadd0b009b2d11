"""Which sides of a cluster are its own, and which are only where something nearer begins to hide it.

Somebody who comes out lengthwise from behind a wall grows: the side ahead moves at their speed, the one behind stays on
the line of sight past the wall, and the middle between both moves at half the speed. A shelf that a driving robot
uncovers grows as well; its own side stays, and the other one moves with the line of sight. So motion shows only in the
sides that are not occluded (Petrovskaya, Thrun 2009 measure a vehicle from the corner of it that they see).

The surface of a cluster ends, seen from the sensor, on its right and on its left. Where the thing itself ends there,
the ray beside that end goes past it, to something behind. Where something hides the rest, the ray ends nearer; where
the rest is part of the static map, as of a shelf that stands at a wall, or out of range, it ends about as far away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_abstract.maps.tracking.kernels.clustering import (
    FREE_X,
    FREE_Y,
    GREATEST,
    GREATEST_X,
    GREATEST_Y,
    LEAST,
    LEAST_X,
    LEAST_Y,
    NEITHER,
)

FloatArray = NDArray[np.float64]
Indices = NDArray[np.int64]

NO_POINT = -1
RIGHT, LEFT = 0, 1
"""The two ends of a cluster, seen from the sensor."""
BESIDE = 0.06
"""The ray beside an end is seen at most this far from it, as the tangent of the angle between both."""
TOUCHING = 0.15
"""A ray beside an end that ends no farther [m] behind it says that the thing goes on there, as a part of the static map
or out of range."""
NOISE = 0.03
"""So much farther out [m] than the other end of a face an end has to be, or noise would decide to which side it is."""
TOWARDS = 0.1
"""The same as a share of the length of the face: one along a side ends at that side itself."""


@kernel
def find_free_sides(
    points: FloatArray,
    labels: Indices,
    boxes: FloatArray,
    ends: FloatArray,
    sensor: FloatArray,
    max_size: float,
) -> None:
    """Note in ``boxes`` which side of each cluster along x and along y is free where the other one is occluded.

    Parameters
    ----------
    points : (n, 3) float64
        What was hit [m].
    labels : (n,) int64
        Cluster of each.
    boxes : (count, BOX_COLUMNS) float64
        Of the clusters; those longer than ``max_size`` [m] are left as they are.
    ends : (m, 3) float64
        Of all rays of the scan [m], those of the points among them; of one that hit nothing at its maximal range.
    sensor : (3,) float64
        Where all rays begin [m].
    """
    last = _last_points(points, labels, boxes, sensor)
    for j in range(len(boxes)):
        box = boxes[j]
        if max(box[GREATEST_X] - box[LEAST_X], box[GREATEST_Y] - box[LEAST_Y]) > max_size:
            continue
        least_x = greatest_x = least_y = greatest_y = False
        for side in range(2):
            i = last[j, side]
            if i == NO_POINT or not _is_occluded(points[i], side, ends, sensor):
                continue
            corner = _corner(points, labels, i, last[j, LEFT if side == RIGHT else RIGHT])
            x, y = points[i, 0] - points[corner, 0], points[i, 1] - points[corner, 1]
            out = max(NOISE, TOWARDS * np.sqrt(x * x + y * y))
            least_x, greatest_x = least_x or x < -out, greatest_x or x > out
            least_y, greatest_y = least_y or y < -out, greatest_y or y > out
        box[FREE_X], box[FREE_Y] = _free_one(least_x, greatest_x), _free_one(least_y, greatest_y)


@kernel
def _free_one(least_occluded: bool, greatest_occluded: bool) -> float:
    if least_occluded == greatest_occluded:
        return NEITHER
    return GREATEST if least_occluded else LEAST


@kernel
def _last_points(points: FloatArray, labels: Indices, boxes: FloatArray, sensor: FloatArray) -> Indices:
    """(count, 2) int64, the last point of each cluster on its right and left; NO_POINT if it is all around the sensor.

    Of two points in one direction the first one counts.
    """
    last = np.empty((len(boxes), 2), dtype=np.int64)
    tangents = np.empty((len(boxes), 2), dtype=np.float64)
    around = np.empty(len(boxes), dtype=np.bool_)
    for j in range(len(boxes)):
        last[j, RIGHT] = last[j, LEFT] = NO_POINT
        tangents[j, RIGHT], tangents[j, LEFT] = np.inf, -np.inf
        around[j] = False
    for i in range(len(points)):
        j = labels[i]
        cx = 0.5 * (boxes[j, LEAST_X] + boxes[j, GREATEST_X]) - sensor[0]
        cy = 0.5 * (boxes[j, LEAST_Y] + boxes[j, GREATEST_Y]) - sensor[1]
        x, y = points[i, 0] - sensor[0], points[i, 1] - sensor[1]
        along = cx * x + cy * y
        if along <= 0.0:
            around[j] = True
            continue
        tangent = (cx * y - cy * x) / along
        if tangent < tangents[j, RIGHT]:
            tangents[j, RIGHT], last[j, RIGHT] = tangent, i
        if tangent > tangents[j, LEFT]:
            tangents[j, LEFT], last[j, LEFT] = tangent, i
    for j in range(len(boxes)):
        if around[j]:
            last[j, RIGHT] = last[j, LEFT] = NO_POINT
    return last


@kernel
def _is_occluded(point: FloatArray, side: int, ends: FloatArray, sensor: FloatArray) -> bool:
    """Whether the ray beside a point, on one ``side`` of it, ends nearer than that or about there.

    A ray is beside it that is not steeper or flatter by more than it is turned: one of the same row of a lidar.
    """
    px, py = point[0] - sensor[0], point[1] - sensor[1]
    distance = np.sqrt(px * px + py * py)
    slope, turned = (point[2] - sensor[2]) / distance, 1.0 if side == LEFT else -1.0
    nearest, occluded = BESIDE, False
    for k in range(len(ends)):
        x, y = ends[k, 0] - sensor[0], ends[k, 1] - sensor[1]
        along, across = px * x + py * y, turned * (px * y - py * x)
        if across <= 0.0 or across >= nearest * along:
            continue
        length = np.sqrt(x * x + y * y)
        if abs((ends[k, 2] - sensor[2]) / length - slope) * along <= across:
            nearest, occluded = across / along, length < distance + TOUCHING
    return occluded


@kernel
def _corner(points: FloatArray, labels: Indices, end: int, other_end: int) -> int:
    """The last point of the face that one end of a cluster lies on: its corner, or the ``other_end``.

    It is the point that is farthest off the line between both ends, if it is off it by more than noise.
    """
    x, y = points[end, 0], points[end, 1]
    along_x, along_y = points[other_end, 0] - x, points[other_end, 1] - y
    farthest, corner = NOISE * np.sqrt(along_x * along_x + along_y * along_y), other_end
    for i in range(len(points)):
        if labels[i] == labels[end]:
            off = abs(along_x * (points[i, 1] - y) - along_y * (points[i, 0] - x))
            if off > farthest:
                farthest, corner = off, i
    return corner
