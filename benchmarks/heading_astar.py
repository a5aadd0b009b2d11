"""Speed of heading-aware A* on a terrain of 277,000 vertices, beside A* over the vertices in the same run.

    python benchmarks/heading_astar.py [--side 526] [--pairs 40] [--max-tilt 0.45] [--json]

The terrain is that of ``mesh_speed.py``; the tilt layer is that of the outdoor scenario (a Husky with rigid axles).
Each pair is planned twice: first with what earlier pairs have found out of edges, then once more. Times are CPU time
of the thread. Costs are summed, so that two versions can be compared: the sum must not change.
"""

from __future__ import annotations

import argparse
import json
from functools import partial

import numpy as np
from mesh_speed import plugin, seconds_of
from numpy.typing import NDArray
from terrain_meshes import add_layer, fractal_terrain

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner

LIMITS_MS = {"median": 60.0, "worst": 200.0}


def tilted_terrain(side: int, max_tilt: float) -> tuple[MeshMap, NDArray[np.bool_]]:
    """A fractal terrain with costs and a tilt layer, and the vertices (V,) that allow every heading."""
    terrain = fractal_terrain(side)
    mesh_map = MeshMap.from_arrays(terrain.vertices, terrain.faces)
    costs = add_layer(mesh_map, terrain.costs)
    settings = TiltLayer.Parameters(
        wheelbase=0.512,
        track=0.571,
        rigid=True,
        max_roll=max_tilt,
        max_pitch_up=max_tilt,
        max_pitch_down=max_tilt,
        center_of_mass_height=0.22,
        ground_clearance=0.12,
    )
    tilt = TiltLayer(LayerContext("tilt", mesh_map.topology, mesh_map.locator, settings))
    tilt.recompute()
    mesh_map.set_layers(LayerGraph([costs, tilt]), "given", 1.0)
    return mesh_map, tilt.allowed.all(axis=1)


def measure(side: int, pairs: int, max_tilt: float) -> dict[str, float]:
    mesh_map, standing = tilted_terrain(side, max_tilt)
    planners = plugin(AStarPlanner, mesh_map), plugin(HeadingAStarPlanner, mesh_map)
    rng = np.random.default_rng(3)
    times, cost, failed = [], 0.0, 0
    for pair in range(pairs + 1):
        ends = (Pose(tuple(mesh_map.vertices[vertex])) for vertex in rng.choice(np.flatnonzero(standing), 2, False))
        request = PlanRequest(*ends, angle_tolerance=np.pi)
        plans = [partial(planner.make_plan, request) for planner in (*planners, planners[1])]
        row = [seconds_of(plan) for plan in plans]
        if pair == 0:  # compiles
            continue
        result = planners[1].make_plan(request)
        times.append(row)
        failed += not result.success
        cost += result.cost if result.success else 0.0
    astar, first, again = 1e3 * np.array(times).T
    return {
        "vertices": len(mesh_map.vertices),
        "astar_median_ms": float(np.median(astar)),
        "first_median_ms": float(np.median(first)),
        "first_worst_ms": float(first.max()),
        "again_median_ms": float(np.median(again)),
        "again_worst_ms": float(again.max()),
        "over_astar": float(np.median(first / astar)),
        "failed": failed,
        "cost_sum": cost,
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--side", type=int, default=526, help="vertices along a side")
    arguments.add_argument("--pairs", type=int, default=40)
    arguments.add_argument("--max-tilt", type=float, default=0.45, help="limit of roll and pitch [rad]")
    arguments.add_argument("--json", action="store_true", help="print the figures as one JSON line at the end")
    options = arguments.parse_args()
    figures = measure(options.side, options.pairs, options.max_tilt)
    for name, value in figures.items():
        print(f"{name:18} {value:12.2f}")
    for name, limit in LIMITS_MS.items():
        met = max(figures[f"first_{name}_ms"], figures[f"again_{name}_ms"]) <= limit
        print(f"{name} at most {limit:g} ms: {'ok' if met else 'MISSED'}")
    if options.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    with interruptible():
        main()
