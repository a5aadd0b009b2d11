"""Accuracy of planning on meshes against exact polyhedral geodesics.

    python benchmarks/mesh_accuracy.py [--quick] [--json] [--data ../shared/data]

Truth: ``terrain/geodesic_reference.csv`` of the data folder (342 pairs, exact MMP lengths), and pygeodesic's exact
solver on plane, sphere, bunny and parking garage in the same run. Per mesh: the potential of the continuous wave,
the length of its traced path, the any-angle path and the path along edges, all over the exact length. For the whole
fields, vertices in which two surfaces touch are made two (bunny 28, garage 10): the exact solver does not pass from one
surface to the other there, the wave may, so the two would answer different questions.
Pairs nearer than five edges are left out, there any first-order method is as coarse as the mesh.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import trimesh
from mesh_speed import corner_query, plugin
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from terrain_meshes import add_layer, fractal_terrain

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.surface_point import surface_point_at_vertex
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.search.wave_search import WaveSearch

REPAIRS = ("duplicate_vertices", "zero_area", "duplicate_faces", "non_manifold", "flipped_winding", "unreferenced")
PLANNERS = {"cvp_path": CVPPlanner, "any_angle_path": AnyAnglePlanner, "dijkstra_path": DijkstraPlanner}
COARSE = {"terrain/recast/nav_test.obj", "movingai/anyangle/polyanya/recast_detail_tri.ply"}
"""Navigation meshes with triangles as long as rooms: shown, but not under the limits, which are for terrain."""
WHOLE_FIELDS = (
    "meshes/mesh_mppi/plane.ply",
    "meshes/mesh_mppi/sphere.ply",
    "terrain/surfaces/bunny_trimesh.ply",
    "meshes/derived/parking_garage_1m.ply",
)
ROUGH = "terrain/surfaces/bunny_trimesh.ply"
OTHER_SOURCES = 12
"""On the roughest mesh the field is measured from so many more vertices: one may be lucky."""


def load(path: FilePath) -> MeshMap:
    mesh = trimesh.load(path, process=False, force="mesh")
    return MeshMap.from_arrays(mesh.vertices, mesh.faces, repair=REPAIRS)


def compare_pairs(mesh_map: MeshMap, rows: list[dict[str, str]]) -> dict[str, list[float]]:
    """Ratios to the exact length of all pairs of one mesh."""
    planners = {name: plugin(planner, mesh_map) for name, planner in PLANNERS.items()}
    shortest = 5.0 * float(mesh_map.neighbour_lengths.mean())
    ratios: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        exact = float(row["exact_mmp"])
        if exact < shortest:
            continue
        start, goal = (Pose(tuple(float(row[end + axis]) for axis in "xyz")) for end in "st")
        for name, planner in planners.items():
            result = planner.make_plan(PlanRequest(start, goal))
            if not result.success:
                raise RuntimeError(f"{row['mesh']}: {result.message}")
            ratios[name].append(result.path.length / exact)
            if name == "cvp_path":
                ratios["cvp_field"].append(field_at(mesh_map, result.path, start) / exact)
    return ratios


def field_at(mesh_map: MeshMap, path: Path, start: Pose) -> float:
    """The field's distance at the start: of the best corner of its face, and to it."""
    corners = mesh_map.faces[mesh_map.locate_one(start.position).face]
    steps = np.linalg.norm(mesh_map.vertices[corners] - np.array(start.position), axis=1)
    return float(np.min(path.guidance[0].distances[corners] + steps))


def without_non_manifold_vertices(mesh_map: MeshMap) -> MeshMap:
    """The same mesh, with one vertex for each fan of faces where several touch in a point."""
    faces, corners = mesh_map.faces, np.arange(mesh_map.faces.size).reshape(-1, 3)
    face, side = np.nonzero(mesh_map.face_neighbours >= 0)
    other = mesh_map.face_neighbours[face, side]
    joined = [
        (corners[face, end], corners[other][faces[other] == faces[face, end][:, None]])
        for end in (side, (side + 1) % 3)
    ]
    pairs = np.concatenate(joined, axis=1)
    graph = coo_matrix((np.ones(pairs.shape[1]), pairs), shape=(faces.size, faces.size))
    count, fan = connected_components(graph, directed=False)
    vertices = np.zeros((count, 3))
    vertices[fan] = mesh_map.vertices[faces.ravel()]
    return MeshMap.from_arrays(vertices, fan.reshape(-1, 3), repair=("flipped_winding",))


