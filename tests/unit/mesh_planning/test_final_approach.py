"""The curve on which a car comes in along the heading of the goal."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.search.final_approach import dubins_curve, with_final_approach, with_first_turn

PLACES = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))


@given(start=PLACES, radius=st.floats(0.3, 1.5))
@settings(max_examples=80, deadline=None)
def test_the_curve_leads_to_the_origin_along_x_and_never_turns_tighter_than_the_radius(start, radius):
    curve = np.concatenate([dubins_curve(start, radius, 0.01), [[0.0, 0.0]]])
    steps = np.diff(curve, axis=0)
    assert np.linalg.norm(steps, axis=1).max() < 0.02
    if len(curve) > 3:
        headings = np.unwrap(np.arctan2(steps[:-1, 1], steps[:-1, 0]))
        assert abs(math.remainder(headings[-1], math.tau)) < 0.02 / radius + 1e-6
        assert abs(math.remainder(headings[0] - start[2], math.tau)) < 0.02 / radius + 1e-6
        assert np.abs(np.diff(headings)).max() <= 0.01 / radius + 1e-6


def straight_path(heading):
    points = [(x, 2.5, 0.0) for x in np.linspace(0.8, 4.4, 37)]
    return Path.from_points(points, Pose.planar(4.4, 2.5, heading).orientation)


def test_the_path_keeps_its_beginning_and_its_last_pose(plain):
    mesh_map = plain()
    path = straight_path(math.pi / 2)
    bent = with_final_approach(path, mesh_map, mesh_map.snapshot().lethal, 0.7)
    np.testing.assert_allclose(bent.positions[0], path.positions[0])
    assert bent.positions[-1].tolist() == path.positions[-1].tolist()
    last = bent.positions[-2] - bent.positions[-5]
    assert math.atan2(last[1], last[0]) > math.pi / 2 - 0.3


def test_a_path_that_arrives_with_the_heading_is_left_alone(plain):
    mesh_map = plain()
    path = straight_path(0.1)
    assert with_final_approach(path, mesh_map, mesh_map.snapshot().lethal, 0.7) is path


def test_a_curve_that_does_not_fit_between_walls_is_not_taken(plain, paint):
    corridor = paint(plain(), lambda v: np.where(abs(v[:, 1] - 2.5) > 0.45, np.inf, 0.0))
    path = straight_path(math.pi / 2)
    blocked = corridor.snapshot().lethal
    assert with_final_approach(path, corridor, blocked, 0.7) is path
    assert with_final_approach(path, corridor, np.zeros_like(blocked), 0.7) is not path


def test_a_curve_leads_neither_past_the_border_nor_across_a_hole():
    heights = np.zeros((31, 31))
    heights[8:23, 22:28] = np.nan
    for ground, goal_x in ((MeshMap.from_heights(np.zeros((31, 31)), 0.2, 0.2), 5.6), (_over_a_floor(heights), 4.1)):
        points = [(x, 3.0, 0.0) for x in np.linspace(1.0, goal_x, 40)]
        path = Path.from_points(points, Pose.planar(0.0, 0.0, math.pi).orientation)
        bent = with_final_approach(path, ground, ground.snapshot().lethal, 0.7)
        spots = ground.locate(bent.positions)
        assert np.linalg.norm(np.diff(bent.positions, axis=0), axis=1).max() < 0.35
        assert not ground.topology.border_vertices[ground.faces[spots.faces]].all(axis=1).any()
        assert np.abs(bent.positions[:, 2]).max() < 1e-9


def _over_a_floor(heights):
    """A surface with 0.2 m between its samples, and 0.5 m below it another one without holes."""
    vertices, faces = heightfield_mesh(heights, 0.2, 0.2)
    below, below_faces = heightfield_mesh(np.full(heights.shape, -0.5), 0.2, 0.2)
    return MeshMap.from_arrays(np.vstack([vertices, below]), np.vstack([faces, below_faces + len(vertices)]))


def test_a_path_that_begins_behind_the_car_is_joined_on_a_curve_and_keeps_its_end(plain):
    mesh_map = plain()
    path, car = straight_path(0.0), Pose.planar(0.8, 2.5, 2.8)
    bent = with_first_turn(path, mesh_map, mesh_map.snapshot().lethal, 0.7, car)
    first = bent.positions[3] - bent.positions[0]
    assert np.allclose(bent.positions[0], car.position)
    assert abs(math.remainder(math.atan2(first[1], first[0]) - 2.8, math.tau)) < 0.3
    np.testing.assert_allclose(bent.positions[-1], path.positions[-1], atol=1e-9)
    assert bent.orientations[-1].tolist() == path.orientations[-1].tolist()


def test_a_path_that_leads_ahead_of_the_car_begins_as_it_is(plain):
    mesh_map = plain()
    path = straight_path(0.0)
    assert with_first_turn(path, mesh_map, mesh_map.snapshot().lethal, 0.7, Pose.planar(0.8, 2.5, 0.9)) is path
