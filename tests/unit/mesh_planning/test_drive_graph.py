"""Moves of a mesh: edges, strides across two faces, and lines straight in the plan view."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.layers.tilt import TiltLayer, TiltParameters
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.surface_point import point_of_face
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner
from mbf_mesh_nav.search.drive_graph import DriveGraph
from mbf_mesh_nav.search.path_cost import cost_along
from mbf_mesh_nav.search.straight_line import line_over_ground


def hilly(seed, size=9):
    return MeshMap.from_heights(np.random.default_rng(seed).uniform(0.0, 0.2, (size, size)), 0.3, 0.25)


def with_tilt(heights, spacing, **parameters):
    mesh_map = MeshMap.from_heights(heights, spacing, spacing)
    settings_ = TiltParameters(wheelbase=0.5, track=0.4, center_of_mass_height=0.0, rigid=True, **parameters)
    layer = TiltLayer(LayerContext("tilt", mesh_map.topology, mesh_map.locator, settings_))
    layer.recompute()
    mesh_map.set_layers(LayerGraph([layer]), "tilt", 0.0)
    return mesh_map


def moves_of(graph, vertex):
    begin, end = graph.moves.offsets[vertex : vertex + 2]
    return {int(graph.moves.ends[slot]): slot for slot in range(begin, end)}


def test_a_regular_grid_is_driven_in_twelve_headings():
    mesh_map = MeshMap.from_heights(np.zeros((7, 7)), 0.2, 0.2)
    graph = DriveGraph(mesh_map.topology)
    middle = int(np.argmin(np.linalg.norm(mesh_map.vertices - [0.6, 0.6, 0.0], axis=1)))
    slots = list(moves_of(graph, middle).values())
    assert len(slots) == 12
    assert len(set(graph.moves.headings[slots].tolist())) == 12


@given(seed=st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_edges_are_those_of_the_mesh_and_strides_lie_on_the_surface_and_cost_what_it_does(seed):
    mesh_map, rng = hilly(seed), np.random.default_rng(seed)
    graph, nothing = DriveGraph(mesh_map.topology), np.zeros(81, bool)
    costs = rng.uniform(0.0, 0.9, 81).astype(np.float32)
    snapshot = mesh_map.snapshot()
    snapshot = type(snapshot)(0, costs, nothing, mesh_map.neighbour_lengths.copy(), 1.5)
    weights = graph.weights(snapshot, nothing)
    np.testing.assert_array_equal(graph.moves.ends[graph.is_edge], mesh_map.neighbours)
    np.testing.assert_array_equal(weights[graph.is_edge], mesh_map.neighbour_lengths)
    for vertex in rng.choice(81, 12, replace=False).tolist():
        for end, slot in moves_of(graph, vertex).items():
            if graph.is_edge[slot]:
                continue
            points, _ = graph.along(np.array([vertex, end], np.int32))
            halves = 0.5 * (points[1:] + points[:-1])
            np.testing.assert_allclose(mesh_map.locate(halves).distances, 0.0, atol=1e-9)
            x, y = (points[1:] - points[:-1])[:, :2].T
            assert math.atan2(y[0], x[0]) == pytest.approx(math.atan2(y[1], x[1]), abs=1e-9)
            faces = mesh_map.locate(halves).faces[[0, 0, 1]]
            assert weights[slot] == pytest.approx(cost_along(mesh_map, snapshot, points, faces), rel=1e-5)
            assert vertex in moves_of(graph, end)


def test_a_stride_beside_a_blocked_vertex_is_not_driven():
    mesh_map = hilly(1)
    graph, blocked = DriveGraph(mesh_map.topology), np.zeros(81, bool)
    blocked[40] = True
    stays = graph.weights(mesh_map.snapshot(), blocked) < np.inf
    strides = ~graph.is_edge
    starts = np.repeat(np.arange(81), np.diff(graph.moves.offsets))
    beside = (starts == 40) | (graph.moves.ends == 40) | (graph._left == 40) | (graph._right == 40)
    np.testing.assert_array_equal(stays[strides], ~beside[strides])


@given(seed=st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_a_line_over_the_ground_is_straight_from_above_and_on_the_surface(seed):
    mesh_map, rng = hilly(seed), np.random.default_rng(seed)
    start = mesh_map.locate_one([*rng.uniform(0.2, 1.8, 2), 0.1])
    end = mesh_map.vertices[rng.integers(81)]
    line = line_over_ground(mesh_map.topology, start.face, start.point, end)
    share = np.linspace(0.0, 1.0, 40)[1:-1, None]
    for begin, ahead in zip(line.points[:-1], line.points[1:], strict=True):
        samples = begin + share * (ahead - begin)
        np.testing.assert_allclose(mesh_map.locate(samples).distances, 0.0, atol=1e-9)
    np.testing.assert_allclose(line.points[-1], end, atol=1e-5)
    offsets, way = (line.points - start.point)[:, :2], (end - start.point)[:2]
    np.testing.assert_allclose(offsets[:, 0] * way[1] - offsets[:, 1] * way[0], 0.0, atol=1e-7)
    assert (np.diff(np.hypot(*offsets.T)) > 0.0).all()


def test_a_line_ends_at_a_border():
    heights = np.zeros((9, 9))
    heights[4, 4] = np.nan
    mesh_map = MeshMap.from_heights(heights, 0.3, 0.3)
    start = mesh_map.locate_one((0.31, 1.22, 0.0))
    beyond = mesh_map.vertices[np.argmin(np.linalg.norm(mesh_map.vertices - [2.1, 1.2, 0.0], axis=1))]
    assert line_over_ground(mesh_map.topology, start.face, start.point, beyond) is None


@pytest.mark.parametrize("angle", np.linspace(0.1, 6.1, 7))
def test_from_a_border_that_is_no_axis_every_corner_of_the_face_is_reached(angle):
    """Rounding puts the start on either side of the border it is projected to."""
    grid, faces = heightfield_mesh(np.zeros((4, 4)), 0.5, 0.5)
    along, inward = (
        np.array([math.cos(angle), math.sin(angle), 0.0]),
        np.array([-math.sin(angle), math.cos(angle), 0.0]),
    )
    mesh_map = MeshMap.from_arrays(grid[:, :1] * along + grid[:, 1:2] * inward, faces)
    for part in np.random.default_rng(0).uniform(0.0, 1.5, 20):
        start = on_surface(mesh_map.topology, mesh_map.locator, part * along - 0.03 * inward, 0.4)
        for corner in mesh_map.vertices[mesh_map.faces[start.face]]:
            line = line_over_ground(mesh_map.topology, start.face, start.point, corner)
            assert line is not None and (line.points[-1] == corner).all()


def test_a_path_across_the_faces_is_as_short_as_the_line(make_plugin):
    mesh_map = with_tilt(np.zeros((21, 21)), 0.2)
    ends = [min(mesh_map.vertices.tolist(), key=lambda v: math.dist(v, place)) for place in ((1, 1.8, 0), (2.6, 1, 0))]
    graph = DriveGraph(mesh_map.topology)
    steps = mesh_map.vertices[graph.moves.ends] - np.repeat(mesh_map.vertices, np.diff(graph.moves.offsets), axis=0)
    assert (np.abs(steps[:, :2] - [0.4, -0.2]).max(axis=1) < 1e-9).any(), "twice ahead and once right is a stride here"
    yaw = math.atan2(-0.8, 1.6)
    poses = [Pose.planar(x, y, yaw) for x, y, _ in ends]
    result = make_plugin(HeadingAStarPlanner, mesh_map).make_plan(PlanRequest(*poses, angle_tolerance=3.14))
    assert result.path.length == pytest.approx(math.hypot(1.6, 0.8), abs=1e-9)


def test_a_robot_in_a_rut_a_little_beside_a_vertex_drives_on(make_plugin):
    """The corners of its face lie behind it or aside, where the rut does not let it turn."""
    y = np.arange(31) * 0.2 - 3.0
    mesh_map = with_tilt(np.tile(np.abs(y)[:, None], (1, 41)), 0.2, max_roll=0.4, max_pitch_up=0.4, max_pitch_down=0.4)
    start, goal = Pose.planar(2.17, 3.03, 0.0, z=0.03), Pose.planar(5.0, 3.0, 0.0)
    planner = make_plugin(HeadingAStarPlanner, mesh_map)
    result = planner.make_plan(PlanRequest(start, goal, angle_tolerance=3.14))
    assert result.success, result.message
    assert (np.diff(result.path.positions[:, 0]) > 0.0).all()


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_a_place_of_a_face_has_the_coordinates_that_make_it(seed):
    mesh_map, rng = hilly(seed), np.random.default_rng(seed)
    face, shares = int(rng.integers(len(mesh_map.faces))), rng.dirichlet(np.ones(3))
    place = point_of_face(mesh_map, face, shares @ mesh_map.vertices[mesh_map.faces[face]])
    np.testing.assert_allclose(place.barycentric, shares, atol=1e-9)
