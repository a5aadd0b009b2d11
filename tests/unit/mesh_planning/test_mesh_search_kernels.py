"""The wave kernels on vertex graphs against ten-line twins on random weighted grids."""

import heapq

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.kernels.compiled import kernel
from mbf_mesh_nav.kernels.lowest_bit import _by_halves, lowest_bit
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, frontier, propagate_distances
from mbf_mesh_nav.kernels.search.indexed_heap import push_or_decrease, remove_top, top_item, top_key
from mbf_mesh_nav.kernels.search.repair_wave import invalidate_subtrees
from mbf_mesh_nav.kernels.wave.bucket_queue import (
    EMPTY,
    RING,
    entry_of,
    item_of,
    key_of,
    next_bucket,
    put,
    remove_least,
)

NO_INTS = np.zeros(0, np.int32)
NO_FLOATS = np.zeros(0, np.float32)
CALM = np.zeros(1, np.uint8)
CANCELLED = np.ones(1, np.uint8)


def random_grid_graph(seed, side=9):
    """A side x side grid with bumps and random extra costs: vertices, CSR arrays, blocked mask."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    vertices = np.column_stack([x.ravel(), y.ravel(), rng.uniform(0, 1, side * side)]).astype(float)
    ids = np.arange(side * side).reshape(side, side)
    rows = (ids[:, :-1].ravel(), ids[:, 1:].ravel())
    columns = (ids[:-1].ravel(), ids[1:].ravel())
    diagonals = (ids[:-1, 1:].ravel(), ids[1:, :-1].ravel())
    pairs = np.concatenate([np.column_stack(pair) for pair in (rows, columns, diagonals)])
    lengths = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
    weights = lengths * (1 + rng.uniform(0, 2, len(pairs)))
    sources = np.concatenate([pairs[:, 0], pairs[:, 1]])
    order = np.argsort(sources, kind="stable")
    neighbours = np.concatenate([pairs[:, 1], pairs[:, 0]])[order].astype(np.int32)
    offsets = np.concatenate([[0], np.cumsum(np.bincount(sources, minlength=side * side))]).astype(np.int32)
    blocked = rng.random(side * side) < 0.2
    blocked[[0, -1]] = False
    return vertices, offsets, neighbours, np.tile(weights, 2)[order].astype(np.float32), blocked


def heap_dijkstra(offsets, neighbours, weights, blocked, source):
    """The naive twin: float32 Dijkstra with heapq."""
    distances = np.full(len(blocked), np.inf, np.float32)
    distances[source] = 0
    queue = [(np.float32(0), source)]
    while queue:
        _, vertex = heapq.heappop(queue)
        for slot in range(offsets[vertex], offsets[vertex + 1]):
            candidate, other = distances[vertex] + weights[slot], neighbours[slot]
            if not blocked[other] and candidate < distances[other]:
                distances[other] = candidate
                heapq.heappush(queue, (candidate, other))
    return distances


def run_dijkstra(graph, source, step=0.7, targets=NO_INTS, flag=CALM):
    blocked = graph[-1]
    distances = np.full(len(blocked), np.inf, np.float32)
    distances[source] = 0
    predecessors = np.full(len(blocked), -1, np.int32)
    seeds = np.array([source], np.int32)
    offsets_of_targets = np.zeros(len(targets), np.float32)
    graph = SearchGraph(*graph[1:])
    finished = propagate_distances(graph, distances, predecessors, seeds, step, targets, offsets_of_targets, flag)
    return distances, predecessors, finished


@given(seed=st.integers(0, 10**6), step=st.floats(0.01, 50.0))
@settings(max_examples=40, deadline=None)
def test_near_far_distances_equal_dijkstra_bit_for_bit(seed, step):
    graph = random_grid_graph(seed)
    distances, predecessors, finished = run_dijkstra(graph, 0, step)
    np.testing.assert_array_equal(distances, heap_dijkstra(*graph[1:], 0))
    assert finished
    for vertex in np.flatnonzero(np.isfinite(distances))[1:]:
        assert distances[predecessors[vertex]] < distances[vertex]


def test_a_vertex_with_more_edges_than_a_number_has_bits_reaches_all_of_them():
    rim = np.arange(1, 151, dtype=np.int32)
    offsets = np.concatenate([[0], np.arange(150, 301)]).astype(np.int32)
    weights = np.random.default_rng(0).uniform(1.0, 9.0, 150).astype(np.float32)
    hub = offsets, np.concatenate([rim, np.zeros(150, np.int32)]), np.tile(weights, 2), np.arange(151) % 7 == 3
    distances, predecessors, _ = run_dijkstra((None, *hub), 0)
    np.testing.assert_array_equal(distances, heap_dijkstra(*hub, 0))
    assert (predecessors[1:] == np.where(hub[3], -1, 0)[1:]).all()


def test_of_two_edges_to_the_same_vertex_the_cheaper_one_counts_in_either_order():
    offsets, neighbours = np.array([0, 2, 4], np.int32), np.array([1, 1, 0, 0], np.int32)
    for weights in ([1.0, 2.0, 1.0, 2.0], [2.0, 1.0, 2.0, 1.0]):
        graph = None, offsets, neighbours, np.array(weights, np.float32), np.zeros(2, bool)
        assert run_dijkstra(graph, 0)[0].tolist() == [0.0, 1.0]


@kernel
def first_bit(number):
    return lowest_bit(number)


@given(place=st.integers(0, 63), above=st.integers(0, 2**64 - 1))
@settings(max_examples=40, deadline=None)
def test_the_lowest_bit_is_the_first_one_that_is_set(place, above):
    number = np.uint64(((above << place) | (1 << place)) & (2**64 - 1))
    assert first_bit(number) == _by_halves(number) == place


def slow_invalidation(graph, distances, predecessors, roots, root_distances, changed):
    """The twin: all descendants one after the other, then in the same order whatever lies beside them."""
    around = lambda vertex: graph.neighbours[graph.offsets[vertex] : graph.offsets[vertex + 1]].tolist()  # noqa: E731
    reset = list(dict.fromkeys(changed.tolist()))
    known = set(reset)
    for vertex in reset:
        behind = [other for other in around(vertex) if predecessors[other] == vertex and other not in known]
        known.update(behind)
        reset += behind
    distances[reset], predecessors[reset] = np.inf, -1
    kept = [k for k, root in enumerate(roots) if root in reset and not graph.blocked[root]]
    distances[roots[kept]] = root_distances[kept]
    beside = dict.fromkeys(other for vertex in reset for other in around(vertex) if other not in known)
    return [*roots[kept].tolist(), *(other for other in beside if distances[other] < np.inf)]


@given(seed=st.integers(0, 10**6), changed=st.lists(st.integers(0, 399), max_size=30), root_count=st.integers(1, 3))
@settings(max_examples=40, deadline=None)
def test_what_lies_behind_a_change_is_reset_and_what_lies_beside_goes_on_from_there(seed, changed, root_count):
    """Of several roots one may be reached from another, as the corners of a goal's face are."""
    assert same_invalidation(random_grid_graph(seed, side=20), root_count, np.array(changed, np.int32)) <= 400


