"""Time to the first plan on a mesh: cold compilation of the whole mesh chain, and ``mbf plan`` from a cached start.

    python benchmarks/mesh_start.py [--quick] [--json]

Cold: a child process with an empty kernel cache builds a map with every analysis layer and runs each planner and
controller once; the same again with the cache filled is taken off, so compilation is what remains. Cached: ``mbf plan``
on a 100 k mesh against a process that only loads the same mesh with its layers. Both in CPU time of the children, for
the machine is shared. ``--quick`` takes a mesh of 10,000 vertices for ``mbf plan``.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from mesh_layers import layered_map
from mesh_speed import plugin
from terrain_meshes import fractal_terrain

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.queries import PlaceQuery
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.controllers.path_follower import PathFollower
from mbf_mesh_nav.controllers.vector_field import VectorFieldController
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import default_layers
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner
from mbf_mesh_nav.planners.repairing import RepairingPlanner

PLANNERS = (DijkstraPlanner, AStarPlanner, RepairingPlanner, AnyAnglePlanner, HeadingAStarPlanner, CVPPlanner)
CONTROLLERS = (VectorFieldController, PathFollower, MPPIController)
LIMITS = {"cold_compile_s": 20.0, "cached_plan_s": 1.5}


def run_chain() -> None:
    """Call every kernel of the mesh packages at least once, as a robot would."""
    mesh_map = layered_map(40)
    TiltLayer(LayerContext("tilt", mesh_map.topology, mesh_map.locator, TiltLayer.Parameters())).recompute()
    ends = mesh_map.vertices[[np.argmin(mesh_map.vertices[:, :2].sum(axis=1)), np.argmax(mesh_map.vertices[:, 0])]]
    request = PlanRequest(*(Pose(tuple(end)) for end in ends))
    mesh_map.set_layers(mesh_map.layers, "seen", 1.0)  # nothing seen yet: free everywhere
    for planner_class in PLANNERS:
        planner = plugin(planner_class, mesh_map)
        planner.make_plan(request)
        mesh_map.insert_points("cloud", mesh_map.vertices.mean(axis=0) + np.array([0.0, 0.0, 0.3]), ends[0] + 1.0, 0.0)
        mesh_map.update(None, 0.0)
        result = planner.make_plan(request)
        if not result.success:
            raise RuntimeError(f"{planner_class.__name__}: {result.message}")
        mesh_map.clear()
    for controller_class in CONTROLLERS:
        controller = plugin(controller_class, mesh_map)
        controller.set_plan(result.path)
        controller.compute_velocity_commands(ControlRequest(result.path[0], Twist()))
    mesh_map.pose_check(PlaceQuery())(result.path[0])


def load(mesh_file: str) -> None:
    """Read a mesh and compute its layers, as ``mbf plan`` does with a bare mesh."""
    parameters, blocks = default_layers(0.25)
    build_mesh_map(parameters.model_copy(update={"mesh_file": mesh_file}), blocks)


def cpu_seconds(command: list[str], cache: Path) -> float:
    """CPU time [s] of a child process with its own kernel cache."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(side: int) -> dict[str, float]:
    """Compile times and start times."""
    this, mbf = [sys.executable, __file__], [str(Path(sys.executable).with_name("mbf"))]
    with tempfile.TemporaryDirectory() as folder:
        cache, mesh_file = Path(folder) / "cache", Path(folder) / "terrain.ply"
        terrain = fractal_terrain(side)
        trimesh.Trimesh(terrain.vertices, terrain.faces, process=False).export(mesh_file)
        cold, warm = (cpu_seconds([*this, "--chain"], cache) for _ in range(2))
        far = f"{0.1 * side - 2.0:.2f}"
        plan = [*mbf, "plan", str(mesh_file), "--start", "1.5", "1.5", "--goal", far, far, "--tolerance", "2.0"]
        cpu_seconds(plan, cache)  # compiles what the chain has not
        planned = min(cpu_seconds(plan, cache) for _ in range(2))
        loaded = min(cpu_seconds([*this, "--load", str(mesh_file)], cache) for _ in range(2))
    return {"cold_compile_s": cold - warm, "chain_cached_s": warm, "plan_s": planned, "load_s": loaded}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--quick", action="store_true", help="a mesh of 10,000 vertices for the cached start")
    arguments.add_argument("--json", action="store_true", help="print the figures as one JSON line at the end")
    arguments.add_argument("--chain", action="store_true", help=argparse.SUPPRESS)
    arguments.add_argument("--load", help=argparse.SUPPRESS)
    options = arguments.parse_args()
    if options.chain:
        run_chain()
        return
    if options.load:
        load(options.load)
        return
    figures = measure(100 if options.quick else 316)
    figures["cached_plan_s"] = figures["plan_s"] - figures["load_s"]
    for name, value in figures.items():
        limit = f"  limit {LIMITS[name]:g}" if name in LIMITS else ""
        print(f"  {name:16} {value:7.2f} s{limit}")
    if options.json:
        print(json.dumps({**figures, "limits": LIMITS}))


if __name__ == "__main__":
    with interruptible():
        main()
