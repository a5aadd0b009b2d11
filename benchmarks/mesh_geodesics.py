"""Paths over faces against exact geodesics on meshes that nothing was tuned on, coarse and irregular ones included.

    python benchmarks/mesh_geodesics.py [--data ../shared/data]

Pairs of vertices at least five edges apart, half of them at most fifteen; truth is pygeodesic's exact solver.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pygeodesic.geodesic
import trimesh
from mesh_accuracy import REPAIRS, without_non_manifold_vertices
from mesh_speed import plugin
from scipy.spatial import Delaunay
from terrain_meshes import fractal_terrain

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner

Arrays = tuple[np.ndarray, np.ndarray]
SURVEYED = (
    "meshes/derived/botanical_garden_largest.ply",
    "meshes/mesh_navigation_tutorials/floor_is_lava_map.ply",
    "meshes/mesh_navigation_tutorials/tray_map.ply",
    "meshes/rmagine/sphere.ply",
    "meshes/uos_tools/floor.dae",
    "terrain/recast/dungeon.obj",
)
SOURCES, TARGETS = 6, 40


def irregular(count: int, height: float, seed: int, stretch: float = 1.0) -> Arrays:
    """Hills with vertices anywhere; thin faces at the hull are left out."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 10.0, (count, 2)) * [1.0, stretch]
    heights = height * np.sin(1.3 * places[:, 0]) * np.cos(1.1 * places[:, 1] / stretch)
    vertices, faces = np.column_stack([places, heights]), Delaunay(places).simplices
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    faces[mesh.face_normals[:, 2] < 0.0] = faces[mesh.face_normals[:, 2] < 0.0][:, ::-1]
    sides = vertices[faces] - np.roll(vertices[faces], 1, axis=1)
    return vertices, faces[mesh.area_faces > 0.01 * (sides**2).sum(axis=2).max(axis=1)]


def stretched() -> Arrays:
    """Hills on a grid with cells of 0.4 m x 0.1 m."""
    x, y = np.meshgrid(np.arange(40) * 0.4, np.arange(120) * 0.1)
    return heightfield_mesh(0.4 * np.sin(x) * np.cos(0.8 * y), 0.4, 0.1)


def generated() -> dict[str, Arrays]:
    """Meshes by name."""
    torus = trimesh.creation.torus(2.0, 0.8, major_sections=48, minor_sections=24)
    terrain = fractal_terrain(60, seed=4)
    return {
        "irregular, fine": irregular(4000, 0.3, 1),
        "irregular, coarse": irregular(300, 0.8, 2),
        "irregular, stretched": irregular(1500, 0.3, 3, 0.3),
        "grid, stretched": stretched(),
        "fractal terrain": (terrain.vertices, terrain.faces),
        "torus": (torus.vertices, torus.faces),
    }


def compare(vertices: np.ndarray, faces: np.ndarray) -> dict[str, np.ndarray]:
    """Relative errors of the lengths by planner."""
    mesh_map = without_non_manifold_vertices(MeshMap.from_arrays(vertices, faces, repair=REPAIRS))
    solver = pygeodesic.geodesic.PyGeodesicAlgorithmExact(mesh_map.vertices, mesh_map.faces)
    rng, edge = np.random.default_rng(11), float(mesh_map.neighbour_lengths.mean())
    planners = {"cvp": plugin(CVPPlanner, mesh_map), "any-angle": plugin(AnyAnglePlanner, mesh_map)}
    _, place, copies = np.unique(mesh_map.vertices, axis=0, return_inverse=True, return_counts=True)
    largest = mesh_map.components == np.bincount(mesh_map.components).argmax()
    usable = np.flatnonzero(largest & (copies[place.ravel()] == 1))
    errors: dict[str, list[float]] = {name: [] for name in planners}
    for source in rng.choice(usable, SOURCES, replace=False):
        exact, _ = solver.geodesicDistances(np.array([source]), None)
        far = usable[(exact[usable] > 5.0 * edge) & np.isfinite(exact[usable])]
        near = far[exact[far] < 15.0 * edge]
        for some in (far, near):
            for target in rng.choice(some, min(TARGETS // 2, len(some)), replace=False):
                request = PlanRequest(*(Pose(tuple(mesh_map.vertices[end])) for end in (target, source)))
                for name, planner in planners.items():
                    errors[name].append(planner.make_plan(request).path.length / exact[target] - 1.0)
    return {name: np.array(values) for name, values in errors.items()}


def main() -> None:
    """Print mean and greatest error of every mesh."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    meshes = generated()
    data = parser.parse_args().data
    for name in SURVEYED:
        mesh = trimesh.load(data / name, process=False, force="mesh")
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        meshes[Path(name).name] = mesh.vertices, mesh.faces
    for name, arrays in meshes.items():
        for planner, errors in compare(*arrays).items():
            above = int((errors > 0.03).sum())
            print(f"{name:32} {planner:10} mean {errors.mean():7.3%} max {errors.max():7.2%} above 3 %: {above}")


if __name__ == "__main__":
    with interruptible():
        main()