def test_a_large_shadow_is_reset_and_what_lies_beside_is_listed_in_the_same_order():
    """More than the list of those beside holds before it is looked through."""
    assert same_invalidation(random_grid_graph(5, side=150), 1, np.arange(150, 300, dtype=np.int32)) > 15_000


def same_invalidation(graph_of_vertices, root_count, changed):
    """Whether the kernel does what its twin does; the number of vertices that both have reset."""
    _, *arrays = graph_of_vertices
    roots = np.flatnonzero(~arrays[-1])[:root_count].astype(np.int32)
    ends = roots, np.arange(root_count, dtype=np.float32), changed
    count = len(arrays[-1])
    distances, predecessors = np.full(count, np.inf, np.float32), np.full(count, -1, np.int32)
    distances[roots] = ends[1]
    assert propagate_distances(SearchGraph(*arrays), distances, predecessors, roots, 2.0, NO_INTS, NO_FLOATS, CALM)
    slow = distances.copy(), predecessors.copy()
    seeds = invalidate_subtrees(SearchGraph(*arrays), distances, predecessors, *ends)
    assert list(dict.fromkeys(seeds.tolist())) == slow_invalidation(SearchGraph(*arrays), *slow, *ends)
    np.testing.assert_array_equal(distances, slow[0])
    np.testing.assert_array_equal(predecessors, slow[1])
    return int(np.isinf(distances).sum())


