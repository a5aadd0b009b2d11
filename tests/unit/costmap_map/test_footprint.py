"""Footprints: radii, the true offset, turning, and the collision check as a whole."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from mbf_costmap_nav.grid.collision import footprint_costs
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap

CORNERS = st.lists(st.floats(0.0, 2 * math.pi), min_size=3, max_size=8, unique_by=lambda angle: round(angle, 1))


def convex(angles, size, stretch):
    """A convex polygon: points of an ellipse in order, nowhere nearly straight."""
    turned = np.sort(angles)
    return Footprint(size * np.column_stack([np.cos(turned), stretch * np.sin(turned)]))


def distance_to_outline(point, vertices):
    ends = np.roll(vertices, -1, axis=0)
    sides = ends - vertices
    t = np.clip(((point - vertices) * sides).sum(axis=1) / (sides**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(vertices + t[:, None] * sides - point, axis=1).min()


@given(CORNERS, st.floats(0.2, 2.0), st.floats(0.3, 1.0), st.floats(0.01, 1.0))
@settings(deadline=None)
def test_an_offset_outline_keeps_the_distance_everywhere_and_hardly_more(angles, size, stretch, distance):
    footprint = convex(angles, size, stretch)
    outline = footprint.offset(distance).vertices
    steps = np.linspace(0.0, 1.0, 7)[:-1, None]
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        for point in start + steps * (end - start):
            assert distance - 1e-8 <= distance_to_outline(point, footprint.vertices) <= 2.0 * distance + 1e-8


@pytest.mark.parametrize("distance", [-0.1, math.nan, math.inf])
def test_an_offset_that_is_negative_or_has_no_end_is_refused(distance):
    with pytest.raises(ValueError, match="must be 0 m or more and finite"):
        Footprint.circle(1.0).offset(distance)


def test_a_square_is_offset_by_moving_its_sides():
    square = Footprint([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    assert sorted(square.offset(0.5).vertices.round(9).tolist()) == [[-1.5, -1.5], [-1.5, 1.5], [1.5, -1.5], [1.5, 1.5]]


def test_a_point_robot_is_offset_to_a_circle_around_the_distance():
    assert Footprint([]).offset(0.3).inscribed_radius == pytest.approx(0.3)


def test_a_notched_footprint_is_offset_by_its_hull():
    notched = Footprint([(1, 1), (0, 0.2), (-1, 1), (-1, -1), (1, -1)])
    assert len(notched.offset(0.1).vertices) == 4


def test_a_flat_footprint_is_offset_to_a_box_and_a_spot_to_a_circle():
    flat = Footprint([(-1, 0), (0, 0), (1, 0)]).offset(0.5)
    assert sorted(flat.vertices.round(9).tolist()) == [[-1.5, -0.5], [-1.5, 0.5], [1.5, -0.5], [1.5, 0.5]]
    spot = Footprint([(2, 0)] * 3).offset(0.5)
    assert np.linalg.norm(spot.vertices - (2, 0), axis=1).min() >= 0.5


def test_no_offset_changes_nothing():
    footprint = Footprint.circle(1.0)
    assert footprint.offset(0.0) is footprint


def test_radii_are_the_nearest_side_and_the_farthest_corner():
    footprint = Footprint([(2, 1), (-1, 1), (-1, -1), (2, -1)])
    assert (footprint.inscribed_radius, footprint.circumscribed_radius) == (1.0, math.sqrt(5.0))


def test_a_quarter_turn_swaps_the_axes():
    turned = Footprint([(2, 1), (-1, 1), (-1, -1)]).at(10.0, 20.0, math.pi / 2)
    assert turned == pytest.approx(np.array([(9, 22), (9, 19), (11, 19)]))


@pytest.mark.parametrize("vertices", [[(0, 0), (1, float("nan")), (1, 1)], [(0, 0, 0)] * 3, [1, 2, 3]])
def test_vertices_that_are_no_finite_points_are_refused(vertices):
    with pytest.raises(ValueError, match="finite"):
        Footprint(vertices)


@given(st.floats(1.5, 8.5), st.floats(1.5, 8.5), st.floats(-4, 4), st.integers(0, 99), st.integers(0, 99))
@settings(deadline=None)
def test_a_pose_collides_exactly_if_the_obstacle_cell_is_within_the_turned_outline(x, y, yaw, ix, iy):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[iy, ix] = 254
    costmap, footprint = Costmap(cells, 0.1), Footprint([(1.0, 0.5), (-0.6, 0.5), (-0.6, -0.5), (1.0, -0.5)])
    # The corners of the cell in the robot's frame; separated by an axis of either shape means no contact.
    corners = np.array([(ix + a, iy + b) for a in (0, 1) for b in (0, 1)]) * 0.1
    rotation = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    cell, outline = (corners - (x, y)) @ rotation, footprint.at(x, y, yaw)
    gaps = np.concatenate(
        [
            cell.min(axis=0) - footprint.vertices.max(axis=0),
            footprint.vertices.min(axis=0) - cell.max(axis=0),
            corners.min(axis=0) - outline.max(axis=0),
            outline.min(axis=0) - corners.max(axis=0),
        ]
    )
    if abs(gaps.max()) > 1e-9:
        assert (footprint_costs(costmap, footprint, x, y, yaw).lethal > 0) == (gaps.max() < 0.0)


@pytest.mark.parametrize("gap", [0.001, 0.006, 0.02])
@pytest.mark.parametrize("yaw", [0.0, 0.1, 0.2])
def test_a_round_robot_beside_a_wall_turns_whatever_the_corners_of_its_polygon_do(gap, yaw):
    cells = np.zeros((80, 80), dtype=np.uint8)
    cells[:, 40:] = 254
    block = {"resolution": 0.05, "layers": [{"name": "walls", "type": "static"}]}
    pose = Pose.planar(2.0 - 0.2 - gap, 2.0, yaw)

    def turning(**outline):
        parameters = CostmapParameters.model_validate({**block, **outline})
        costmap = build_layered_costmap(parameters, static_map=Costmap(cells, 0.05))
        costmap.update(pose, 0.0)
        turn = Twist.planar(wz=1.0)
        return costmap.obstacle_ahead(pose, turn, 1.0) or costmap.obstacle_on_path(pose, turn, 1.0)

    assert turning(robot_radius=0.2) == ""
    assert "(" in turning(footprint="[[0.2, 0.2], [0.2, -0.2], [-0.2, -0.2], [-0.2, 0.2]]")
    assert Footprint.circle(0.3).is_circle and not Footprint.circle(0.3).padded(0.01).is_circle
