"""Facts about walkable surfaces that Recast's and mesh_navigation's tests publish; the number is in the test's name."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from mbf_mesh_nav.layers.border import BorderLayer
from mbf_mesh_nav.layers.clearance import ClearanceLayer
from mbf_mesh_nav.layers.height_diff import HeightDiffLayer
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.layers.keepout import KeepoutLayer
from mbf_mesh_nav.layers.label import LabelLayer
from mbf_mesh_nav.layers.steepness import SteepnessLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import MeshError

FLAT = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def computed(mesh, layer_class, inputs=(), **parameters):
    settings = layer_class.Parameters(**parameters)
    layer = layer_class(LayerContext(layer_class.__name__, mesh.topology, mesh.locator, settings, inputs))
    layer.recompute()
    return layer


def triangle(corners, order=(0, 1, 2)):
    return MeshMap.from_arrays(np.array(corners, dtype=float), [list(order)])


def lethal_of(layer, mesh):
    return mesh.to_input_order(layer.lethal).astype(bool)


# ----------------------------------------------------------------------------------------------- walkable slope
def test_f309_a_level_face_is_traversable_and_one_wound_the_other_way_is_refused():
    # Recast: the reversed face is not walkable. Ours: a mesh that faces down is a mistake of its export, found on load.
    assert not computed(triangle(FLAT), SteepnessLayer, threshold=math.radians(45)).lethal.any()
    with pytest.raises(MeshError, match="1 faces face down"):
        triangle(FLAT, (0, 2, 1))


@pytest.mark.parametrize("cleared", [True, False], ids=["F310-clear", "F310-mark"])
def test_f310_a_label_stays_on_a_face_too_steep_to_walk_on(cleared):
    # Recast keeps one area a face, so "too steep" has to replace it or not. Ours keeps both: a layer each.
    mesh = triangle([[0, 0, 0], [1, 0, 0], [0, 0.1, 1]])
    region = {"polygon": ((-1, -1), (2, -1), (2, 2), (-1, 2)), "label": "lawn"}
    label = computed(mesh, LabelLayer, regions=() if cleared else (region,), label_costs={"lawn": 42.0})
    assert computed(mesh, SteepnessLayer, threshold=math.radians(45)).lethal.all()
    assert (label.costs == (0.0 if cleared else 42.0)).all()


def test_f311_a_slope_equal_to_the_limit_is_traversable():
    # Recast: a slope equal to the limit fails, so nothing passes a limit of 0. Ours: lethal is what exceeds it, as in
    # mesh_navigation, and a limit of 0 is refused when the configuration is read.
    tilted = triangle([[0, 0, 0], [1, 0, math.tan(0.5)], [0, 1, 0]])
    limit = computed(tilted, SteepnessLayer).costs[0]
    assert not computed(tilted, SteepnessLayer, threshold=float(limit)).lethal.any()
    assert computed(tilted, SteepnessLayer, threshold=float(np.nextafter(limit, np.float32(0.0)))).lethal.all()
    with pytest.raises(ValidationError, match="threshold"):
        SteepnessLayer.Parameters(threshold=0.0)


# --------------------------------------------------------------------------------------------- walkable filters
def beside_steps(*rises, limit):
    """Height differences and lethal flags of the level floor beside rises [m] from column to column, 0.1 m each.

    At the edges of a step the vertex normals lean, and mesh_navigation's rule measures more there than its height.
    """
    mesh = MeshMap.from_heights(np.tile(np.cumsum([0.0] * 12 + [*rises] + [0.0] * 12), (9, 1)), 0.1, 0.1)
    layer, level = computed(mesh, HeightDiffLayer, radius=0.35, threshold=limit), mesh.vertex_normals[:, 2] > 1.0 - 1e-9
    return layer.costs[level], layer.lethal[level]


@pytest.mark.parametrize(("rise", "walkable"), [(0.05, True), (0.06, False)], ids=["F315-at-limit", "F315-above"])
def test_a_step_as_high_as_the_limit_is_traversable(rise, walkable):
    heights, lethal = beside_steps(rise, limit=float(np.float32(0.05)))
    assert heights.max() == pytest.approx(rise)
    assert lethal.any() != walkable


def test_f316_of_stacked_low_steps_only_the_first_can_be_climbed():
    # Recast lets the robot onto the first and no farther. Ours looks at all heights within the radius, so two steps
    # that lie side by side are as high as both together, and the robot keeps off them.
    assert not beside_steps(0.04, limit=0.05)[1].any()
    assert beside_steps(0.04, 0.04, limit=0.05)[1].any()


def test_f317_the_edge_of_a_flat_floor_is_blocked_and_its_inside_is_not():
    mesh = MeshMap.from_heights(np.zeros((10, 10)), 1.0, 1.0)
    lethal = lethal_of(computed(mesh, BorderLayer), mesh).reshape(10, 10)
    inside = np.zeros((10, 10), dtype=bool)
    inside[1:-1, 1:-1] = True
    np.testing.assert_array_equal(lethal, ~inside)


@pytest.mark.parametrize(
    ("gap", "walkable"), [(0.9, False), (1.1, True), (None, True)], ids=["F318-low", "F318-enough", "F318-open"]
)
def test_f318_a_floor_below_a_ceiling_needs_the_robots_height(gap, walkable):
    floor, faces = heightfield_mesh(np.zeros((6, 6)), 1.0, 1.0)
    mesh = MeshMap.from_arrays(floor, faces)
    if gap is not None:
        ceiling = floor + np.array([0.0, 0.0, gap])
        mesh = MeshMap.from_arrays(np.vstack([floor, ceiling]), np.vstack([faces, faces + len(floor)]))
    lethal = lethal_of(computed(mesh, ClearanceLayer, robot_height=1.0, height_inflation=0.0), mesh)[: len(floor)]
    assert lethal.all() != walkable and (~lethal).all() == walkable


# ------------------------------------------------------------------------------------------ layers of mesh_navigation
def test_f180_the_third_corner_of_a_right_triangle_is_a_leg_away():
    mesh = triangle([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0]])
    source = computed(mesh, KeepoutLayer)
    lethal = np.arange(3) == mesh.input_to_internal[0]
    source.replace(lethal.astype(np.float32), lethal)
    layer = computed(mesh, InflationLayer, (source,), inscribed_radius=0.25, inflation_radius=1.5)
    np.testing.assert_allclose(mesh.to_input_order(layer.distances), [0.0, 0.5, 0.5])


@pytest.mark.parametrize(
    ("distance", "low", "high"),
    [
        pytest.param(0.2, 0.9, 0.9, id="F181-inside"),
        pytest.param(0.5, 0.9, 0.9, id="F181-at-inscribed"),
        pytest.param(0.6, 1e-3, 0.9 - 1e-3, id="F181-fading"),
        pytest.param(2.0, 0.0, 0.0, id="F181-beyond"),
    ],
)
def test_the_cost_of_inflation_is_flat_then_fades_then_ends(distance, low, high):
    mesh = triangle([[0, 0, 0], [distance, 0, 0], [0, 9, 0]])
    source = computed(mesh, KeepoutLayer)
    lethal = np.arange(3) == mesh.input_to_internal[0]
    source.replace(lethal.astype(np.float32), lethal)
    radii = {"inscribed_radius": 0.5, "inflation_radius": 1.5, "inscribed_value": 0.9, "cost_scaling_factor": 3.0}
    layer = computed(mesh, InflationLayer, (source,), **radii)
    assert np.float32(low) <= mesh.to_input_order(layer.costs)[1] <= np.float32(high)


def test_f182_layers_keep_the_order_of_their_list(tmp_path):
    vertices, faces = heightfield_mesh(np.zeros((4, 4)), 1.0, 1.0)
    rows = ["v {:g} {:g} {:g}".format(*v) for v in vertices] + ["f {} {} {}".format(*(f + 1)) for f in faces]
    (tmp_path / "floor.obj").write_text("\n".join(rows) + "\n")
    names = ("t3", "t1", "t2")
    entries = tuple(MeshLayerEntry(name=name, type="border") for name in names)
    mesh = build_mesh_map(MeshMapParameters(mesh_file=str(tmp_path / "floor.obj"), layers=entries), {})
    assert tuple(mesh.layers) == names
    assert [mesh.layers[name].name for name in names] == list(names)
