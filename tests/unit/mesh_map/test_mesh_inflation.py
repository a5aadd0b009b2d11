"""Inflation of meshes: the reference's assertions, costs, repairs that equal a new start, and what is reported."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inflated_ground import bumpy, chain, scattered

from mbf_mesh_nav.kernels.layers.front_offers import straight_arrival
from mbf_mesh_nav.kernels.layers.inflation import update_sources
from mbf_mesh_nav.layers.inflation import InflationLayer, InflationParameters
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh


def test_wave_front_reaches_the_third_corner_of_an_isosceles_triangle_at_its_leg():
    # corners (0,0) d=0, (0.5,0) d=?, (0,0.5) d=0.5: legs 0.5
    assert straight_arrival(0.0, 0.5, 0.25, 0.5, 0.25)[0] == np.inf  # it does not cut the face; the edge counts

    mesh = MeshMap.from_arrays([[0.0, 0, 0], [0.5, 0, 0], [0, 0.5, 0]], [[0, 1, 2]])
    corner = mesh.input_to_internal[0]
    _, inflation = chain(mesh, np.arange(3) == corner, inscribed_radius=0.5, inflation_radius=1.5, inscribed_value=0.9)

    np.testing.assert_allclose(mesh.to_input_order(inflation.distances), [0.0, 0.5, 0.5])
    np.testing.assert_allclose(mesh.to_input_order(inflation.costs), [1.0, 0.9, 0.9], rtol=1e-6)


def naive_cost(distance: float, layer: InflationLayer) -> float:
    """The rule of mesh_navigation for one vertex."""
    settings_ = layer.parameters
    if distance == 0.0:
        return settings_.lethal_value
    if distance > settings_.inflation_radius:
        return 0.0
    beyond = max(distance - settings_.inscribed_radius, 0.0)
    return settings_.inscribed_value * np.exp(-settings_.cost_scaling_factor * beyond)


def test_costs_are_flat_up_to_the_inscribed_radius_then_fade_and_end_at_the_inflation_radius():
    mesh = bumpy(0)
    lethal = np.arange(len(mesh.vertices)) == 20
    _, layer = chain(
        mesh, lethal, inscribed_radius=0.3, inflation_radius=0.7, inscribed_value=0.9, cost_scaling_factor=2.0
    )

    expected = [naive_cost(distance, layer) for distance in layer.distances]

    np.testing.assert_allclose(layer.costs, expected, rtol=1e-5)
    assert {0.0, 1.0} < set(layer.costs.tolist()) and (layer.costs == np.float32(0.9)).sum() > 3


@pytest.mark.parametrize("cost_scaling_factor", [0.0, 1e-9])
def test_costs_that_hardly_fade_forbid_nothing_beyond_the_inscribed_radius(cost_scaling_factor):
    mesh = bumpy(0)
    lethal = np.arange(len(mesh.vertices)) == 20
    radii = {"inscribed_radius": 0.3, "inflation_radius": 0.7}
    _, layer = chain(mesh, lethal, **radii, cost_scaling_factor=cost_scaling_factor)

    near, far = layer.distances <= np.float32(0.3), layer.distances > 0.7
    assert 3 < near.sum() < (~far).sum() and (layer.costs[near] == 1.0).all() and (layer.costs[far] == 0.0).all()
    beyond = layer.costs[~near & ~far]
    assert (beyond < 1.0).all()
    np.testing.assert_allclose(beyond, 1.0, rtol=1e-6)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.sampled_from([0.002, 0.03, 0.2]), st.booleans())
def test_repair_after_added_and_removed_obstacles_equals_a_new_start(seed, share, is_grid):
    rng = np.random.default_rng(seed)
    mesh = bumpy(seed) if is_grid else scattered(seed, 0.05)
    source, inflation = chain(mesh, rng.random(len(mesh.vertices)) < 2.0 * share, inflation_radius=0.5)
    for _ in range(4):
        before = inflation.costs.copy(), inflation.lethal.copy()
        lethal = source.lethal ^ (rng.random(len(mesh.vertices)) < share)

        changed = inflation.update_from_inputs(source.replace(lethal.astype(np.float32), lethal))

        _, fresh = chain(mesh, lethal, inflation_radius=0.5)
        np.testing.assert_array_equal(inflation.distances, fresh.distances)
        np.testing.assert_array_equal(inflation._made_from[:, 2], fresh._made_from[:, 2])
        np.testing.assert_array_equal(inflation.costs, fresh.costs)
        np.testing.assert_array_equal(inflation.lethal, lethal)
        differs = (inflation.costs != before[0]) | (inflation.lethal != before[1])
        assert set(np.flatnonzero(differs)) <= set(changed)


def test_inflation_does_not_jump_to_the_other_storey():
    flat = MeshMap.from_heights(np.zeros((9, 9)), 0.1, 0.1)
    vertices = np.vstack([flat.vertices, flat.vertices + np.array([0.0, 0.0, 0.2])])
    mesh = MeshMap.from_arrays(vertices, np.vstack([flat.faces, flat.faces + 81]))

    _, inflation = chain(mesh, (mesh.vertices[:, 2] > 0.1) & (mesh.vertices[:, 0] < 0.3), inflation_radius=1.0)

    assert (inflation.costs[mesh.vertices[:, 2] < 0.1] == 0.0).all()


def test_costs_follow_new_parameters_at_run_time():
    mesh = bumpy(1)
    lethal = np.arange(len(mesh.vertices)) == 40
    _, layer = chain(mesh, lethal, inflation_radius=0.3)

    layer.parameters = InflationParameters(inflation_radius=0.8, lethal_value=np.inf)
    layer.recompute()

    _, fresh = chain(mesh, lethal, inflation_radius=0.8, lethal_value=np.inf)
    np.testing.assert_array_equal(layer.costs, fresh.costs)
    assert np.isinf(layer.costs[40])


def test_an_inflation_narrower_than_the_robot_is_refused():
    with pytest.raises(ValueError, match="at least inscribed_radius, 1 m"):
        InflationParameters(inflation_radius=0.4, inscribed_radius=1.0)


BORDER = {"name": "border", "type": "border"}
INFLATION = {"name": "inflation", "type": "inflation", "inputs": ["border"]}
TILT = {"name": "tilt", "type": "tilt"}


@pytest.mark.parametrize(
    ("layers", "own", "text"),
    [
        ([BORDER, INFLATION], 0.2, "inscribed_radius 0.2 m of layer 'inflation' is less than the robot's"),
        (
            [BORDER],
            None,
            "no inflation or tilt layer: planners treat the robot, whose inscribed radius is 0.34 m, as a point",
        ),
        ([BORDER, INFLATION], 0.34, ""),
        ([BORDER, TILT, INFLATION], 0.2, ""),
    ],
)
def test_a_robot_wider_than_what_the_layers_keep_off_it_is_reported_unless_a_tilt_layer_looks_at_all_of_it(
    layers, own, text
):
    vertices, faces = heightfield_mesh(np.zeros((11, 11)), 0.15, 0.15)
    parameters = MeshMapParameters(inscribed_radius=0.34, layers=layers)
    blocks = {} if own is None else {"inflation": {"inscribed_radius": own, "inflation_radius": 0.8}}
    mesh_map = build_mesh_map(parameters, blocks, vertices=vertices, faces=faces)
    reported = [str(found) for found in mesh_map.report.findings if found.name == "narrow"]
    assert len(reported) == bool(text)
    assert all(text in one for one in reported)


@pytest.mark.parametrize(
    ("block", "reported"), [({}, 0), ({"inscribed_value": 0.99}, 1), ({"inscribed_value": 1.5}, 0)]
)
def test_a_cost_that_lets_planners_pass_where_the_robot_touches_is_reported(block, reported):
    vertices, faces = heightfield_mesh(np.zeros((11, 11)), 0.15, 0.15)
    parameters = MeshMapParameters(inscribed_radius=0.25, layers=[BORDER, INFLATION])
    findings = build_mesh_map(parameters, {"inflation": block}, vertices=vertices, faces=faces).report.findings
    texts = [str(found) for found in findings if "inscribed_value 0.99 of layer 'inflation' is below 1" in str(found)]
    assert len(texts) == reported


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_what_costs_enough_is_inflated_like_what_is_lethal_and_does_not_become_so(seed):
    mesh, rng = bumpy(seed), np.random.default_rng(seed)
    count = mesh.topology.vertex_count
    kind = rng.choice(3, count, p=[0.85, 0.1, 0.05])  # free, costly, lethal
    source, inflation = chain(mesh, kind == 2, source_cost=1.0)
    for changed in (rng.choice(count, 30, replace=False) for _ in range(4)):
        moved = source.replace(np.select([kind == 0, kind == 1], [0.3, 1.0], 5.0).astype(np.float32), kind == 2)
        before = inflation.costs.copy(), inflation.lethal.copy()
        reported = inflation.update_from_inputs(moved)
        _, all_lethal = chain(mesh, kind > 0)
        np.testing.assert_array_equal(inflation.costs, all_lethal.costs)
        np.testing.assert_array_equal(inflation.lethal, kind == 2)
        differs = (inflation.costs != before[0]) | (inflation.lethal != before[1])
        assert set(np.flatnonzero(differs)) <= set(reported.tolist())
        kind = kind.copy()
        kind[changed] = rng.choice(3, len(changed))
    anew, lethal = inflation.compute()
    np.testing.assert_array_equal(anew, all_lethal.costs)
    np.testing.assert_array_equal(lethal, source.lethal)


def test_sources_follow_the_flags_and_costs_of_changed_vertices_only():
    rng = np.random.default_rng(5)
    lethal, known_lethal, is_source = rng.random((3, 400)) < 0.5
    costs = rng.choice(np.array([0.0, 0.7, np.inf, np.nan], dtype=np.float32), 400)
    changed = np.sort(rng.choice(400, 250, replace=False)).astype(np.int32)
    expected_lethal, expected_source = known_lethal.copy(), is_source.copy()
    expected_lethal[changed] = lethal[changed]
    expected_source[changed] = (lethal | (costs >= np.float32(0.7)))[changed]
    only_flag = (expected_lethal != known_lethal) & (expected_source == is_source)
    flipped = update_sources(lethal, costs, np.float32(0.7), changed, known_lethal, is_source)
    assert np.array_equal(flipped, np.flatnonzero(only_flag))
    assert flipped.dtype == np.int32
    assert np.array_equal(known_lethal, expected_lethal)
    assert np.array_equal(is_source, expected_source)


@pytest.mark.parametrize(
    ("factor", "robot", "inscribed"), [(0.5, 0.2, 0.2), (0.9, 0.2, 0.27), (0.5, 0.4, 0.3), (0.5, 0.0, 0.3)]
)
def test_relaxed_its_inner_circle_shrinks_to_that_of_the_robot_at_most(factor, robot, inscribed):
    usual = InflationParameters(inscribed_radius=0.3, inflation_radius=0.8, cost_scaling_factor=3.0)
    relaxed = usual.relaxed(factor, robot)
    assert relaxed.inscribed_radius == pytest.approx(inscribed)
    assert relaxed.inflation_radius == pytest.approx(max(0.8 * factor, inscribed))
    assert relaxed.cost_scaling_factor == pytest.approx(3.0 / factor)
