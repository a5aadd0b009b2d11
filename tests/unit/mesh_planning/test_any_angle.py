"""Shortening over a strip of faces: against a numeric optimiser, exact geodesics of real terrain, and costs."""

import csv
import itertools

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.funnel import pull_taut
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner


def random_strip(mesh_map, rng, length):
    """A walk over faces that never turns straight back."""
    strip = [int(rng.integers(len(mesh_map.faces)))]
    while len(strip) < length:
        choices = [f for f in mesh_map.face_neighbours[strip[-1]].tolist() if f >= 0 and f not in strip]
        if not choices:
            break
        strip.append(int(rng.choice(choices)))
    return np.array(strip, np.int32)


def optimised_length(mesh_map, strip, start, goal):
    """The slow twin: minimise the length over the crossing shares numerically."""
    edges = [np.intersect1d(mesh_map.faces[a], mesh_map.faces[b]) for a, b in itertools.pairwise(strip)]
    a, b = (mesh_map.vertices[[edge[k] for edge in edges]] for k in (0, 1))

    def length(shares):
        points = np.concatenate([[start], a + shares[:, None] * (b - a), [goal]])
        return np.sqrt(np.sum(np.diff(points, axis=0) ** 2, axis=1) + 1e-14).sum()

    return minimize(length, np.full(len(edges), 0.5), bounds=[(0, 1)] * len(edges), options={"maxiter": 500}).fun


@pytest.mark.parametrize("seed", range(8))
def test_the_taut_path_is_as_short_as_a_numeric_optimum(hills, seed):
    rng = np.random.default_rng(seed)
    strip = random_strip(hills, rng, 14)
    start, goal = hills.vertices[hills.faces[strip[[0, -1]]]].mean(axis=1)
    points = pull_taut(hills.vertices, hills.faces, strip, tuple(start), tuple(goal))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length == pytest.approx(optimised_length(hills, strip, start, goal), rel=2e-4)
    np.testing.assert_array_equal(points[[0, -1]], [start, goal])
    assert (hills.locate(points).distances < 1e-9).all()


def exact_pairs(shared_data, mesh_name):
    mesh = trimesh.load(shared_data / mesh_name, process=False)
    with open(shared_data / "terrain/geodesic_reference.csv") as file:
        rows = [row for row in csv.DictReader(file) if row["mesh"] == mesh_name]
    ends = [[Pose(tuple(float(row[end + axis]) for axis in "xyz")) for end in "st"] for row in rows]
    return MeshMap.from_arrays(mesh.vertices, mesh.faces), ends, [float(row["exact_mmp"]) for row in rows]


def test_paths_on_surveyed_ground_are_within_the_accepted_share_of_exact_geodesics(shared_data, make_plugin):
    mesh_map, ends, exact = exact_pairs(shared_data, "terrain/dem/kootenai_1m.ply")
    for planner_class, mean_limit in ((CVPPlanner, 1.005), (AnyAnglePlanner, 1.001)):
        planner = make_plugin(planner_class, mesh_map)
        lengths = [planner.make_plan(PlanRequest(start, goal)).path.length for start, goal in ends]
        ratios = np.divide(lengths, exact)
        assert ratios.min() > 0.9999 and ratios.mean() <= mean_limit and ratios.max() <= 1.03


def test_where_costs_bend_the_path_it_is_not_pulled_straight(make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: 0.9 * np.exp(-((v[:, 0] - 3) ** 2 + (v[:, 1] - 3) ** 2)), edge_cost_factor=5.0)
    path = make_plugin(AnyAnglePlanner, mesh_map).make_plan(PlanRequest(Pose.planar(1, 3.1), Pose.planar(5, 3.1))).path
    assert np.abs(path.positions[:, 1] - 3).max() > 0.5


def test_round_a_corner_the_path_is_taut_and_free(make_plugin, plain, paint):
    mesh_map = paint(plain(), lambda v: np.where((v[:, 0] > 1.9) & (v[:, 0] < 4.1) & (v[:, 1] < 4.1), np.inf, 0.0))
    path = make_plugin(AnyAnglePlanner, mesh_map).make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(5, 1))).path
    corners = [(1, 1), (1.8, 4.2), (4.0, 4.2), (4.2, 4.0), (5, 1)]  # the last but one: a free face cuts the corner
    shortest = sum(np.hypot(*np.subtract(a, b)) for a, b in itertools.pairwise(corners))
    assert path.length == pytest.approx(shortest, rel=3e-3)  # the strip may miss the best corner by a vertex
