"""Small maps and ready-made plugins for the tests of planning and control on meshes."""

import numpy as np
import pytest

from mbf_mesh_nav.layer import LayerContext, MeshLayer
from mbf_mesh_nav.layer_graph import LayerGraph
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.plugins import MeshContext


class SettableClock:
    """A clock that shows what the test sets."""

    time = 0.0

    def now(self):
        return self.time


class PaintedLayer(MeshLayer):
    """A layer whose costs a test sets with ``replace``."""

    def compute(self):
        return self._costs, self._lethal


@pytest.fixture(scope="session")
def make_plugin():
    """Factory: a plugin on a map with some parameters."""

    def make(plugin_class, mesh_map, robot=None, **parameters):
        parameters = plugin_class.Parameters(**parameters)
        rng = np.random.default_rng(0)
        return plugin_class(MeshContext("under_test", parameters, SettableClock(), rng, robot, mesh_map))

    return make


@pytest.fixture(scope="session")
def paint():
    """Factory: give a map one layer with costs [and lethal flags] from a function of the vertices (V, 3)."""

    def paint_map(mesh_map, costs, edge_cost_factor=0.0):
        layer = PaintedLayer(LayerContext("painted", mesh_map.topology, mesh_map.locator, PaintedLayer.Parameters()))
        values = np.asarray(costs(mesh_map.vertices), np.float32)
        layer.replace(values, ~np.isfinite(values))
        mesh_map.set_layers(LayerGraph([layer]), "painted", edge_cost_factor)
        return mesh_map

    return paint_map


@pytest.fixture(scope="session")
def hills():
    """A 6 m x 6 m field of gentle bumps, 0.1 m spacing, no costs."""
    x, y = np.meshgrid(np.arange(61) * 0.1, np.arange(61) * 0.1)
    return MeshMap.from_heights(0.25 * np.sin(1.5 * x) * np.cos(1.2 * y), 0.1, 0.1)


@pytest.fixture
def plain():
    """Factory: a flat field [m] with some spacing."""

    def make(width=6.0, height=6.0, spacing=0.2):
        shape = (round(height / spacing) + 1, round(width / spacing) + 1)
        return MeshMap.from_heights(np.zeros(shape), spacing, spacing)

    return make
