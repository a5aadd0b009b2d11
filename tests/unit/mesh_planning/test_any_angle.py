"""Shortening within a corridor: against a search over its corners, exact geodesics of real terrain, and costs."""

import csv
import itertools

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.wave.funnel import pull_string
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner


def random_corridor(mesh_map, rng, length):
    """A walk over faces that never turns straight back."""
    corridor = [int(rng.integers(len(mesh_map.faces)))]
    while len(corridor) < length:
        choices = [f for f in mesh_map.face_neighbours[corridor[-1]].tolist() if f >= 0 and f not in corridor]
        if not choices:
            break
        corridor.append(int(rng.choice(choices)))
    return np.array(corridor, np.int32)


ROUNDING = 1e-9
"""Of a length: what some hundred operations of 1e-16 each add up to, on coordinates a hundred times the edges."""
ON_LINE = 1e-16
"""Product of two areas [m^4] of about 1e-2 m^2 and their rounding error."""


def unfolded(mesh_map, corridor, points):
    """The corridor laid into the plane: both ends (n - 1, 2, 2) of its portals, and the points of its end faces.

    Faces are turned about their common edge one by one, so every corner keeps its distances to that edge's ends.
    """
    flat: dict[int, np.ndarray] = {}

    def place(point, a, b, side):
        along, offset = mesh_map.vertices[b] - mesh_map.vertices[a], point - mesh_map.vertices[a]
        length = np.hypot(np.hypot(along[0], along[1]), along[2])
        x = (offset * along).sum() / length
        y = side * np.sqrt(max((offset * offset).sum() - x * x, 0.0))
        axis = (flat[b] - flat[a]) / length
        return flat[a] + x * axis + y * np.array([-axis[1], axis[0]])

    a, b, c = mesh_map.faces[corridor[0]].tolist()
    flat[a], flat[b] = np.zeros(2), np.array([np.sqrt(((mesh_map.vertices[b] - mesh_map.vertices[a]) ** 2).sum()), 0])
    flat[c], start = place(mesh_map.vertices[c], a, b, 1.0), place(points[0], a, b, 1.0)
    portals = []
    for face, following in itertools.pairwise(corridor.tolist()):
        left = [corner for corner in mesh_map.faces[face].tolist() if corner in mesh_map.faces[following]]
        (behind,) = set(mesh_map.faces[face].tolist()) - set(left)
        (ahead,) = set(mesh_map.faces[following].tolist()) - set(left)
        turn = np.linalg.det([flat[left[1]] - flat[left[0]], flat[behind] - flat[left[0]]])
        side = -1.0 if turn > 0 else 1.0
        portals.append([flat[left[0]], flat[left[1]]])
        goal = place(points[1], *left, side)
        flat[ahead] = place(mesh_map.vertices[ahead], *left, side)
    return start, np.array(portals), goal


def crosses(a, b, portal):
    """Whether the line from a to b and a portal have a point in common."""
    ends = [np.linalg.det([b - a, end - a]) for end in portal]
    sides = [np.linalg.det([portal[1] - portal[0], point - portal[0]]) for point in (a, b)]
    return ends[0] * ends[1] <= ON_LINE and sides[0] * sides[1] <= ON_LINE


def shortest_length(mesh_map, corridor, points):
    """The slow twin: the shortest chain of lines over ends of portals, each line crossing all portals on its way."""
    start, portals, goal = unfolded(mesh_map, corridor, points)
    nodes = [(-1, start), *((index, end) for index, portal in enumerate(portals) for end in portal)]
    best = {0: 0.0}
    for there, (index, point) in enumerate([*nodes, (len(portals), goal)][1:], start=1):
        best[there] = min(
            best[here] + np.hypot(*(point - nodes[here][1]))
            for here in range(there)
            if nodes[here][0] < index
            and all(crosses(nodes[here][1], point, p) for p in portals[nodes[here][0] + 1 : index])
        )
    return best[len(nodes)]


@pytest.mark.parametrize("seed", range(8))
def test_the_taut_path_is_the_shortest_through_its_corridor(hills, seed):
    rng = np.random.default_rng(seed)
    corridor = random_corridor(hills, rng, 14)
    ends = hills.vertices[hills.faces[corridor[[0, -1]]]].mean(axis=1)
    points, _ = pull_string(hills.vertices, hills.faces, corridor, *(tuple(end) for end in ends))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length == pytest.approx(shortest_length(hills, corridor, ends), rel=ROUNDING)
    np.testing.assert_array_equal(points[[0, -1]], ends)
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
    assert path.length == pytest.approx(shortest, rel=3e-3)  # the corridor may miss the best corner by a vertex
