"""The costs of the map's layers on the ground that the page draws: one byte a vertex, from the map's nearest vertex.

The map need not be the ground: it may be built from a scan, finer or coarser. Where no vertex of the map is near, the
ground is not on the map. Costs have twenty steps, four from colour to colour: rough ground is noise that no packing
makes smaller, and sixty steps took half as much room again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mbf_abstract.event_values import well_formed
from mbf_abstract.geometry import FloatArray
from terrain.recording.recorded_maps import RecordedMesh
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import WALL
from terrain.viewer.pictures.layer_picture import NOWHERE
from terrain.viewer.pictures.layer_scale import end_of_scale, range_text, shown_layers
from terrain.viewer.replay.packing import Packer

STEPS = 20
FORBIDDEN, NOT_ON_MAP = STEPS + 1, STEPS + 2


def packed_layers(packer: Packer, world: Recording) -> dict[str, Any]:
    """Return the layers that a page can colour the ground by; none where map or ground was not recorded.

    Each has a name, a range such as ``0 to 0.35 rad``, and the number of its steps (V,) uint8 of the ground's vertices,
    which layers of equal looks share.
    """
    listed: list[tuple[str, str, int]] = []
    if world.meshes and world.ground is not None:
        nearest, numbers = nearest_vertices(world.meshes[0], world.ground.vertices), dict[bytes, int]()
        for layer in shown_layers(world.layers):
            steps = cost_steps(layer.costs.astype(np.float64), end_of_scale(layer), nearest)
            if steps.tobytes() not in numbers:
                numbers[steps.tobytes()] = packer.add(steps)
            listed.append((well_formed(layer.name), well_formed(range_text(layer)), numbers[steps.tobytes()]))
    forbidden, nowhere = ((np.array(colour) / 255.0).round(4).tolist() for colour in (WALL, NOWHERE))
    return {"list": listed, "steps": STEPS, "forbidden": forbidden, "nowhere": nowhere}


def cost_steps(costs: FloatArray, top: float, nearest: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Steps (n,) of costs (V,) from 0 to ``top`` at the vertices ``nearest`` (n,), -1 = none."""
    steps = np.where(np.isinf(costs), FORBIDDEN, np.round(STEPS * np.clip(costs / top, 0.0, 1.0)))
    return np.append(steps, NOT_ON_MAP).astype(np.uint8)[nearest]


def nearest_vertices(surface: RecordedMesh, places: FloatArray) -> NDArray[np.int64]:
    """The map's vertex nearest to each place (n, 3) [m]; -1 beyond the longest edge at that vertex."""
    vertices, faces = surface.vertices, surface.faces
    if not len(vertices):
        return np.full(len(places), -1)
    longest = np.zeros(len(vertices))
    for corner in range(3):
        ends = faces[:, corner], faces[:, (corner + 1) % 3]
        lengths = np.linalg.norm(vertices[ends[0]] - vertices[ends[1]], axis=1)
        for end in ends:
            np.maximum.at(longest, end, lengths)
    distances, nearest = cKDTree(vertices).query(places)
    return np.where(distances <= longest[nearest], nearest, -1)
