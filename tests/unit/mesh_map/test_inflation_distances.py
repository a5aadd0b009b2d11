"""Distances of an inflation: a heap-based twin, straight lines on flat and folded ground, shortest ways over faces."""

import heapq
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inflated_ground import bumpy, chain, scattered
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from mbf_mesh_nav.kernels.layers.front_offers import DIRECT, OBTUSE, STRAIGHT, circular_arrival, straight_arrival
from mbf_mesh_nav.map.mesh_map import MeshMap


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
                offers = [(np.float32(distance + length), beyond)]
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
        return np.float32(arrival - (1.0 - DIRECT) * (arrival - max(d1, d2))), front1
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


def subdivided_distances(mesh: MeshMap, lethal: np.ndarray) -> np.ndarray:
    """Shortest ways over the surface by brute force: straight within each face, between nine points on every edge."""
    share = np.linspace(0.0, 1.0, 11)[1:-1, None]
    between = [start * (1.0 - share) + end * share for start, end in mesh.vertices[mesh.edges]]
    points, count = np.vstack([mesh.vertices, *between]), len(mesh.vertices)
    number = {tuple(edge): count + 9 * i + np.arange(9) for i, edge in enumerate(mesh.edges.tolist())}
    pairs = set()
    for a, b, c in np.sort(mesh.faces, axis=1).tolist():
        around = [a, b, c, *number[a, b], *number[b, c], *number[a, c]]
        pairs.update(combinations(sorted(map(int, around)), 2))
    start, end = np.array(sorted(pairs)).T
    lengths = np.linalg.norm(points[start] - points[end], axis=1)
    graph = coo_matrix((lengths, (start, end)), shape=2 * (len(points),)).tocsr()
    on_edges = [number[tuple(edge)] for edge in mesh.edges[lethal[mesh.edges].all(axis=1)].tolist()]
    sources = np.concatenate([np.flatnonzero(lethal), *on_edges])
    return dijkstra(graph, directed=False, indices=sources, min_only=True)[:count]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.2, 1.5), st.sampled_from([0.01, 0.05, 0.3]))
def test_distances_equal_those_of_a_heap(seed, radius, share):
    mesh = bumpy(seed)
    lethal = np.random.default_rng(seed).random(len(mesh.vertices)) < share

    _, inflation = chain(mesh, lethal, inflation_radius=radius)

    expected, _ = naive_distances(mesh, lethal, radius)
    np.testing.assert_allclose(inflation.distances, expected, rtol=1e-5)


@pytest.mark.parametrize("is_lethal", [lambda x, y: np.hypot(x, y) < 0.01, lambda x, y: (x < 0.01) & (y < 0.01)])
@pytest.mark.parametrize("spacing", [0.1, 0.17])
def test_distance_past_a_vertex_and_past_a_convex_corner_is_exact_in_every_direction(is_lethal, spacing):
    mesh = MeshMap.from_heights(np.zeros((41, 41)), 0.1, spacing)
    lethal = is_lethal(mesh.vertices[:, 0] - 2.0, mesh.vertices[:, 1] - 20 * spacing)

    _, inflation = chain(mesh, lethal, inflation_radius=1.0)

    true = true_distances(mesh, lethal)
    near = true < 0.999
    assert near.sum() > 150
    np.testing.assert_allclose(inflation.distances[near], true[near], atol=2e-5)


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


@pytest.mark.parametrize("height", [0.03, 0.08])
@pytest.mark.parametrize("shape", LETHAL_SHAPES)
def test_distance_over_rough_ground_is_that_of_the_shortest_way_over_its_faces_to_a_few_percent(shape, height):
    rng = np.random.default_rng(0)
    mesh = MeshMap.from_heights(rng.random((22, 22)) * height, 0.1, 0.1)
    lethal = LETHAL_SHAPES[shape](*(mesh.vertices[:, :2] - 1.05).T, rng)

    _, inflation = chain(mesh, lethal, inflation_radius=1.2)

    true = subdivided_distances(mesh, lethal)
    near = (true > 0.0) & (true < 1.0)
    excess = inflation.distances[near] - true[near]
    assert excess.min() > -0.3 * 0.1  # of an edge
    assert np.abs(np.mean(excess / true[near])) < 0.025
    assert np.quantile(excess / true[near], 0.95) < 0.09


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
    np.testing.assert_allclose(inflation.distances[near], true[near], atol=2e-5)


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


def test_distance_of_a_straight_wall_is_exact():
    mesh = MeshMap.from_heights(np.zeros((9, 40)), 0.1, 0.1)

    _, inflation = chain(mesh, mesh.vertices[:, 0] < 0.05, inflation_radius=2.05)

    np.testing.assert_allclose(
        inflation.distances[mesh.vertices[:, 0] <= 2.0], mesh.vertices[mesh.vertices[:, 0] <= 2.0, 0], atol=1e-5
    )
