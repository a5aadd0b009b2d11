"""Layers of others that return what no layer may: refused at once, with the name of the layer."""

import re

import numpy as np
import pytest

from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap

MESH = MeshMap.from_heights(np.zeros((4, 5)), 1.0, 1.0)
FREE = np.zeros(20, dtype=np.float32), np.zeros(20, dtype=np.bool_)


class ForeignLayer(MeshLayer):
    """Returns what the test wants; an exception is raised."""

    values: object = FREE
    changed: object = NOTHING_CHANGED

    def compute(self):
        if isinstance(self.values, BaseException):
            raise self.values
        return self.values

    def update(self, now):
        return self.changed


def computed(values):
    """A map of the mesh with one layer."""
    layer_class = type("Foreign", (ForeignLayer,), {"values": values})
    parameters = MeshMapParameters(mesh_file="none.ply", layers=[{"name": "mine", "type": "foreign"}])
    mesh = MESH.vertices, MESH.faces
    return build_mesh_map(parameters, vertices=mesh[0], faces=mesh[1], load_layer={"foreign": layer_class}.__getitem__)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (KeyError("boom"), "layer 'mine' raised KeyError: 'boom'"),
        (SystemExit(3), "layer 'mine' raised SystemExit: 3"),
        (None, "layer 'mine' raised TypeError: compute must return costs and lethal flags, a tuple, got NoneType"),
        (FREE[0], "layer 'mine' raised TypeError: compute must return costs and lethal flags, a tuple, got ndarray"),
        ((FREE[0][1:], FREE[1]), r"layer 'mine' gives costs of shape \(19,\), expected \(20,\)"),
        ((FREE[0], np.full(20, "no")), "layer 'mine' gives lethal flags of type <U2, expected bool"),
    ],
)
def test_a_layer_that_cannot_be_computed_is_named(values, text):
    with pytest.raises(LayerListError, match=text):
        computed(values)


def test_values_of_other_types_are_converted():
    costs, flags = [0.5] * 19 + [np.nan], np.array([0, 255, *[0] * 18], dtype=np.uint8)
    layer = computed((costs, flags)).layers["mine"]
    assert layer.costs.dtype == np.float32 and layer.lethal.dtype == np.bool_
    assert layer.costs.tolist() == [0.5] * 19 + [np.inf]
    assert np.flatnonzero(layer.lethal).tolist() == [1] and int(layer.lethal.sum()) == 1


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        (
            None,
            r"layer 'mine' raised TypeError: a layer returns the vertices \(k,\) int that have changed, got NoneType",
        ),
        (np.array([1.0, 2.0]), "got ndarray of shape .2,., type float64"),
        (np.array([3, 20]), "vertices 3 to 20 have changed, but the mesh has only 0 to 19"),
        (np.array([-1]), "vertices -1 to -1 have changed"),
    ],
)
def test_a_layer_that_reports_what_is_no_vertex_makes_the_map_stale(changed, text):
    mesh_map = computed(FREE)
    mesh_map.layers["mine"].changed = changed
    with pytest.raises((TypeError, IndexError)):
        mesh_map.update(None, 1.0)
    stale = mesh_map.stale_reason(1.0)
    assert stale.startswith("layer 'mine' raised")
    assert re.search(text, stale)

    mesh_map.layers["mine"].changed = NOTHING_CHANGED
    mesh_map.update(None, 2.0)
    assert mesh_map.stale_reason(2.0) == ""


def test_vertices_in_any_order_and_as_a_list_are_taken():
    layer = ForeignLayer(LayerContext("mine", MESH.topology, MESH.locator, ForeignLayer.Parameters()))
    layer.changed = [7, 3, 7]
    assert LayerGraph([layer]).apply(lambda one: one.update(1.0))["mine"].tolist() == [3, 7]
