"""Geodesic inflation: the reference's assertions, a heap-based twin, and repairs that equal a new start."""

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from mbf_mesh_nav.kernels.layers.front_offers import BENT, OBTUSE, STRAIGHT, circular_arrival, straight_arrival
from mbf_mesh_nav.kernels.layers.inflation import update_sources
from mbf_mesh_nav.layers.inflation import InflationLayer, InflationParameters
from mbf_mesh_nav.layers.keepout import KeepoutLayer, KeepoutParameters
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh


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


def naive_distances(mesh: MeshMap, lethal: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances and centres by a heap: what is settled offers to the corners of its faces, in order of the distance."""
    settled: dict[int, tuple[float, int]] = {}
    heap = [(0.0, int(v), int(v)) for v in np.flatnonzero(lethal)]
    while heap:
        distance, centre, v = heapq.heappop(heap)
        if v in settled:
            continue
        settled[v] = distance, centre
        for face in mesh.faces[(mesh.faces == v).any(axis=1)]:
            for k in range(3):
                corner, v1, v2 = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
                if corner in settled:
                    continue
                length = np.linalg.norm(mesh.vertices[corner] - mesh.vertices[v])
                beyond = centre if centre >= STRAIGHT else v
                offers = [
                    (np.float32(distance + length * (1.0 if distance == 0.0 or beyond >= STRAIGHT else BENT)), beyond)
                ]
                if v1 in settled and v2 in settled:
                    offers.append(naive_offer(mesh.vertices, corner, (v1, *settled[v1]), (v2, *settled[v2]), settled))
                for offer, front in offers:
                    if distance < offer <= np.float32(radius):
                        heapq.heappush(heap, (float(offer), int(front), int(corner)))
    found = np.full((2, len(lethal)), [[np.inf], [-1]])
    for v, of in settled.items():
        found[:, v] = of
    return found[0], found[1]


def naive_offer(vertices, corner, first, second, settled) -> tuple[np.float32, int]:
    """What two settled corners of a face offer the third one."""
    (v1, d1, front1), (v2, d2, front2) = first, second
    e1, e2 = vertices[v1] - vertices[corner], vertices[v2] - vertices[corner]
    sides = e1 @ e1, e2 @ e2, e1 @ e2
    if front1 == front2 < STRAIGHT:
        to_centre = settled[front1][0]
        arrival = to_centre + circular_arrival.py_func(d1 - to_centre, d2 - to_centre, *sides)
        return np.float32(arrival), front1
    arrival, is_nearer_first = straight_arrival.py_func(d1, d2, *sides)
    straight = (front1 if is_nearer_first else front2) | STRAIGHT
    cosine = sides[2] / np.sqrt(sides[0] * sides[1])
    both_straight = min(front1, front2) >= STRAIGHT
    if d1 + d2 == 0.0 or (both_straight and sides[2] >= OBTUSE * (sides[0] + sides[1])):
        return np.float32(arrival), straight
    if max(front1, front2) >= STRAIGHT and cosine < -np.sqrt(0.5):
        return np.float32(np.inf), straight
    least = []
    for front in (front1, front2):
        centre = front & ~int(STRAIGHT)
        squared = np.sum((vertices[centre] - vertices[corner]) ** 2)
        squared -= np.sum((e1 - e2) ** 2) if front >= STRAIGHT else 0.0
        least.append((settled[centre][0] + np.sqrt(max(squared, 0.0)), front))
    return (np.float32(min(least)[0]), min(least)[1]) if min(least)[0] > arrival else (np.float32(arrival), straight)


def scattered(seed: int, jitter: float = 0.03) -> MeshMap:
    """Flat ground of 4 m x 4 m, its triangles of all shapes."""
    places = np.stack(np.meshgrid(*2 * [np.arange(41) * 0.1]), axis=-1).reshape(-1, 2)
    places += np.random.default_rng(seed).uniform(-jitter, jitter, places.shape)
    flat = np.column_stack([places, np.zeros(len(places))])
    return MeshMap.from_arrays(flat, Delaunay(places).simplices.astype(np.int32))


def true_distances(mesh: MeshMap, lethal: np.ndarray) -> np.ndarray:
    """Straight distances on flat ground to the lethal vertices and the edges between them."""
    places = mesh.vertices[:, :2]
    both = mesh.edges[lethal[mesh.edges].all(axis=1)]
    ends = [*zip(places[lethal], places[lethal], strict=True), *zip(*places[both.T], strict=True)]
    nearest = np.full(len(places), np.inf)
    for start, end in ends:
        along = end - start
        share = np.clip((places - start) @ along / max(along @ along, 1e-9), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(places - start - share[:, None] * along, axis=1))
    return nearest


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


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.2, 1.5), st.sampled_from([0.01, 0.05, 0.3]))
def test_distances_equal_those_of_a_heap(seed, radius, share):
    mesh = bumpy(seed)
    lethal = np.random.default_rng(seed).random(len(mesh.vertices)) < share

    _, inflation = chain(mesh, lethal, inflation_radius=radius)

    expected, _ = naive_distances(mesh, lethal, radius)
    np.testing.assert_allclose(inflation.distances, expected, rtol=1e-5)


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


@pytest.mark.parametrize("is_lethal", [lambda x, y: np.hypot(x, y) < 0.01, lambda x, y: (x < 0.01) & (y < 0.01)])
@pytest.mark.parametrize("spacing", [0.1, 0.17])
def test_distance_past_a_vertex_and_past_a_convex_corner_is_exact_in_every_direction(is_lethal, spacing):
    mesh = MeshMap.from_heights(np.zeros((41, 41)), 0.1, spacing)
    lethal = is_lethal(mesh.vertices[:, 0] - 2.0, mesh.vertices[:, 1] - 20 * spacing)

    _, inflation = chain(mesh, lethal, inflation_radius=1.0)

    true = true_distances(mesh, lethal)
    near = true < 0.999
    assert near.sum() > 150
    np.testing.assert_allclose(inflation.distances[near], true[near], atol=1e-5)


LETHAL_SHAPES = {
    "vertex": lambda x, y, rng: np.hypot(x, y) <= np.hypot(x, y).min(),
    "corner": lambda x, y, rng: (x < 0.0) & (y < 0.0),
    "wall": lambda x, y, rng: x + 0.4 * y < 0.0,
    "scattered": lambda x, y, rng: rng.random(len(x)) < 0.03,
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shape", LETHAL_SHAPES)
def test_distance_over_triangles_of_all_shapes_is_true_to_a_few_percent_and_hardly_ever_shorter(shape, seed):
    mesh = scattered(seed)
    lethal = LETHAL_SHAPES[shape](*(mesh.vertices[:, :2] - 2.0).T, np.random.default_rng(seed))

    _, inflation = chain(mesh, lethal, inflation_radius=1.3)

    true = true_distances(mesh, lethal)
    near = (true > 0.0) & (true < 1.0)
    excess = inflation.distances[near] - true[near]
    assert excess.min() > -0.25 * 0.1  # of an edge
    assert np.mean(excess / true[near]) < 0.025
    assert np.quantile(excess / true[near], 0.95) < 0.065


@pytest.mark.parametrize("fold", [30.0, 90.0, 150.0])
def test_distance_across_folds_is_that_on_the_ground_laid_flat(fold):
    flat = MeshMap.from_heights(np.zeros((31, 31)), 0.1, 0.1)
    # A zigzag of strips of 0.5 m, each tilted by half the fold's angle.
    strip, along = np.divmod(flat.vertices[:, 0] + 1e-9, 0.5)
    up = np.where(strip % 2 == 0, along, 0.5 - along) * np.sin(np.radians(fold / 2.0))
    folded = np.column_stack([flat.vertices[:, 0] * np.cos(np.radians(fold / 2.0)), flat.vertices[:, 1], up])
    zigzag = MeshMap.from_arrays(folded, flat.faces)
    lethal = np.hypot(*(flat.vertices[:, :2] - 1.5).T) < 0.01

    _, inflation = chain(zigzag, lethal[zigzag.internal_to_input], inflation_radius=1.0)

    true = np.hypot(*(flat.vertices[zigzag.internal_to_input, :2] - 1.5).T)
    near = true < 0.999
    np.testing.assert_allclose(inflation.distances[near], true[near], atol=1e-5)


def test_distance_leads_round_the_end_of_a_slit():
    mesh = MeshMap.from_heights(np.zeros((31, 31)), 0.1, 0.1)
    x, y = mesh.vertices[mesh.faces].mean(axis=1)[:, :2].T
    cut = MeshMap.from_arrays(mesh.vertices, mesh.faces[~((x > 1.4) & (x < 1.5) & (y < 2.0))])
    start, end = np.array([1.2, 1.5]), np.array([[1.4, 2.0], [1.5, 2.0]])
    lethal = np.linalg.norm(cut.vertices[:, :2] - start, axis=1) < 0.01

    _, inflation = chain(cut, lethal, inflation_radius=2.0)

    behind = (cut.vertices[:, 0] > 1.55) & (cut.vertices[:, 1] < 1.75)
    round_the_end = np.linalg.norm(end[0] - start) + 0.1 + np.linalg.norm(cut.vertices[behind, :2] - end[1], axis=1)
    found = inflation.distances[behind]
    assert np.isfinite(found).sum() > 30
    known = np.isfinite(found)
    np.testing.assert_allclose(found[known], round_the_end[known], rtol=0.03)
    assert (found >= round_the_end - 0.025).all()


def test_distance_of_a_straight_wall_is_exact_but_for_rounding():
    mesh = MeshMap.from_heights(np.zeros((9, 40)), 0.1, 0.1)

    _, inflation = chain(mesh, mesh.vertices[:, 0] < 0.05, inflation_radius=2.05)

    np.testing.assert_allclose(
        inflation.distances[mesh.vertices[:, 0] <= 2.0], mesh.vertices[mesh.vertices[:, 0] <= 2.0, 0], rtol=2e-5
    )


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
