"""Clusters of points: single linkage, so that points belong together if a chain of near ones connects them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel

FloatArray = NDArray[np.float64]
Labels = NDArray[np.int64]

BOX_COLUMNS = 8
LEAST_X, GREATEST_X, LEAST_Y, GREATEST_Y, MEAN_Z, POINTS, FREE_X, FREE_Y = range(BOX_COLUMNS)
"""Columns of a box: its sides [m], the mean height [m] of its points, how many there are, and which side along x and
along y is free where the other one is occluded."""
LEAST, NEITHER, GREATEST = -1.0, 0.0, 1.0
"""Which of two sides alone is free; ``NEITHER`` also where both are."""


@kernel
def cluster(points: FloatArray, order: Labels, distance: float) -> tuple[Labels, int]:
    """Label the clusters of points.

    Parameters
    ----------
    points : (n, 3) float64
        [m]
    order : (n,) int64
        Indices of the points by ascending x.
    distance : float
        Points at most this far [m] apart are in one cluster.

    Returns
    -------
    labels : (n,) int64
        From 0 on, in the order in which the clusters' first points stand in ``points``.
    count : int
    """
    n = len(points)
    root = np.arange(n)
    # Step 1: sweep along x; join each point with those that follow within the distance.
    for i in range(n):
        first = order[i]
        for j in range(i + 1, n):
            second = order[j]
            dx = points[second, 0] - points[first, 0]
            if dx > distance:
                break
            dy, dz = points[second, 1] - points[first, 1], points[second, 2] - points[first, 2]
            if dx * dx + dy * dy + dz * dz <= distance * distance:
                a, b = first, second
                while root[a] != a:
                    root[a] = root[root[a]]
                    a = root[a]
                while root[b] != b:
                    root[b] = root[root[b]]
                    b = root[b]
                root[max(a, b)] = min(a, b)  # so the root is the first point of its cluster
    # Step 2: number the roots in the order of the points.
    labels = np.empty(n, dtype=np.int64)
    count = 0
    for i in range(n):
        a = i
        while root[a] != a:
            a = root[a]
        if a == i:
            labels[i] = count
            count += 1
        else:
            labels[i] = labels[a]
    return labels, count


@kernel
def bounding_boxes(points: FloatArray, labels: Labels, count: int) -> FloatArray:
    """(count, BOX_COLUMNS) float64, the box of each cluster of ``points`` (n, 3) [m]; no side is occluded yet."""
    boxes = np.empty((count, BOX_COLUMNS), dtype=np.float64)
    for i in range(count):
        boxes[i, LEAST_X] = boxes[i, LEAST_Y] = np.inf
        boxes[i, GREATEST_X] = boxes[i, GREATEST_Y] = -np.inf
        boxes[i, MEAN_Z] = boxes[i, POINTS] = 0.0
        boxes[i, FREE_X] = boxes[i, FREE_Y] = NEITHER
    for i in range(len(points)):
        box, x, y = boxes[labels[i]], points[i, 0], points[i, 1]
        box[LEAST_X], box[GREATEST_X] = min(box[LEAST_X], x), max(box[GREATEST_X], x)
        box[LEAST_Y], box[GREATEST_Y] = min(box[LEAST_Y], y), max(box[GREATEST_Y], y)
        box[MEAN_Z] += points[i, 2]
        box[POINTS] += 1.0
    for i in range(count):
        boxes[i, MEAN_Z] /= boxes[i, POINTS]
    return boxes
