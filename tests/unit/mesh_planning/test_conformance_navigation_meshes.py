"""Facts about shortest paths on navigation meshes that other packages' tests publish; the number is in the name."""

import csv
import json
import math

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner

GEODESIC = [AnyAnglePlanner, CVPPlanner]
ALL = [*GEODESIC, AStarPlanner, DijkstraPlanner]
PRINTED = 1e-5
"""The published lengths have six digits."""


def flat(corners, polygons):
    """A map of convex polygons in the plane z = 0, each cut into a fan of triangles about its first corner."""
    faces = [[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)]
    return MeshMap.from_arrays(np.column_stack([np.array(corners, dtype=float), np.zeros(len(corners))]), faces)


def plan(planner, start, goal):
    return planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal)))


@pytest.mark.parametrize("planner_class", GEODESIC)
def test_f355_the_path_bends_round_both_corners_of_a_winding_passage(make_plugin, planner_class):
    corners = [(7, 0), (12, 0), (12, 7), (10, 7), (7, 4), (4, 2), (2, 7), (2, 1), (4, 1)]
    mesh_map = flat(corners, [(0, 1, 2, 3, 4), (4, 3, 6, 5), (5, 6, 7, 8)])
    path = plan(make_plugin(planner_class, mesh_map), (12, 0), (3, 1)).path
    assert path.length == pytest.approx(11.4229, abs=1e-4)
    for corner in ((7, 4), (4, 2)):
        assert np.hypot(*(path.positions[:, :2] - corner).T).min() < 1e-6


@pytest.fixture(scope="module")
def arena(shared_data):
    """The arena as triangles, and its 160 published pairs: starts, goals and lengths."""
    folder = shared_data / "movingai" / "anyangle" / "polyanya"
    mesh = trimesh.load(folder / "arena_tri.ply", process=False)
    with open(folder / "arena_expected_lengths.csv") as file:
        rows = [[float(row[key]) for key in ("sx", "sy", "gx", "gy", "length")] for row in csv.DictReader(file)]
    assert len(rows) == 160
    return MeshMap.from_arrays(mesh.vertices, mesh.faces), rows


@pytest.mark.parametrize("planner_class", GEODESIC)
def test_f356_the_arena_has_its_published_lengths(make_plugin, arena, planner_class):
    # Upstream is exact. Ours looks for other courses only so long; it is at most 0.1 % longer, and never shorter.
    mesh_map, pairs = arena
    planner = make_plugin(planner_class, mesh_map)
    ratios = [plan(planner, pair[:2], pair[2:4]).path.length / pair[4] for pair in pairs]
    assert min(ratios) > 1.0 - PRINTED and max(ratios) < 1.001
    assert np.median(ratios) < 1.0 + PRINTED


@pytest.fixture(scope="module")
def nav2_maps(shared_data):
    """Nav2's six test maps of 10 x 10 cells as flat meshes, a vertex in the middle of each cell."""
    rows = json.loads((shared_data / "maps" / "nav2_test_costmaps.json").read_text())["maps"]
    return {name: np.isin(np.array([list(row) for row in cells]), ["x", "i", "n"]) for name, cells in rows.items()}


@pytest.mark.parametrize("planner_class", ALL)
def test_f171_a_path_on_each_of_nav2s_test_maps(make_plugin, paint, nav2_maps, planner_class):
    assert len(nav2_maps) == 6
    for name, blocked in nav2_maps.items():
        mesh_map = MeshMap.from_heights(np.zeros(blocked.shape), 1.0, 1.0)
        paint(mesh_map, lambda v, b=blocked: np.where(b[v[:, 1].astype(int), v[:, 0].astype(int)], np.inf, 0.0))
        result = plan(make_plugin(planner_class, mesh_map), (1, 1), (8, 8))
        assert result.success, f"{name}: {result.message}"
        # Along edges only every other diagonal is there, so the octile bound becomes that of four neighbours.
        assert math.hypot(7, 7) - 1e-6 <= result.path.length <= 14.0 + 1e-6, name
        at = np.rint(result.path.positions[:, :2]).astype(int)
        near = np.hypot(*(result.path.positions[:, :2] - at).T) < 1e-6
        assert not blocked[at[near, 1], at[near, 0]].any(), f"{name}: over a blocked vertex"


@pytest.mark.parametrize("planner_class", ALL)
def test_f357_a_place_in_a_hole_is_off_the_map(make_plugin, planner_class):
    outer, inner = [(0, 0), (10, 0), (10, 10), (0, 10)], [(2.5, 2.5), (7.5, 2.5), (7.5, 7.5), (2.5, 7.5)]
    planner = make_plugin(
        planner_class, flat(outer + inner, [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)])
    )
    assert plan(planner, (1, 5), (9, 5)).success
    for start, goal, name in (((5, 5), (1, 1), "start"), ((1, 1), (5, 5), "goal")):
        result = plan(planner, start, goal)
        assert result.outcome == GetPathOutcome.OUT_OF_MAP
        assert f"the {name} (5.00, 5.00, 0.00) is 2.50 m from the surface" in result.message