@given(seed=st.integers(0, 10**6), step=st.floats(0.01, 20.0))
@settings(max_examples=40, deadline=None)
def test_astar_finds_the_same_cost_and_looks_only_where_a_better_path_could_be(seed, step):
    vertices, offsets, neighbours, weights, blocked = random_grid_graph(seed)
    expected = heap_dijkstra(offsets, neighbours, weights, blocked, 0)
    distances = np.full(len(blocked), np.inf, np.float32)
    distances[0] = 0
    predecessors = np.full(len(blocked), -1, np.int32)
    goal = len(blocked) - 1
    target, offset = np.array([goal], np.int32), np.full(1, 1e-6, np.float32)
    graph, seeds = SearchGraph(offsets, neighbours, weights, blocked), np.array([0], np.int32)
    assert propagate_distances(
        graph, distances, predecessors, seeds, step, target, offset, CALM, (vertices, vertices[goal])
    )
    assert distances[goal] == expected[goal]
    # Nothing is looked at that could not be better than the way found, but for the last step of the threshold.
    seen = np.flatnonzero(predecessors >= 0)
    bounds = np.linalg.norm(vertices[seen] - vertices[goal], axis=1)
    parents = distances[predecessors[seen]] + np.linalg.norm(vertices[predecessors[seen]] - vertices[goal], axis=1)
    assert (parents <= expected[goal] + step + 1e-3).all() or not np.isfinite(expected[goal])
    assert (distances[seen] + bounds >= np.linalg.norm(vertices[0] - vertices[goal]) - 1e-3).all()


def test_a_target_stops_the_wave_early_with_its_exact_distance():
    graph = random_grid_graph(3, side=40)
    full, _, _ = run_dijkstra(graph, 0)
    target = int(np.argsort(np.where(np.isfinite(full), full, np.inf))[60])
    distances, _, _ = run_dijkstra(graph, 0, targets=np.array([target], np.int32))
    assert distances[target] == full[target]
    assert np.isfinite(distances).sum() < np.isfinite(full).sum() / 2


@given(seed=st.integers(0, 10**6), target=st.integers(0, 80))
@settings(max_examples=40, deadline=None)
def test_a_search_that_was_stopped_goes_on_from_its_frontier_in_a_graph_with_more_edges(seed, target):
    vertices, offsets, neighbours, weights, blocked = random_grid_graph(seed)
    closed = np.where(np.random.default_rng(seed).random(len(weights)) < 0.3, np.float32(np.inf), weights)
    few_edges = vertices, offsets, neighbours, closed, blocked
    distances, predecessors, _ = run_dijkstra(few_edges, 0, targets=np.array([target], np.int32))
    graph = SearchGraph(offsets, neighbours, weights, blocked)
    seeds = frontier(graph, distances, 0, len(blocked))
    assert seeds.tolist() == naive_frontier(graph, distances)
    propagate_distances(graph, distances, predecessors, seeds, 0.7, NO_INTS, np.zeros(0, np.float32), CALM)
    np.testing.assert_array_equal(distances, heap_dijkstra(offsets, neighbours, weights, blocked, 0))


def naive_frontier(graph, distances):
    return [
        vertex
        for vertex in range(len(distances))
        if any(
            distances[vertex] + graph.weights[slot] < distances[graph.neighbours[slot]]
            and not graph.blocked[graph.neighbours[slot]]
            for slot in range(graph.offsets[vertex], graph.offsets[vertex + 1])
        )
    ]


