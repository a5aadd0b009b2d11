"""A robot that grows or shrinks while the server runs: layers of a mesh that know its radius follow."""

import numpy as np
import pytest

from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.layers.moving_obstacles import MovingObstaclesLayer
from mbf_mesh_nav.layers.obstacle import ObstacleLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap


def map_for(radius, inscribed=0.3, inflation=0.5):
    """A flat map for a robot of a radius, with obstacles, those that move, and an inflation."""
    mesh_map = MeshMap.from_heights(np.zeros((21, 21)), 0.1, 0.1)
    mesh_map.inscribed_radius = radius
    layers = []
    for layer_class, block in (
        (ObstacleLayer, {}),
        (MovingObstaclesLayer, {"sources": ("lidar",), "inscribed_radius": inscribed}),
        (InflationLayer, {"inscribed_radius": inscribed, "inflation_radius": inflation}),
    ):
        parameters, inputs = layer_class.Parameters.model_validate(block), tuple(layers[-1:])
        name = layer_class.__name__
        layers.append(layer_class(LayerContext(name, mesh_map.topology, mesh_map.locator, parameters, inputs)))
        layers[-1].recompute()
    mesh_map.set_layers(LayerGraph(layers), layers[-1].name, 0.0)
    return mesh_map


def radii(mesh_map):
    moving, inflation = (mesh_map.layers[name].parameters for name in ("MovingObstaclesLayer", "InflationLayer"))
    return [
        round(radius, 9) for radius in (moving.inscribed_radius, inflation.inscribed_radius, inflation.inflation_radius)
    ]


def grow(mesh_map, radius):
    mesh_map.take_parameters(MeshMapParameters(mesh_file="", inscribed_radius=radius))


def test_the_radii_of_layers_follow_that_of_the_robot_and_come_back():
    mesh_map = map_for(0.3)
    grow(mesh_map, 0.7)
    assert mesh_map.inscribed_radius == 0.7 and radii(mesh_map) == [0.7, 0.7, 0.9]
    grow(mesh_map, 0.3)
    assert radii(mesh_map) == [0.3, 0.3, 0.5]


def test_a_layer_that_keeps_more_distance_than_the_robot_needs_goes_on_to_do_so():
    mesh_map = map_for(0.2)
    grow(mesh_map, 0.4)
    assert radii(mesh_map) == [0.5, 0.5, 0.7]


def test_where_the_map_knows_no_radius_that_of_the_layer_is_the_robots():
    mesh_map = map_for(0.0)
    grow(mesh_map, 0.4)
    assert radii(mesh_map) == [0.4, 0.4, 0.6]
    grow(mesh_map, 0.0)  # unknown from now on
    assert radii(mesh_map) == [0.4, 0.4, 0.6]


def test_a_radius_that_a_layer_cannot_have_changes_nothing():
    mesh_map = map_for(0.5)
    with pytest.raises(ValueError, match="inscribed_radius"):
        grow(mesh_map, 0.15)
    assert mesh_map.inscribed_radius == 0.5 and radii(mesh_map) == [0.3, 0.3, 0.5]


def test_a_layer_that_does_not_come_through_gives_all_of_them_back(monkeypatch):
    mesh_map = map_for(0.3)
    replaced = mesh_map.set_layer_parameters

    def refuse(name, parameters):
        if name == "InflationLayer":
            raise ValueError("not that one")
        replaced(name, parameters)

    monkeypatch.setattr(mesh_map, "set_layer_parameters", refuse)
    with pytest.raises(ValueError, match="not that one"):
        grow(mesh_map, 0.7)
    assert mesh_map.inscribed_radius == 0.3 and radii(mesh_map) == [0.3, 0.3, 0.5]
