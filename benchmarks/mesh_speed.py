"""Speed of planning on meshes, each figure as a ratio to a named peer measured in the same run.

    python benchmarks/mesh_speed.py [--quick] [--json]

Peers: ``scipy.sparse.csgraph.dijkstra`` with predecessors, potpourri3d's fast marching (if installed). A ratio
below 1 is faster than the peer. The C++ original is not run here; its ratios to SciPy were measured once on the same
terrains and the same kind of machine (unmodified sources, -O3), so its line is SciPy's time of this run times them.
``--quick`` stays below a minute and leaves out the largest terrain; ``--json`` prints the figures as last line.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components, dijkstra
from terrain_meshes import Terrain, add_layer, fractal_terrain, shuffled

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.surface_point import surface_point_at_vertex
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.repairing import RepairingPlanner
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.search.leg_search import LegQuery, propagate_from
from mbf_mesh_nav.search.wave_search import WaveSearch

SIDES = {"10k": 100, "100k": 316, "1M": 1000}
CPP_RATIOS = {"dijkstra": 5.3, "cvp": 18.0, "inflation": 7.5}
"""Time of the C++ original over SciPy's full Dijkstra, median over 10 k to 1 M vertices."""
LIMITS = {
    "dijkstra": 0.3,
    "astar": 0.25,
    "cvp": 1.3,
    "inflation": 0.8,
    "cvp_potpourri3d": 0.2,
    "shuffled": 1.2,
    "repair": 0.1,
    "repair_midway": 0.12,
}
NEVER = np.zeros(1, dtype=np.uint8)


class StillClock:
    """A clock for plugins that only stamp their results."""

    def now(self) -> float:
        """Return the same time always."""
        return 0.0


def plugin(plugin_class: Any, mesh_map: MeshMap) -> Any:
    context = MeshContext("bench", plugin_class.Parameters(), StillClock(), np.random.default_rng(0), None, mesh_map)
    return plugin_class(context)


def seconds_of(task: Callable[[], object]) -> float:
    """Time [s] this thread computed for a task; the machine is shared, waiting for others does not count."""
    begin = time.thread_time()
    task()
    return time.thread_time() - begin


def best_of(task: Callable[[], object], rounds: int) -> float:
    """Shortest time [s] of a task, that of the least disturbed round."""
    return min(seconds_of(task) for _ in range(rounds))


def ratio_to(peer: Callable[[], object], task: Callable[[], object], rounds: int) -> float:
    """Median over the rounds of our time by the peer's, run one after the other in each round."""
    task()  # compiled, or read from the cache
    return float(np.median([seconds_of(task) / seconds_of(peer) for _ in range(rounds)]))


def corner_query(mesh_map: MeshMap) -> LegQuery:
    """From the far corner to the near one: the whole field."""
    sums = mesh_map.vertices[:, 0] + mesh_map.vertices[:, 1]
    start, goal = (
        surface_point_at_vertex(mesh_map, int(sums.argmax())),
        surface_point_at_vertex(mesh_map, int(sums.argmin())),
    )
    snapshot = mesh_map.snapshot()
    return LegQuery(start, goal, snapshot, snapshot.lethal, NEVER)


def scipy_graph(terrain: Terrain) -> scipy.sparse.csr_matrix:
    """The peer's graph, in the order of the input, weights as ours."""
    faces = terrain.faces
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    a, b = np.unique(pairs, axis=0).T
    weights = np.linalg.norm(terrain.vertices[a] - terrain.vertices[b], axis=1)
    weights *= 1.0 + (terrain.costs[a] + terrain.costs[b]) / 2.0
    count = len(terrain.vertices)
    both = (np.concatenate([a, b]), np.concatenate([b, a]))
    return scipy.sparse.csr_matrix((np.tile(weights, 2), both), shape=(count, count))


def measure_fields(terrain: Terrain, mesh_map: MeshMap, peer: Callable[[], object], rounds: int) -> dict[str, float]:
    """Full Dijkstra, full continuous wave, inflation: ratios to SciPy's full Dijkstra."""
    query = corner_query(mesh_map)
    search = WaveSearch(mesh_map)
    inflation = inflation_layer(terrain, mesh_map)

    def full_dijkstra() -> object:
        return propagate_from(mesh_map, query.snapshot, query.blocked, query.goal, NEVER)

    return {
        "dijkstra": ratio_to(peer, full_dijkstra, rounds),
        "cvp": ratio_to(peer, lambda: search.propagate(query, overshoot=1e9), rounds),
        "inflation": ratio_to(peer, inflation.compute, rounds),
    }


def inflation_layer(terrain: Terrain, mesh_map: MeshMap) -> InflationLayer:
    """0.55 m around 4 % lethal blobs."""
    lethal = np.where(terrain.lethal, np.inf, 0.0).astype(np.float32)
    source = add_layer(mesh_map, lethal, terrain.lethal)
    add_layer(mesh_map, terrain.costs)  # planners go on without the blobs
    parameters = InflationLayer.Parameters(inscribed_radius=0.22, inflation_radius=0.55)
    return InflationLayer(LayerContext("inflation", mesh_map.topology, mesh_map.locator, parameters, (source,)))