def test_a_flag_set_before_the_call_cancels_both_searches():
    graph = random_grid_graph(1)
    assert not run_dijkstra(graph, 0, flag=CANCELLED)[2]
    vertices, offsets, neighbours, weights, blocked = graph
    assert not propagate_distances(
        SearchGraph(offsets, neighbours, weights, blocked), np.zeros(81, np.float32), np.full(81, -1, np.int32),
        np.array([0], np.int32), 1.0, np.array([80], np.int32), np.zeros(1, np.float32), CANCELLED,
        (vertices, vertices[80]),
    )  # fmt: skip


@given(st.lists(st.tuples(st.integers(0, 19), st.integers(0, 1000)), min_size=1, max_size=80))
@settings(max_examples=60, deadline=None)
def test_the_indexed_heap_returns_items_by_their_lowest_key(pushes):
    heap, positions = np.empty(20, np.uint64), np.full(20, -1, np.int32)
    size, lowest = 0, {}
    for item, key in pushes:
        if key < lowest.get(item, 10**9):  # the contract: a queued key is only ever lowered
            size = push_or_decrease(heap, positions, size, np.uint64(item), np.float32(key))
            lowest[item] = key
    popped = []
    while size:
        popped.append((float(top_key(heap)), int(top_item(heap))))
        size = remove_top(heap, positions, size)
    assert popped == sorted((key, item) for item, key in lowest.items())
    assert (positions == -1).all()


@kernel
def take_all(starts, start_keys, gains, inverse_width):
    """Queue the starts; each entry taken puts in the item after it, a gain later. Returns keys and items as taken."""
    room = len(starts) + len(gains)
    heads, links = np.full(RING, EMPTY, dtype=np.int32), np.empty(room, dtype=np.int32)
    entries, near = np.empty(room, dtype=np.uint64), np.empty(room, dtype=np.uint64)
    used, near_size, bucket = np.uint64(0), np.uint64(0), np.int64(0)
    for i in range(len(starts)):
        entry = entry_of(start_keys[i], np.uint64(starts[i]))
        used, near_size = put(heads, links, entries, near, used, near_size, bucket, inverse_width, entry)
    keys, items = np.empty(room, dtype=np.float32), np.empty(room, dtype=np.int64)
    taken = 0
    while True:
        if near_size == 0:
            bucket, near_size = next_bucket(heads, links, entries, near, bucket, inverse_width)
        if near_size == 0:
            return keys[:taken], items[:taken]
        keys[taken], items[taken] = key_of(near[0]), item_of(near[0])
        near_size = remove_least(near, near_size)
        if taken < len(gains):
            entry = entry_of(np.float32(keys[taken] + gains[taken]), np.uint64(items[taken] + 1))
            used, near_size = put(heads, links, entries, near, used, near_size, bucket, inverse_width, entry)
        taken += 1


@given(
    st.lists(st.floats(0, 50, width=32), min_size=1, max_size=20),
    st.lists(st.sampled_from([0.0, 0.125, 1.0, 2.5, 3000.0]), max_size=80),
    st.sampled_from([0.01, 1.0, 96.0, 1000.0]),
)
@settings(max_examples=100, deadline=None)
def test_the_bucket_queue_gives_entries_in_the_order_of_a_heap_whatever_the_width_of_its_buckets(
    starts, gains, inverse
):
    starts, gains = np.array(starts, np.float32), np.array(gains, np.float32)
    items = np.arange(len(starts))[::-1].copy()
    keys, taken = take_all(items, starts, gains, np.float32(inverse))
    heap = [(float(key), int(item)) for key, item in zip(starts, items, strict=True)]
    heapq.heapify(heap)
    expected = []
    while heap:
        expected.append(heapq.heappop(heap))
        if len(expected) <= len(gains):
            key, item = expected[-1]
            heapq.heappush(heap, (float(np.float32(key) + gains[len(expected) - 1]), item + 1))
    assert list(zip(keys.tolist(), taken.tolist(), strict=True)) == expected
