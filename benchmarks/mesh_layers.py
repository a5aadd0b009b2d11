"""Speed of the mesh map: load, each layer, obstacle updates and memory, as multiples of SciPy's Dijkstra.

    python benchmarks/mesh_layers.py [--quick] [--json] [--side 1000]
    python benchmarks/mesh_layers.py --from-file [--side 560]

Peers in the same run: ``scipy.sparse.csgraph.dijkstra`` with predecessors on the same mesh (the unit of every ratio)
and ``scipy.spatial.cKDTree`` (vertices only) for building and batches of pose queries. ``--quick`` takes a terrain of
10,000 vertices; ``--json`` prints the figures as last line. ``--from-file`` reads the terrain from a binary PLY instead
and splits the longest twentieth of its edges, in CPU time of the whole process; 560 gives 625,000 faces.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from terrain_meshes import fractal_terrain

from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfaceLocator
from mbf_mesh_nav.search.wave_search import WaveSearch

ANALYSIS = ("border", "steepness", "roughness", "height_diff", "ridge", "clearance")
LIMIT_EIGHT_LAYERS = 40.0
QUERIES = 100_000


def seconds_of(task: Callable[[], object], rounds: int = 2) -> float:
    """Shortest time [s] this thread computed for a task."""
    times = []
    for _ in range(rounds):
        start = time.thread_time()
        task()
        times.append(time.thread_time() - start)
    return min(times)


def layered_map(side: int) -> MeshMap:
    """A terrain with every analysis layer, their inflation, and inflated obstacles."""
    terrain = fractal_terrain(side)
    return build_mesh_map(*parameters_of_map(), vertices=terrain.vertices, faces=terrain.faces)


def parameters_of_map(**changes: object) -> tuple[MeshMapParameters, dict[str, dict[str, float]]]:
    """Parameters of that map with some ``changes``, and the blocks of its layers."""
    layers = [{"name": name, "type": name} for name in ANALYSIS]
    layers += [
        {"name": "lethal", "type": "max_combination", "inputs": ANALYSIS},
        {"name": "inflation", "type": "inflation", "inputs": ["lethal"]},
        {"name": "seen", "type": "obstacle"},
        {"name": "seen_inflation", "type": "inflation", "inputs": ["seen"]},
        {"name": "final", "type": "max_combination", "inputs": ["inflation", "seen_inflation"]},
    ]
    blocks = {"clearance": {"robot_height": 1.0}, "height_diff": {"height_limit": 1.0}, "steepness": {"threshold": 0.5}}
    return MeshMapParameters(layers=layers, default_layer="final", edge_cost_factor=1.0, **changes), blocks


def report_loading(side: int) -> dict[str, float]:
    """CPU time [s] from a PLY file to the map with its layers, without and with splitting edges; kernels are warm."""
    terrain = fractal_terrain(side)
    a, b = terrain.vertices[terrain.faces], terrain.vertices[np.roll(terrain.faces, -1, axis=1)]
    longest = float(np.quantile(np.linalg.norm(b - a, axis=2), 0.95))
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = FilePath(folder) / "terrain.ply"
        write_map(file, terrain.vertices, terrain.faces.astype(np.int32), MapHeader((0.0, 0.0, 0.0), 0.0, 0.0, 0.0))
        for name, densify in (("warm", longest), ("load", 0.0), ("load_and_densify", longest)):
            begin = time.process_time()
            mesh_map = build_mesh_map(*parameters_of_map(mesh_file=str(file), densify=densify))
            figures[f"{name}_s"] = time.process_time() - begin
            print(f"  {name:18} {figures[f'{name}_s']:5.2f} s of CPU, {len(mesh_map.vertices)} vertices")
    return figures


def report_layers(mesh_map: MeshMap, unit: float) -> dict[str, float]:
    total, figures = 0.0, {}
    settings = TiltLayer.Parameters()
    tilt = TiltLayer(LayerContext("tilt", mesh_map.topology, mesh_map.locator, settings))
    layers: dict[str, MeshLayer] = {name: mesh_map.layers[name] for name in (*ANALYSIS, "lethal", "inflation")}
    for name, layer in {**layers, "tilt": tilt}.items():
        ratio = seconds_of(layer.recompute) / unit
        figures[f"{name}_over_scipy"] = ratio
        total += ratio if name in layers else 0.0
        print(f"  {name:12} {ratio:7.2f} x SciPy")
    print(f"  eight layers {total:7.2f} x SciPy, limit {LIMIT_EIGHT_LAYERS:g}  (tilt is not among them)")
    return {**figures, "eight_layers_over_scipy": total}


def _see(mesh_map: MeshMap, cloud: NDArray[np.float64], origin: NDArray[np.float64], stamp: float) -> None:
    mesh_map.insert_points("cloud", cloud, origin, stamp)
    mesh_map.update(None, stamp)


def report_obstacles(mesh_map: MeshMap) -> dict[str, float]:
    rng = np.random.default_rng(2)
    centre = mesh_map.vertices[len(mesh_map.vertices) // 2]
    cloud = centre + rng.normal(0.0, 1.0, (5000, 3)) * [2.0, 2.0, 0.2] + [0.0, 0.0, 0.5]
    _see(mesh_map, cloud, centre, 0.0)
    moved = cloud + np.array([0.3, 0.0, 0.0])
    shifted = seconds_of(lambda: _see(mesh_map, moved, centre, 1.0), 1)
    anew = seconds_of(mesh_map.layers["inflation"].recompute, 1)
    marked = int(mesh_map.layers["seen"].lethal.sum())
    update, start = f"{shifted * 1e3:.1f} ms", f"{anew * 1e3:.1f} ms"
    print(f"  cloud of 5000 points, {marked} lethal vertices: {update} (static inflation anew: {start})")
    return {"obstacle_update_over_inflation": shifted / anew}


def report_queries(mesh_map: MeshMap) -> dict[str, float]:
    rng = np.random.default_rng(3)
    points = mesh_map.vertices[rng.integers(len(mesh_map.vertices), size=QUERIES)] + rng.normal(0, 0.03, (QUERIES, 3))
    tree = cKDTree(mesh_map.vertices)
    build = seconds_of(lambda: SurfaceLocator(mesh_map.topology)) / seconds_of(lambda: cKDTree(mesh_map.vertices), 1)
    query = seconds_of(lambda: mesh_map.locate(points, 0.5)) / seconds_of(lambda: tree.query(points), 1)
    print(f"  pose queries: build {build:.2f} x, {QUERIES} exact surface points {query:.2f} x cKDTree (vertices only)")
    figures = {"locator_build_over_kdtree": build, "locate_over_kdtree": query}
    try:
        import open3d
    except ImportError:  # 400 MB, so it is not in the extra: pip install open3d
        return figures
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(mesh_map.vertices.astype(np.float32), mesh_map.faces.astype(np.uint32))
    queries = open3d.core.Tensor(points.astype(np.float32))
    peer = seconds_of(lambda: scene.compute_closest_points(queries, nthreads=1))
    figures["locate_over_open3d"] = seconds_of(lambda: mesh_map.locate(points, 0.5)) / peer
    print(f"  {QUERIES} surface points {figures['locate_over_open3d']:.2f} x open3d on one thread, limit 2")
    return figures


def report_memory(mesh_map: MeshMap) -> dict[str, float]:
    """Megabytes of the arrays of graph planners, what waves need besides, all layers, the process without waves."""
    resident = int(FilePath("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
    snapshot, topology = mesh_map.snapshot(), mesh_map.topology
    names = ("vertices", "faces", "neighbour_offsets", "neighbours", "vertex_face_offsets", "vertex_faces")
    graph = [getattr(topology, name) for name in names]
    graph += [snapshot.costs, snapshot.lethal, snapshot.edge_weights]
    layers = [array for layer in mesh_map.layers.values() for array in vars(layer).values()]
    figures = {
        "planning_mb": sum(array.nbytes for array in graph) / 1e6,
        "wave_mb": WaveSearch(mesh_map).nbytes / 1e6,
        "layers_mb": sum(array.nbytes for array in layers if isinstance(array, np.ndarray)) / 1e6,
        "resident_mb": resident,
    }
    print("  memory: " + ", ".join(f"{name} {value:.0f}" for name, value in figures.items()))
    return figures


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--side", type=int, default=316, help="vertices along a side of the terrain")
    arguments.add_argument("--quick", action="store_true", help="a terrain of 10,000 vertices")
    arguments.add_argument("--json", action="store_true", help="print the figures as last line")
    arguments.add_argument("--from-file", action="store_true", help="only load the terrain from a file")
    chosen = arguments.parse_args()
    side = 100 if chosen.quick else chosen.side
    if chosen.from_file:
        loading = report_loading(side)
        if chosen.json:
            print(json.dumps({"vertices": side * side, **{key: round(value, 3) for key, value in loading.items()}}))
        return
    layered_map(20)  # compiles the kernels
    start = time.perf_counter()
    mesh_map = layered_map(side)
    print(f"{side * side} vertices, {len(mesh_map.layers)} layers, built in {time.perf_counter() - start:.2f} s")
    memory = report_memory(mesh_map)
    graph = scipy.sparse.csr_matrix(
        (mesh_map.neighbour_lengths.astype(float), mesh_map.neighbours, mesh_map.neighbour_offsets)
    )
    unit = seconds_of(lambda: dijkstra(graph, indices=0, return_predecessors=True))
    print(f"  SciPy's full Dijkstra {unit * 1e3:.1f} ms")
    figures = {**memory, **report_layers(mesh_map, unit), **report_obstacles(mesh_map), **report_queries(mesh_map)}
    if chosen.json:
        print(json.dumps({"vertices": side * side, **{key: round(value, 3) for key, value in figures.items()}}))


if __name__ == "__main__":
    with interruptible():
        main()
