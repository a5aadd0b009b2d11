"""How deep an outline lies in what it touches: the kernel against its definition, and along motions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_costmap_nav.grid.contact import first_deeper_pose, first_refused
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.grid.motion_check import obstacle_ahead
from mbf_costmap_nav.kernels.map.penetration import UNTOUCHED, depths_in, first_deeper
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon

BOX = np.array([[4.0, 3.0], [9.0, 3.0], [9.0, 7.0], [4.0, 7.0]])
RESOLUTION = 0.05


def naive(things, corners):
    """Depth in each thing, by many points on the sides."""
    depths = np.full(things.max() + 1, UNTOUCHED)
    x0, y0, mask = rasterise_polygon(corners, (0, 0, things.shape[1], things.shape[0]))
    below = things[y0:, x0:][: mask.shape[0], : mask.shape[1]]
    for row, column in np.argwhere((mask > 0) & (below > 0)) + np.array([y0, x0]):
        centre, ends = np.array([column + 0.5, row + 0.5]), np.roll(corners, -1, axis=0)
        shares = np.linspace(0.0, 1.0, 2001)[:, None]
        gap = min(np.hypot(*(a + shares * (b - a) - centre).T).min() for a, b in zip(corners, ends, strict=True))
        depth, number = gap if inside_polygon(centre[None], corners)[0] else -gap, things[row, column]
        depths[number] = max(depths[number], depth)
    return depths


def turned(yaw, x, y):
    middle = np.array([6.5, 5.0])
    return (BOX - middle) @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + middle + (x, y)


@given(seed=st.integers(0, 10**6), yaw=st.floats(-3.0, 3.0), x=st.floats(-2.0, 3.0), y=st.floats(-2.0, 3.0))
@settings(max_examples=30, deadline=None)
def test_it_is_the_distance_from_the_nearest_side_of_the_deepest_touched_centre(seed, yaw, x, y):
    rng = np.random.default_rng(seed)
    things = np.where(rng.random((12, 14)) < 0.1, rng.integers(1, 4, (12, 14)), 0).astype(np.int32)
    things[0, 0], corners = 3, turned(yaw, x, y)
    np.testing.assert_allclose(depths_in(things, corners, np.full(4, UNTOUCHED)), naive(things, corners), atol=1e-3)


@given(seed=st.integers(0, 10**6), vx=st.floats(-0.4, 0.4), vy=st.floats(-0.4, 0.4), wz=st.floats(-0.05, 0.05))
@settings(max_examples=30, deadline=None)
def test_the_first_outline_that_lies_deeper_in_a_thing_or_in_another_one(seed, vx, vy, wz):
    rng = np.random.default_rng(seed)
    things = np.where(rng.random((16, 18)) < 0.08, rng.integers(1, 4, (16, 18)), 0).astype(np.int32)
    things[0, 0] = 3
    outlines = np.array([turned(wz * k, vx * k, vy * k) for k in range(12)])
    limits, expected = naive(things, outlines[0]), len(outlines)
    for k, outline in enumerate(outlines):
        depths = naive(things, outline)
        if (depths > limits + 0.1 + 1e-3).any():
            expected = k
            break
        limits = np.where(depths == UNTOUCHED, UNTOUCHED, limits)
    first, deepest = first_deeper(things, outlines, 0.1)
    assert abs(first - expected) <= 1, "within the accuracy of the definition"
    np.testing.assert_allclose(
        deepest[: first + 1], [naive(things, one).max() for one in outlines[: first + 1]], atol=1e-3
    )


def test_a_pole_gets_deeper_until_it_is_in_the_middle():
    things = np.zeros((12, 30), dtype=np.int32)
    things[4, 20] = 1
    none = np.full(2, UNTOUCHED)
    depths = [depths_in(things, BOX + np.array([step, 0.0]), none)[1] for step in (9.0, 11.0, 11.5, 12.0, 12.5, 14.0)]
    assert depths == [UNTOUCHED, -0.5, 0.0, 0.5, 1.0, 1.5]
    assert depths_in(things, np.array([[20.5, 4.5]]), none)[1] == 0.0, "a point robot on it"
    assert depths_in(things, np.array([[20.0, 4.5]]), none)[1] == -0.5


# ------------------------------------------------------------------------------------------------ along motions
ROUND = Footprint.circle(0.2)


def map_of(*boxes):
    """3 m x 3 m with lethal boxes (x0, y0, x1, y1) [m]."""
    cells = np.zeros((60, 60), dtype=np.uint8)
    for box in boxes:
        x0, y0, x1, y1 = (round(one / RESOLUTION) for one in box)
        cells[y0:y1, x0:x1] = 254
    return Costmap(cells, RESOLUTION, 0.0, 0.0)


PILLAR = (1.0, 1.0, 1.8, 1.5)
BESIDE_ITS_CORNER = Pose.planar(1.74, 1.66, -0.3)
"""The robot was pushed into the upper face by 4 cm, so near to its right end that it touches fewer cells of it."""


def test_a_robot_beside_a_corner_backs_away_along_the_face_although_it_touches_more_cells():
    costmap, back = map_of(PILLAR), Twist.planar(-0.1)
    assert obstacle_ahead(costmap, ROUND, BESIDE_ITS_CORNER, back, 0.6) == ""
    bump = map_of(PILLAR, (1.35, 1.5, 1.55, 1.55))  # a cell that a lidar has marked before the face
    assert obstacle_ahead(bump, ROUND, BESIDE_ITS_CORNER, back, 0.6) == "", "what adjoins is the same thing"


@pytest.mark.parametrize("beside", [(1.45, 1.6, 1.5, 1.65), (0.9, 1.7, 1.5, 1.75)], ids=["a pole", "another wall"])
def test_it_touches_nothing_else_on_its_way_out_however_deep_it_is(beside):
    costmap, deep = map_of(PILLAR, beside), Pose.planar(1.74, 1.6, -0.37)
    assert obstacle_ahead(map_of(PILLAR), ROUND, deep, Twist.planar(-0.1), 3.0) == ""
    assert "the robot would touch it at (1." in obstacle_ahead(costmap, ROUND, deep, Twist.planar(-0.1), 3.0)
    poses = np.array([[deep.x - 0.01 * k, deep.y + 0.0037 * k, deep.yaw] for k in range(1, 30)])
    check = FootprintCheck(ROUND, RESOLUTION)
    assert first_refused(map_of(PILLAR), check, deep, poses) == -1, "controllers, too"
    assert first_refused(costmap, check, deep, poses) > 0


def test_it_may_move_along_the_face_but_not_into_it_nor_back_to_what_it_has_left():
    costmap, here = map_of(PILLAR), Pose.planar(1.25, 1.68)
    along, into = Twist.planar(-0.1), Twist.planar(-0.1, -0.05)
    assert obstacle_ahead(costmap, ROUND, here, along, 1.0) == ""
    assert obstacle_ahead(costmap, ROUND, here, into, 1.0) != ""
    away_and_back = np.array([[1.25, y, 0.0] for y in (1.69, 1.7, 1.72, 1.74, 1.72, 1.7, 1.69)])
    assert first_deeper_pose(costmap, ROUND, here, away_and_back)[0] in (5, 6)


def test_off_the_map_the_border_is_a_thing_where_it_counts():
    here, poses = Pose.planar(0.15, 1.5), np.array([[0.15 - 0.02 * k, 1.5, 0.0] for k in range(1, 8)])
    assert first_deeper_pose(map_of(), ROUND, here, poses, counts_border=True)[0] == 0
    assert (
        first_deeper_pose(map_of(), ROUND, here, poses[:, :] * [-1.0, 1.0, 1.0] + [0.3, 0.0, 0.0], counts_border=True)[
            0
        ]
        == -1
    )
    assert first_deeper_pose(map_of(), ROUND, Pose.planar(-5.0, 1.5), poses - [5.15, 0.0, 0.0])[0] == -1, "far off"
