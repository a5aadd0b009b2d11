"""What does not move as one mesh for the graphics card: one buffer of vertices, several lists of faces.

Positions are 16-bit fractions of the box around the world. Coarser levels of detail use the same vertices: all
vertices in a cell of a cubic grid become the one nearest to their mean, and faces with two equal corners are left out
(Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.recording.recording import Recording
from terrain.viewer.pictures.shading import FLAT_GROUND
from terrain.viewer.pictures.shapes import standing_things
from terrain.worlds.surface import Surface, joined

SLOPED, FLOOR_PAINT, WALL_PAINT, OBSTACLE_PAINT = range(4)  # as in page/shaders.js
PAINTS = {"walls": WALL_PAINT, "obstacles": OBSTACLE_PAINT}
FRACTIONS = 65535
COARSENING = (3.0, 9.0)  # sizes of the cells, in mean edges
LEAST_FACES = 20_000  # smaller worlds are drawn in full from everywhere


class WorldMesh(NamedTuple):
    """A mesh for the page.

    Attributes
    ----------
    origin, size : (3,) float64
        Lower corner and lengths of the box around it [m].
    vertices : (V, 3) uint16
        In fractions of the box.
    paints : (V,) uint8
        ``SLOPED`` for ground in the colours of its slopes, and so on.
    levels : list of (cell size [m], (F, 3) uint32)
        Faces, finest first.
    """

    origin: FloatArray
    size: FloatArray
    vertices: NDArray[np.uint16]
    paints: NDArray[np.uint8]
    levels: list[tuple[float, NDArray[np.uint32]]]


def world_mesh(recording: Recording) -> WorldMesh:
    """Return ground, walls and obstacles of a recording; a box around start and goals where it has none of them."""
    parts: list[tuple[Surface, int]] = []
    if recording.ground is not None:
        flat = not len(recording.ground.vertices) or np.ptp(recording.ground.vertices[:, 2]) < FLAT_GROUND
        parts.append((recording.ground, FLOOR_PAINT if flat else SLOPED))
    parts += [(surface, PAINTS[name]) for name, surface, _ in standing_things(recording)]
    surface = joined([part for part, _ in parts])
    counts = [len(part.vertices) for part, _ in parts]
    paints = np.repeat(np.array([paint for _, paint in parts], np.uint8), counts)
    ends = np.array([pose.position for pose in (recording.start, *recording.goals)])
    seen = surface.vertices if len(surface.vertices) else ends
    origin, size = seen.min(axis=0), np.maximum(np.ptp(seen, axis=0), 1.0)
    vertices = np.round((surface.vertices - origin) / size * FRACTIONS).astype(np.uint16)
    faces = surface.faces.astype(np.uint32)
    levels = [(0.0, faces)]
    if len(faces) >= LEAST_FACES:
        edge = mean_edge(surface)
        levels += [(factor * edge, coarse_faces(surface, paints, factor * edge)) for factor in COARSENING]
    return WorldMesh(origin, size, vertices, paints, levels)


def mean_edge(surface: Surface) -> float:
    """Mean length [m] of the first edges of the faces."""
    first, second = surface.vertices[surface.faces[:, 0]], surface.vertices[surface.faces[:, 1]]
    return float(np.linalg.norm(second - first, axis=1).mean())


def coarse_faces(surface: Surface, paints: NDArray[np.uint8], cell: float) -> NDArray[np.uint32]:
    """Faces (F, 3) of a coarser mesh of the same vertices; ``cell`` [m] is the size of the grid's cells."""
    x, y, z = np.floor((surface.vertices - surface.vertices.min(axis=0)) / cell).astype(np.int64).T
    keys = ((x * (y.max() + 1) + y) * (z.max() + 1) + z) * (int(paints.max()) + 1) + paints
    _, group = np.unique(keys, return_inverse=True)
    counts = np.bincount(group)
    means = np.column_stack([np.bincount(group, column) / counts for column in surface.vertices.T])
    distances = np.linalg.norm(surface.vertices - means[group], axis=1)
    order = np.lexsort((distances, group))
    nearest = order[np.searchsorted(group[order], np.arange(len(counts)))]
    faces = nearest[group[surface.faces]]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return np.asarray(faces, dtype=np.uint32)