def compare_field(mesh_map: MeshMap, vertices: Sequence[int] = ()) -> list[float]:
    """Ratios of the wave's whole field to pygeodesic's exact distances from the vertices, or from a middle one."""
    import pygeodesic.geodesic

    mesh_map = without_non_manifold_vertices(mesh_map)
    solver = pygeodesic.geodesic.PyGeodesicAlgorithmExact(mesh_map.vertices, mesh_map.faces)
    search, query, ratios = WaveSearch(mesh_map), corner_query(mesh_map), []
    for source in vertices or [len(mesh_map.vertices) // 2]:
        exact, _ = solver.geodesicDistances(np.array([source]), None)
        goal = surface_point_at_vertex(mesh_map, int(source))
        wave = search.propagate(replace(query, goal=goal), overshoot=1e9)
        assert wave is not None
        far = (exact > 5.0 * mesh_map.neighbour_lengths.mean()) & np.isfinite(wave.distances)
        ratios += list(wave.distances[far] / exact[far])
    return ratios


def free_regions(mesh_map: MeshMap) -> np.ndarray:
    """Label (F,) of the connected region of free faces each face belongs to, -1 for faces with a lethal corner."""
    free = ~mesh_map.snapshot().lethal[mesh_map.faces].any(axis=1)
    face, side = np.nonzero(mesh_map.face_neighbours >= 0)
    other = mesh_map.face_neighbours[face, side]
    joined = free[face] & free[other]
    pairs = (np.ones(joined.sum()), (face[joined], other[joined]))
    _, labels = connected_components(coo_matrix(pairs, shape=(len(free), len(free))), directed=False)
    return np.where(free, labels, -1)


def solved_share(side: int, pair_count: int) -> dict[str, float]:
    """Share of random reachable pairs on a terrain with lethal blobs that CVP finds a path for; goal: all of them."""
    terrain = fractal_terrain(side)
    mesh_map = MeshMap.from_arrays(terrain.vertices, terrain.faces)
    add_layer(mesh_map, np.where(terrain.lethal, np.inf, terrain.costs).astype(np.float32), terrain.lethal)
    regions, planner, rng = free_regions(mesh_map), plugin(CVPPlanner, mesh_map), np.random.default_rng(7)
    solved = tried = 0
    worst = 0.0
    while tried < pair_count:
        start, goal = rng.integers(len(regions), size=2)
        if regions[start] < 0 or regions[start] != regions[goal]:
            continue
        tried += 1
        weights = rng.dirichlet((1, 1, 1), 2)
        ends = [w @ mesh_map.vertices[mesh_map.faces[face]] for w, face in zip(weights, (start, goal), strict=True)]
        result = planner.make_plan(PlanRequest(*[Pose(tuple(end)) for end in ends]))
        solved += result.success
        if result.success:
            worst = max(worst, float(mesh_map.locate(result.path.positions).distances.max()))
    return {"solved": solved / tried, "pairs": tried, "farthest_off_the_surface_m": worst}


def summary(ratios: list[float]) -> dict[str, float]:
    errors = np.abs(np.array(ratios) - 1.0)
    above = int((errors > 0.02).sum())
    return {"mean_error": float(errors.mean()), "max_error": float(errors.max()), "above": above, "count": len(ratios)}


def report(name: str, figures: dict[str, dict[str, float]]) -> None:
    print(f"\n{name}")
    for what, figure in figures.items():
        mean, worst = figure["mean_error"], figure["max_error"]
        above, count = figure["above"], figure["count"]
        print(f"  {what:16} mean {mean:7.3%}  max {worst:7.3%}  above 2 %: {above} of {count}")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="three meshes only")
    arguments.add_argument("--json", action="store_true", help="print the figures as one JSON line at the end")
    arguments.add_argument("--data", type=FilePath, default=FilePath(__file__).parents[2] / "shared" / "data")
    options = arguments.parse_args()
    with open(options.data / "terrain" / "geodesic_reference.csv") as file:
        pairs: dict[str, list[dict[str, str]]] = defaultdict(list)
        for row in csv.DictReader(file):
            pairs[row["mesh"]].append(row)
    results: dict[str, dict[str, Any]] = {}
    pooled: dict[str, list[float]] = defaultdict(list)
    for name in list(pairs)[:3] if options.quick else pairs:
        ratios = compare_pairs(load(options.data / name), pairs[name])
        results[name] = {what: summary(values) for what, values in ratios.items()}
        report(name, results[name])
        if name not in COARSE:
            for what, values in ratios.items():
                pooled[what] += values
    for name in WHOLE_FIELDS[:2] if options.quick else WHOLE_FIELDS:
        results[name] = {"cvp_field": summary(compare_field(load(options.data / name)))}
        report(f"{name}, whole field against pygeodesic", results[name])
    if not options.quick:
        others = np.random.default_rng(7).integers(8000, size=OTHER_SOURCES)
        name = f"{ROUGH}, whole fields from {OTHER_SOURCES} random vertices"
        results[name] = {"cvp_field": summary(compare_field(load(options.data / ROUGH), others.tolist()))}
        report(name, results[name])
    results["all terrain"] = {what: summary(values) for what, values in pooled.items()}
    report(
        "all terrain (limits: field mean 0.5 % max 2 %, paths mean 0.5 %, traced path max 3 %)", results["all terrain"]
    )
    for side in (100, 316):
        name = f"{side * side} vertices, random pairs"
        results[name] = solved_share(side, {100: 500, 316: 50}[side] if options.quick else 2000)
        print(f"\n{name}: {results[name]['solved']:.2%} of {results[name]['pairs']} reachable pairs got a path by CVP")
    if options.json:
        print(json.dumps(results))


if __name__ == "__main__":
    with interruptible():
        main()