def measure_astar(mesh_map: MeshMap, peer: Callable[[], object], pairs: int) -> float:
    """Median over random pairs of the time of A*, path included, by that of SciPy's full search."""
    planner = plugin(AStarPlanner, mesh_map)
    snapshot = mesh_map.snapshot()
    rng = np.random.default_rng(3)
    ratios = []
    for _ in range(pairs + 1):
        start, goal = (
            surface_point_at_vertex(mesh_map, vertex) for vertex in rng.choice(len(mesh_map.vertices), 2, replace=False)
        )
        query = LegQuery(start, goal, snapshot, snapshot.lethal, NEVER)
        ratios.append(seconds_of(lambda query=query: planner.find_leg(query)) / seconds_of(peer))
    return float(np.median(ratios[1:]))  # the first one compiles


def measure_potpourri3d(terrain: Terrain, mesh_map: MeshMap, rounds: int) -> float | None:
    """Our full wave over potpourri3d's fast marching, both without costs."""
    try:
        import potpourri3d
    except ImportError:
        return None
    solver = potpourri3d.MeshFastMarchingDistanceSolver(terrain.vertices, terrain.faces)
    bare = MeshMap(mesh_map.topology)
    query, search = corner_query(bare), WaveSearch(bare)
    peer = lambda: solver.compute_distance([[(0, [])]])  # noqa: E731 - one more task of the table
    return ratio_to(peer, lambda: search.propagate(query, overshoot=1e9), rounds)


def inflated_map(terrain: Terrain, mesh_map: MeshMap) -> tuple[MeshMap, MeshLayer, InflationLayer]:
    """A map of its own on the same surface: lethal blobs and their inflation; and the two layers."""
    own = MeshMap(mesh_map.topology)
    source = add_layer(own, np.where(terrain.lethal, np.inf, 0.0).astype(np.float32), terrain.lethal)
    settings = InflationLayer.Parameters(inscribed_radius=0.22, inflation_radius=0.55, inscribed_value=0.9)
    inflation = InflationLayer(LayerContext("inflation", own.topology, own.locator, settings, (source,)))
    inflation.recompute()
    own.set_layers(LayerGraph([source, inflation]), "inflation", 1.0)
    return own, source, inflation


def measure_repair(terrain: Terrain, mesh_map: MeshMap) -> dict[str, float]:
    """Re-inflating and replanning after an obstacle of 1,000 vertices, by repair over from scratch.

    ``repair``: it appears 5 m ahead of the robot on its way, where sensors see obstacles. ``repair_midway``: half way
    to the goal, so that a large part of the wave lies in its shadow. Repaired is one map that lives on from round to
    round, as in a server; the work from scratch is done on another one.
    """
    kept_map, source, _ = inflated_map(terrain, mesh_map)
    fresh_map, fresh_source, fresh_inflation = inflated_map(terrain, mesh_map)
    free = largest_free_region(kept_map)
    sums = mesh_map.vertices[free, :2].sum(axis=1)
    ends = mesh_map.vertices[free[[sums.argmax(), sums.argmin()]]]
    request = PlanRequest(Pose(tuple(ends[0])), Pose(tuple(ends[1])))
    way = plugin(AStarPlanner, kept_map).make_plan(request).path
    travelled = np.cumsum(np.linalg.norm(np.diff(way.positions, axis=0), axis=1))
    planner = plugin(RepairingPlanner, kept_map)
    figures = {}
    for name, distance in {"repair": 5.0, "repair_midway": way.length / 2.0}.items():
        spot = way.positions[np.searchsorted(travelled, distance)]
        disc = np.argsort(np.linalg.norm(mesh_map.vertices[:, :2] - spot[:2], axis=1))[:1000]
        planner.make_plan(request)
        kept, fresh = [], []
        for round_number in range(12):
            lethal = source.lethal.copy()
            lethal[disc] = round_number % 2 == 0
            costs = np.where(lethal, np.inf, 0.0).astype(np.float32)
            changed = source.replace(costs, lethal)
            change = lambda layer, changed=changed: changed if layer is source else NOTHING_CHANGED  # noqa: E731
            kept.append(seconds_of(lambda change=change: kept_map.apply(change)))
            kept[-1] += seconds_of(lambda: planner.make_plan(request))
            fresh_source.replace(costs, lethal)
            scratch = plugin(RepairingPlanner, fresh_map)
            fresh.append(seconds_of(fresh_inflation.recompute))
            fresh[-1] += seconds_of(lambda: fresh_map.set_edge_cost_factor(1.0))
            fresh[-1] += seconds_of(lambda scratch=scratch: scratch.make_plan(request))
        figures[name] = float(np.median(kept[2:]) / np.median(fresh[2:]))
    return figures


