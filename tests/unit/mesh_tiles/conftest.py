"""Makes the small terrains importable; one map of tiles for all tests that only read it."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from tiled_terrains import SPACING, WholeMap, settings, terrain

from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource


@pytest.fixture(scope="session")
def hills():
    """Heights of 97 x 97 samples, 48 m a side."""
    return terrain(97, seed=0)


@pytest.fixture(scope="session")
def heights(tmp_path_factory):
    """A file of 49 x 49 heights, four tiles of 12 m; read only."""
    file = tmp_path_factory.mktemp("heights") / "heights.npy"
    np.save(file, terrain(49, seed=3, walls=3).astype(np.float32))
    return file


@pytest.fixture(scope="session")
def whole_hills(hills):
    return WholeMap(hills)


@pytest.fixture(scope="session")
def tiled_hills(hills, tmp_path_factory):
    """Folder of the hills in tiles of 12 m; read only."""
    folder = tmp_path_factory.mktemp("tiles") / "hills"
    build_tiles(HeightSource(hills, SPACING, SPACING), folder, settings())
    return folder


@pytest.fixture(scope="module")
def way(whole_hills):
    """Free vertices (n, 3) along a line from one corner of the hills towards the other, about every metre."""
    free = whole_hills.map.vertices[~whole_hills.blocked]
    line = np.column_stack([np.linspace(6.0, 42.0, 37), np.linspace(8.0, 40.0, 37)])
    return np.array([free[np.argmin(((free[:, :2] - place) ** 2).sum(axis=1))] for place in line])
