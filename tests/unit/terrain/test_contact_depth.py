"""How deep outlines lie in each other, against a search over all directions for the least move that frees them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrain.physics.contact_depth import depth_in_cells, depth_in_circle, depth_in_polygon, placed

CAR = np.array([[-0.17, -0.29], [0.75, -0.29], [0.75, 0.29], [-0.17, 0.29]])
BOX = np.array([[-0.4, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.4, 0.2]])
UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

coordinate = st.floats(-1.5, 1.5)
angle = st.floats(-math.pi, math.pi)


def least_escape(corners, other, directions=1440):
    """The naive twin: over all directions, how far one shape must move that way to leave the other."""
    angles = np.linspace(0.0, 2.0 * math.pi, directions, endpoint=False)
    depths = [
        max((corners * (math.cos(a), math.sin(a))).sum(axis=1)) - min((other * (math.cos(a), math.sin(a))).sum(axis=1))
        for a in angles
    ]
    return max(0.0, min(depths))


def circle(x, y, radius):
    angles = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


@settings(max_examples=60, deadline=None)
@given(x=coordinate, y=coordinate, yaw=angle, turned=angle)
def test_the_depth_in_a_box_is_the_least_move_that_frees_the_outline(x, y, yaw, turned):
    ours, theirs = placed(CAR, x, y, yaw), placed(BOX, 0.2, -0.1, turned)
    assert max(0.0, depth_in_polygon(ours, theirs)) == pytest.approx(least_escape(ours, theirs), abs=0.01)


@settings(max_examples=60, deadline=None)
@given(x=coordinate, y=coordinate, yaw=angle, radius=st.floats(0.05, 0.8))
def test_the_depth_in_a_circle_is_the_least_move_that_frees_the_outline(x, y, yaw, radius):
    ours = placed(CAR, x, y, yaw)
    depth = max(0.0, depth_in_circle(ours, 0.3, 0.1, radius))
    assert depth == pytest.approx(least_escape(ours, circle(0.3, 0.1, radius)), abs=0.01)


@settings(max_examples=40, deadline=None)
@given(x=coordinate, y=coordinate, yaw=angle, seed=st.integers(0, 1000))
def test_the_depth_in_cells_is_the_deepest_of_all_cells(x, y, yaw, seed):
    occupied = np.random.default_rng(seed).uniform(size=(12, 16)) < 0.1
    origin, ours = np.array([-1.6, -1.2]), placed(CAR, x, y, yaw)
    cells = [placed(0.2 * UNIT, *(origin + 0.2 * np.array([ix, iy])), 0.0) for iy, ix in np.argwhere(occupied)]
    deepest = max(0.0, *(depth_in_polygon(ours, cell) for cell in cells))
    assert max(0.0, depth_in_cells(ours, occupied, 0.2, origin)) == pytest.approx(deepest, abs=1e-12)


def test_an_outline_off_the_map_touches_no_cell():
    full = np.ones((5, 5), dtype=bool)
    assert depth_in_cells(placed(CAR, 9.0, 9.0, 0.3), full, 0.2, np.zeros(2)) == -math.inf
    assert depth_in_cells(placed(CAR, -0.76, 0.5, 0.0), full, 0.2, np.zeros(2)) == pytest.approx(-0.01)
    assert depth_in_cells(placed(CAR, -0.74, 0.5, 0.0), full, 0.2, np.zeros(2)) == pytest.approx(0.01)
