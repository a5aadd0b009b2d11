"""Slopes, ramps, masses and outlines agree with a naive twin each."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry.polygon import inside_polygon
from terrain.description.masses import is_possible_inertia, mass_of
from terrain.description.outline import as_array, convex_outline, with_few_corners
from terrain.description.solids import Box, Cylinder, Hull, Placed, Sphere, points_between
from terrain.description.stability import clear_angles, tipping
from terrain.description.urdf import Inertial, link_frames, transform_of
from terrain.description.urdf_reader import read_urdf

COORDINATE = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=3, max_size=12)
ANGLE = st.floats(-3.0, 3.0)


def stands(polygon, centre, directions, slope):
    """Whether the vertical through the centre of mass meets the polygon, tilted downwards along each direction."""
    shift = centre[2] * math.tan(slope)
    return inside_polygon(np.array(centre[:2]) + shift * np.array(directions), polygon)


AXES = {"forward": (1.0, 0.0), "backward": (-1.0, 0.0), "left": (0.0, 1.0), "right": (0.0, -1.0)}
AROUND = [(math.cos(a), math.sin(a)) for a in np.linspace(0.0, 2.0 * math.pi, 720)]


@settings(deadline=None, max_examples=40)
@given(POINTS, st.floats(0.05, 2.0))
def test_a_robot_stands_up_to_the_slope_at_which_it_tips_over_and_no_farther(points, height):
    polygon = as_array(convex_outline(np.array(points)))
    if len(polygon) < 3 or np.ptp(polygon, axis=0).min() < 0.1:
        return
    centre = (*polygon.mean(axis=0).tolist(), height)
    found = tipping(np.array(points), centre)
    for name, direction in AXES.items():
        slope = getattr(found, name)
        assert stands(polygon, centre, [direction], slope - 1e-3)
        assert not stands(polygon, centre, [direction], slope + 1e-3)
    if found.least > 0.02:
        assert stands(polygon, centre, AROUND, found.least - 1e-3).all()
        assert not stands(polygon, centre, AROUND, found.least + 1e-3).all()


def lies_below(x, z, wheel, angle, side):
    """Whether a point lies below the plane that touches a wheel at the origin and rises to ``side`` at ``angle``."""
    ahead = side * (x - wheel[0])
    return (z - wheel[1]) * math.cos(angle) - ahead * math.sin(angle) < -wheel[1] - 1e-9


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.01, 1.0)), min_size=3, max_size=8), st.floats(0.05, 0.5))
def test_the_approach_angle_is_the_steepest_at_which_no_point_lies_below_the_ramp(points, radius):
    part = convex_outline(np.array(points))
    if len(part) < 3:
        return
    wheel = (0.5, radius)
    ahead = [(x, z) for x, z in part if x > wheel[0]]
    found = clear_angles([part], wheel, (-1.0, radius)).approach
    assert not any(lies_below(x, z, wheel, found - 1e-3, 1.0) for x, z in ahead)
    assert found == math.pi / 2 or any(lies_below(x, z, wheel, found + 1e-3, 1.0) for x, z in ahead)


@settings(deadline=None, max_examples=40)
@given(POINTS, st.integers(4, 8))
def test_a_polygon_of_few_corners_is_convex_and_holds_the_outline(points, most):
    outline = convex_outline(np.array(points))
    if len(outline) < 3:
        return
    few = with_few_corners(outline, most)
    assert len(few) <= len(outline)
    for a, b in zip(few, [*few[1:], few[0]], strict=True):
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        for x, y in outline:
            assert ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / length >= -1e-5


SOLIDS = [Box((0.3, 0.2, 0.5)), Cylinder(0.2, 0.4), Sphere(0.25)]


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(SOLIDS), st.tuples(ANGLE, ANGLE, ANGLE), st.tuples(COORDINATE, COORDINATE, COORDINATE), ANGLE)
def test_the_hull_of_a_solid_holds_it_and_is_hardly_larger(solid, rpy, xyz, heading):
    placed = Placed(solid, transform_of(xyz, rpy))
    direction = np.array([math.cos(heading), math.sin(heading), 0.0])
    farthest = float((placed.points() * direction).sum(axis=1).max())
    assert -1e-9 <= farthest - placed.support(direction) + (1e-2 if isinstance(solid, Sphere) else 0.0)
    assert farthest - placed.support(direction) < 0.005


@settings(deadline=None, max_examples=30)
@given(st.tuples(ANGLE, ANGLE, ANGLE), st.floats(-0.2, 0.0), st.floats(0.01, 0.2))
def test_a_slice_of_a_box_holds_just_the_points_between_its_heights(rpy, low, high):
    box = Placed(Box((0.6, 0.4, 0.5)), transform_of((0.0, 0.0, 0.0), rpy))
    part = points_between(box.points(), low, high)
    assert part[:, 2].min() >= low - 1e-9 and part[:, 2].max() <= high + 1e-9
    rng = np.random.default_rng(0)
    inside = (rng.uniform(-0.5, 0.5, (400, 3)) * np.array([0.6, 0.4, 0.5])) @ box.T_frame_solid[:3, :3].T
    inside = inside[(inside[:, 2] >= low) & (inside[:, 2] <= high)]
    outline = as_array(convex_outline(part))
    grown = outline.mean(axis=0) + (outline - outline.mean(axis=0)) * (1.0 + 1e-6)
    assert inside_polygon(inside, grown).all()


def hull_of(points):
    hull = trimesh.convex.convex_hull(points)
    return Placed(Hull(Path("hull.stl"), np.array(hull.vertices), np.array(hull.faces, dtype=np.int32)), np.eye(4))


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.floats(-0.3, 0.3), st.floats(0.01, 0.4), ANGLE)
def test_a_slice_of_a_hull_reaches_as_far_as_that_of_all_pairs_of_its_corners(seed, low, thickness, heading):
    hull = hull_of(np.random.default_rng(seed).normal(size=(20, 3)))
    direction = np.array([math.cos(heading), math.sin(heading), 0.0])
    part, naive = hull.points_between(low, low + thickness), points_between(hull.points(), low, low + thickness)
    reaches = [(points * direction).sum(axis=1).max() for points in (part, naive)]
    assert reaches[0] == pytest.approx(reaches[1], abs=1e-9)


def test_a_slice_of_a_large_hull_has_no_more_points_than_its_corners_and_edges():
    points = np.random.default_rng(0).normal(size=(600, 3))
    hull = hull_of(points / np.sqrt((points * points).sum(axis=1))[:, None])
    assert len(hull.points_between(-0.1, 0.1)) < 600 + 2 * 3 * 600


def moments_of(second_moments, products):
    """Moments of inertia of second moments of mass; each is the sum of the two along the other axes."""
    a, b, c = second_moments
    return (b + c, a + c, a + b, *products)


@settings(deadline=None, max_examples=80)
@given(
    st.builds(moments_of, st.tuples(*[st.floats(-0.1, 1.0)] * 3), st.tuples(*[st.floats(-0.7, 0.7)] * 3)),
)
@example((1.0, 1.0, 1.0, 0.27, 0.27, 0.27))
@example((2.0, 2.0, 2.0, 0.55, 0.55, 0.55))
@example((2.0, 2.0, 2.0, 0.55, -0.55, -0.55))
@example((2.0, 2.0, 2.0, -0.55, -0.55, -0.55))
def test_moments_are_possible_if_and_only_if_no_second_moment_is_negative(moments):
    ixx, iyy, izz, ixy, ixz, iyz = moments
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    least = float(np.linalg.eigvalsh(0.5 * np.trace(matrix) * np.eye(3) - matrix).min())
    slack = 1e-3 * 0.5 * float(np.trace(matrix))
    possible = is_possible_inertia(Inertial(1.0, np.eye(4), moments, 1))
    # nearer to zero, minors are as small as their rounding
    assert abs(least + slack) <= 1e-3 or possible == (least + slack > 0.0)


def test_the_inertia_of_a_turned_link_is_turned_with_it(tmp_path):
    moments = 'ixx="2" iyy="3" izz="4" ixy="0.1" ixz="0.2" iyz="-0.3"'
    inertial = f'<inertial><origin rpy="0.3 -0.7 1.1"/><mass value="2"/><inertia {moments}/></inertial>'
    file = tmp_path / "turned.urdf"
    file.write_text(f'<robot name="turned"><link name="body">{inertial}</link></robot>')
    urdf = read_urdf(file)
    rotation = transform_of((0.0, 0.0, 0.0), (0.3, -0.7, 1.1))[:3, :3]
    inertia = np.array([[2.0, 0.1, 0.2], [0.1, 3.0, -0.3], [0.2, -0.3, 4.0]])
    assert np.allclose(mass_of(urdf, link_frames(urdf), urdf.links).inertia, rotation @ inertia @ rotation.T)
