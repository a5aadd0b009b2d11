"""One terrain of ten million vertices: what planning on it takes, in SciPy's full Dijkstras, and in memory.

    python benchmarks/mesh_huge.py [--quick] [--json] [--side 3163]

The peer is ``scipy.sparse.csgraph.dijkstra`` with predecessors on the same graph in the same run. Needs about 10 GB.
``--quick`` takes a terrain of 100,000 vertices.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from pathlib import Path

from mesh_speed import NEVER, corner_query, plugin, scipy_graph, seconds_of
from scipy.sparse.csgraph import dijkstra
from terrain_meshes import Terrain, add_layer, fractal_terrain

from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.search.leg_search import propagate_from
from mbf_mesh_nav.search.wave_search import WaveSearch


def resident_gigabytes() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e9


def small_map_compiles() -> None:
    """Compile, or read from the cache, every kernel measured below."""
    terrain = fractal_terrain(20)
    mesh_map = MeshMap.from_arrays(terrain.vertices, terrain.faces)
    query = corner_query(mesh_map)
    propagate_from(mesh_map, query.snapshot, query.blocked, query.goal, NEVER)
    plugin(AStarPlanner, mesh_map).find_leg(query)
    WaveSearch(mesh_map).propagate(query, overshoot=1e9)


def measure(side: int) -> dict[str, float]:
    """Seconds of loading and of the peer, ratios to the peer, resident memory [GB] after loading and with the wave."""
    small_map_compiles()
    terrain = fractal_terrain(side)
    figures, ours = measure_ours(terrain)
    graph = scipy_graph(terrain)
    figures["scipy_s"] = seconds_of(lambda: dijkstra(graph, indices=0, return_predecessors=True))
    return {**figures, **{name: seconds / figures["scipy_s"] for name, seconds in ours.items()}}


def measure_ours(terrain: Terrain) -> tuple[dict[str, float], dict[str, float]]:
    """Loading and memory; seconds of the searches. The map is gone afterwards: the peer needs the memory."""
    begin = time.thread_time()
    mesh_map = MeshMap.from_arrays(terrain.vertices, terrain.faces)
    figures = {"load_s": time.thread_time() - begin}
    add_layer(mesh_map, terrain.costs)
    figures["resident_gb"] = resident_gigabytes()
    query = corner_query(mesh_map)
    ours = {
        "dijkstra": seconds_of(lambda: propagate_from(mesh_map, query.snapshot, query.blocked, query.goal, NEVER)),
        "astar_corner_to_corner": seconds_of(lambda: plugin(AStarPlanner, mesh_map).find_leg(query)),
    }
    begin = time.thread_time()
    search = WaveSearch(mesh_map)
    ours["corner_records"] = time.thread_time() - begin
    ours["cvp"] = seconds_of(lambda: search.propagate(query, overshoot=1e9))
    figures["resident_with_wave_gb"] = resident_gigabytes()
    return figures, ours


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--side", type=int, default=3163, help="vertices along a side of the terrain")
    arguments.add_argument("--quick", action="store_true", help="a terrain of 100,000 vertices")
    arguments.add_argument("--json", action="store_true", help="print the figures as one JSON line at the end")
    options = arguments.parse_args()
    figures = measure(316 if options.quick else options.side)
    for name, value in figures.items():
        unit = "s" if name.endswith("_s") else "GB" if name.endswith("_gb") else "x SciPy's full Dijkstra"
        print(f"  {name:24} {value:7.2f} {unit}")
    if options.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    with interruptible():
        main()
