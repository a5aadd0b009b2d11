"""Meshes with lethal vertices and their inflation."""

import numpy as np
from scipy.spatial import Delaunay

from mbf_mesh_nav.layers.inflation import InflationLayer, InflationParameters
from mbf_mesh_nav.layers.keepout import KeepoutLayer, KeepoutParameters
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.mesh_map import MeshMap


def chain(mesh: MeshMap, lethal: np.ndarray, **parameters: float) -> tuple[KeepoutLayer, InflationLayer]:
    source = KeepoutLayer(LayerContext("source", mesh.topology, mesh.locator, KeepoutParameters()))
    source.replace(lethal.astype(np.float32), lethal.copy())
    radius = parameters.get("inflation_radius", 1.0)
    settings_ = InflationParameters(**{"inflation_radius": 1.0, "inscribed_radius": min(0.25, radius), **parameters})
    inflation = InflationLayer(LayerContext("inflation", mesh.topology, mesh.locator, settings_, (source,)))
    inflation.recompute()
    return source, inflation


def bumpy(seed: int) -> MeshMap:
    rng = np.random.default_rng(seed)
    return MeshMap.from_heights(rng.random((14, 12)) * 0.15, 0.1, 0.12)


def scattered(seed: int, jitter: float = 0.03) -> MeshMap:
    """Flat ground of 4 m x 4 m, its triangles of all shapes."""
    places = np.stack(np.meshgrid(*2 * [np.arange(41) * 0.1]), axis=-1).reshape(-1, 2)
    places += np.random.default_rng(seed).uniform(-jitter, jitter, places.shape)
    flat = np.column_stack([places, np.zeros(len(places))])
    return MeshMap.from_arrays(flat, Delaunay(places).simplices.astype(np.int32))
