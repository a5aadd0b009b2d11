"""What of keep-out and slow areas is legal and hardly meant is told at the start, on both maps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.geometry.polygon import area_warning, crossing_sides, inside_polygon
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_mesh_nav.layers.keepout import KeepoutLayer
from mbf_mesh_nav.layers.speed_limit import SpeedLimitLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap

SQUARE = [[1, 1], [2, 1], [2, 2], [1, 2]]
BOW = [[1, 1], [2, 2], [1, 2], [2, 1]]
LINE = [[1, 1], [2, 2], [3, 3]]
AWAY = [[60, 1], [70, 1], [70, 3]]


def warnings_of(kind, backend, polygon, **area):
    """What a map of 5 m x 5 m says of one area in a layer."""
    if backend == "costmap":
        block = {"zones": [{"name": "hall", "polygon": polygon, **area}]}
        parameters = CostmapParameters(width=5.0, height=5.0, robot_radius=0.0, layers=[{"name": "area", "type": kind}])
        return build_layered_costmap(parameters, {"area": block}).configuration_warnings()
    mesh_map = MeshMap.from_heights(np.zeros((11, 11)), 0.5, 0.5)
    layer_class = {"keepout": KeepoutLayer, "speed_limit": SpeedLimitLayer}[kind]
    parameters = layer_class.Parameters.model_validate({"regions": [{"polygon": polygon, **area}]})
    layer = layer_class(LayerContext("area", mesh_map.topology, mesh_map.locator, parameters))
    mesh_map.set_layers(LayerGraph([layer]), "area")
    return mesh_map.configuration_warnings()


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
@pytest.mark.parametrize(
    ("kind", "polygon", "area", "text"),
    [
        ("keepout", SQUARE, {}, ""),
        ("keepout", BOW, {}, "its sides 0 and 2 meet"),
        ("keepout", LINE, {}, "it has no area"),
        ("speed_limit", SQUARE, {"speed_limit": 0.3}, ""),
        ("speed_limit", BOW, {"speed_limit": 0.3}, "its sides 0 and 2 meet"),
        ("speed_limit", LINE, {"speed_limit": 0.3}, "it has no area"),
    ],
)
def test_polygons_that_are_none_are_told(backend, kind, polygon, area, text):
    found = warnings_of(kind, backend, polygon, **area)
    assert len(found) == bool(text) and all("layer 'area': " in one and text in one for one in found)


def test_areas_off_the_map_and_limits_without_effect_are_told():
    assert "it lies outside of the map" in warnings_of("keepout", "costmap", AWAY)[0]
    assert "there is no ground in it" in warnings_of("keepout", "mesh", AWAY)[0]
    assert "there is no ground in it" in warnings_of("keepout", "mesh", SQUARE, z_min=1.0)[0]
    assert "has no effect in a keep-out layer" in warnings_of("keepout", "costmap", SQUARE, speed_limit=0.3)[0]
    assert "it has no speed_limit" in warnings_of("speed_limit", "costmap", SQUARE)[0]


CORNER = st.tuples(st.integers(0, 6), st.integers(0, 6))


@given(st.lists(CORNER, min_size=3, max_size=3, unique=True))
def test_a_triangle_has_no_sides_that_cross(corners):
    assert crossing_sides(np.array(corners, dtype=float)) is None


@given(st.integers(3, 8), st.integers(0, 100))
def test_a_polygon_around_a_point_is_fine_and_with_two_corners_swapped_is_not(count, seed):
    angles = np.sort(np.random.default_rng(seed).permutation(24)[:count]) * np.pi / 12.0
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    if not inside_polygon(np.zeros((1, 2)), around)[0] or np.diff(angles, append=angles[0] + 2 * np.pi).max() > 3.0:
        return
    assert area_warning(around) == ""
    if count > 3:
        assert "meet" in area_warning(around[[1, 0, *range(2, count)]])
