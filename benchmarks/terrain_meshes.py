"""The terrains of the mesh benchmarks: fractal heights on a square grid, costs from slope, lethal blobs.

Median slope 15 degrees, 95 % below 29 degrees, 0.1 m spacing, cost 0 to 0.95 with mean 0.26; the same recipe the
figures of the C++ original (see ``CPP_RATIOS`` in ``mesh_speed.py``) were measured on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.map.layer import CostArray, LayerContext, LethalArray, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

SPACING = 0.1
MEDIAN_SLOPE = np.radians(15.0)


@dataclass(frozen=True)
class Terrain:
    """A generated terrain: vertices (V, 3), faces (F, 3), costs (V,) float32, lethal (V,) bool."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    costs: NDArray[np.float32]
    lethal: NDArray[np.bool_]


def fractal_terrain(side: int, seed: int = 0) -> Terrain:
    """A terrain of ``side`` x ``side`` vertices."""
    rng = np.random.default_rng(seed)
    heights = fractal_noise(side, 1.3, rng)
    slope_y, slope_x = np.gradient(heights, SPACING)
    heights *= np.tan(MEDIAN_SLOPE) / np.median(np.hypot(slope_x, slope_y))
    slope_y, slope_x = np.gradient(heights, SPACING)
    vertices, faces = heightfield_mesh(heights, SPACING, SPACING)
    slope = np.hypot(slope_x, slope_y).ravel()
    costs = np.clip(slope * 0.26 / slope.mean(), 0.0, 0.95).astype(np.float32)
    blobs = fractal_noise(side, 0.8, rng).ravel()
    return Terrain(vertices, faces, costs, blobs > np.quantile(blobs, 0.96))


def fractal_noise(side: int, exponent: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise (side, side) whose spectrum falls with the frequency to the power of ``2 * exponent``."""
    squared = np.fft.fftfreq(side)[:, None] ** 2 + np.fft.rfftfreq(side)[None] ** 2
    squared[0, 0] = np.inf
    spectrum = (rng.normal(size=squared.shape) + 1j * rng.normal(size=squared.shape)) / squared**exponent
    return np.fft.irfft2(spectrum, s=(side, side))


def shuffled(terrain: Terrain, seed: int = 1) -> Terrain:
    """The same terrain with vertices and faces in random order."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(terrain.vertices))
    place = np.argsort(order).astype(np.int32)
    faces = place[terrain.faces][rng.permutation(len(terrain.faces))]
    return Terrain(terrain.vertices[order], faces, terrain.costs[order], terrain.lethal[order])


class GivenLayer(MeshLayer):
    """A layer with costs and lethal flags given from outside."""

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Keep what was given."""
        return self._costs, self._lethal


def add_layer(mesh_map: MeshMap, costs: CostArray, lethal: LethalArray | None = None) -> GivenLayer:
    """Give a map one layer with values in the caller's numbering, edge cost factor 1."""
    context = LayerContext("given", mesh_map.topology, mesh_map.locator, GivenLayer.Parameters())
    layer = GivenLayer(context)
    order = mesh_map.internal_to_input
    layer.replace(costs[order], np.zeros(len(order), np.bool_) if lethal is None else lethal[order])
    mesh_map.set_layers(LayerGraph([layer]), "given", edge_cost_factor=1.0)
    return layer