def largest_free_region(mesh_map: MeshMap) -> np.ndarray:
    """Vertices (k,) of the largest connected region that is free for a planner."""
    free = ~mesh_map.snapshot().blocked(1.0)
    a, b = mesh_map.edges[free[mesh_map.edges].all(axis=1)].T
    graph = scipy.sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(len(free), len(free)))
    labels = connected_components(graph, directed=False)[1]
    return np.flatnonzero(labels == np.bincount(labels[free]).argmax())


def measure_pose_queries(mesh_map: MeshMap) -> dict[str, float]:
    """Microseconds for one pose on the mesh alone and in a batch of 20,000, 3 cm off the surface."""
    rng = np.random.default_rng(4)
    points = mesh_map.vertices[rng.integers(len(mesh_map.vertices), size=20000)] + rng.normal(0, 0.03, (20000, 3))
    mesh_map.locate_one(points[0], 0.3)
    batch = best_of(lambda: mesh_map.locate(points, 0.3), 2)
    single = best_of(lambda: [mesh_map.locate_one(point, 0.3) for point in points[:500]], 3)
    return {"pose_single_us": single / 500 * 1e6, "pose_batch_us": batch / 20000 * 1e6}


def measure(size: str, quick: bool) -> dict[str, float]:
    """All figures of one terrain."""
    terrain = fractal_terrain(SIDES[size])
    rounds = 3 if size == "1M" else 7
    graph = scipy_graph(terrain)

    def scipy_dijkstra() -> object:
        return dijkstra(graph, indices=0, return_predecessors=True)

    scipy_seconds = best_of(scipy_dijkstra, rounds)
    begin = time.perf_counter()
    mesh_map = MeshMap.from_arrays(terrain.vertices, terrain.faces)
    figures = {"load_s": time.perf_counter() - begin, "scipy_s": scipy_seconds}
    add_layer(mesh_map, terrain.costs)
    figures |= measure_fields(terrain, mesh_map, scipy_dijkstra, rounds)
    figures["astar"] = measure_astar(mesh_map, scipy_dijkstra, 20 if quick or size == "1M" else 50)
    figures |= measure_pose_queries(mesh_map)
    figures |= measure_repair(terrain, mesh_map)
    potpourri3d_ratio = measure_potpourri3d(terrain, mesh_map, 3 if size == "1M" else 21)
    if potpourri3d_ratio is not None:
        figures["cvp_potpourri3d"] = potpourri3d_ratio
    mixed = shuffled(terrain)
    mixed_map = MeshMap.from_arrays(mixed.vertices, mixed.faces)
    add_layer(mixed_map, mixed.costs)
    figures["shuffled"] = measure_fields(mixed, mixed_map, scipy_dijkstra, rounds)["dijkstra"] / figures["dijkstra"]
    return figures


def report(size: str, figures: dict[str, float]) -> None:
    print(f"\n{size} vertices: SciPy's full Dijkstra {figures['scipy_s'] * 1e3:.1f} ms, load {figures['load_s']:.2f} s")
    for name, limit in LIMITS.items():
        if name in figures:
            print(f"  {name:16} {figures[name]:8.3f}  limit {limit:g}  {'ok' if figures[name] <= limit else 'MISSED'}")
    for name, ratio in CPP_RATIOS.items():
        print(f"  C++ original's {name}: {ratio:g} x SciPy, that is {ratio / figures[name]:.1f} x ours")
    print(f"  pose on the mesh {figures['pose_single_us']:.1f} us, in a batch {figures['pose_batch_us']:.2f} us")


def growth_exponent(results: dict[str, dict[str, float]], name: str) -> float:
    """Exponent of the growth of our time with the vertices, from the smallest to the largest terrain."""
    first, *_, last = results
    seconds = [results[size][name] * results[size]["scipy_s"] for size in (first, last)]
    return float(np.log(seconds[1] / seconds[0]) / np.log((SIDES[last] / SIDES[first]) ** 2))


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="below a minute, without the 1 M terrain")
    arguments.add_argument("--json", action="store_true", help="print the figures as one JSON line at the end")
    options = arguments.parse_args()
    results: dict[str, dict[str, float]] = {}
    for size in list(SIDES)[:2] if options.quick else list(SIDES):
        results[size] = measure(size, options.quick)
        report(size, results[size])
    exponents = {f"{name}_exponent": growth_exponent(results, name) for name in ("dijkstra", "cvp", "inflation")}
    print("\ngrowth with the vertices: " + ", ".join(f"{name} {value:.2f}" for name, value in exponents.items()))
    if options.json:
        print(json.dumps({"sizes": results, "limits": LIMITS, "cpp_over_scipy": CPP_RATIOS, **exponents}))


if __name__ == "__main__":
    with interruptible():
        main()
