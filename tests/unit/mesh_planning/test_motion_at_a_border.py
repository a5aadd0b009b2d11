"""Motions of a robot on a mesh where the surface ends: what follows a path may reach over it, all else may not."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.queries import AS_CONFIGURED, CellState
from mbf_mesh_nav.map.mesh_map import MeshMap

EDGE, SIDE = 0.1, 6.0
FORWARD = Twist.planar(0.5)


@pytest.fixture
def plain():
    """A level plain of 6 m x 6 m without layers, for a disc of 0.25 m."""
    mesh_map = MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE)
    mesh_map.inscribed_radius = 0.25
    return mesh_map


def test_a_robot_that_follows_a_path_reaches_over_the_border_with_all_but_its_centre(plain):
    there = Pose.planar(3.0, 5.4, 0.5 * math.pi)
    assert "the surface ends at (3.00, 6.00" in plain.obstacle_ahead(there, FORWARD, 1.0)
    assert plain.obstacle_on_path(there, FORWARD, 1.0) == ""
    assert "the surface ends at (3.00, 6.00" in plain.obstacle_on_path(there, FORWARD, 1.4), "10 cm past it"


@pytest.mark.parametrize(
    ("yaw", "wz", "refused"), [(0.08, 0.0, False), (0.15, 0.0, True), (0.3, -1.2, False), (0.3, 0.0, True)]
)
def test_along_the_border_a_centre_may_pass_it_by_the_width_of_a_wheel(plain, yaw, wz, refused):
    on_border = Pose.planar(3.0, SIDE, yaw)
    assert bool(plain.obstacle_on_path(on_border, Twist.planar(0.5, wz=wz), 1.0)) == refused


def test_a_lethal_border_is_an_obstacle_for_the_outline(plain, paint):
    paint(plain, lambda v: np.where(v[:, 1] > SIDE - 0.05, np.inf, 0.0))
    there = Pose.planar(3.0, 5.4, 0.5 * math.pi)
    assert "would touch it" in plain.obstacle_on_path(there, FORWARD, 1.0)


def test_a_path_leads_as_near_to_a_wall_as_its_inflation_lets_the_centre(plain, paint):
    paint(plain, lambda v: np.where(v[:, 1] > 5.05, np.inf, np.where(v[:, 1] > 4.85, 1.0, 0.0)))
    there, near = Pose.planar(3.0, 4.2, 0.5 * math.pi), Pose.planar(3.0, 4.6, 0.5 * math.pi)
    assert "would touch it" in plain.obstacle_ahead(there, FORWARD, 1.0), "the inflation, a radius ahead"
    assert plain.obstacle_on_path(there, FORWARD, 1.0) == ""
    assert "would touch it" in plain.obstacle_on_path(near, FORWARD, 1.0), "its centre may not come onto it"


def test_on_a_slope_the_border_is_where_it_is_on_level_ground():
    slope = MeshMap.from_heights(np.tile(0.5 * EDGE * np.arange(61)[:, None], (1, 61)), EDGE, EDGE)
    slope.inscribed_radius = 0.25
    there = slope.locate_one((0.0, 3.0, 1.5)).point
    uphill = Pose(tuple(there.tolist()), Pose.planar(0.0, 0.0, 0.5 * math.pi + 0.05).orientation)
    assert slope.obstacle_ahead(uphill, FORWARD, 1.0)
    assert slope.obstacle_on_path(uphill, FORWARD, 1.0) == ""


@pytest.mark.parametrize(("off", "touches"), [(0.02, False), (-0.02, True)])
def test_what_lies_ahead_is_touched_where_the_vertex_itself_is_within_the_radius(plain, paint, off, touches):
    paint(plain, lambda v: np.where((abs(v[:, 0] - 3.0) < 0.01) & (abs(v[:, 1] - 5.0) < 0.01), np.inf, 0.0))
    there = Pose.planar(3.0, 4.5 - off, 0.5 * math.pi)
    assert bool(plain.obstacle_on_path(there, FORWARD, 0.5)) == touches, "its ground begins half an edge before it"


def test_on_its_path_a_robot_fits_where_planners_let_its_centre(plain, paint):
    paint(plain, lambda v: np.where(v[:, 1] > 5.05, np.inf, np.where(v[:, 1] > 4.85, 1.0, 0.0)))
    check = plain.path_check(AS_CONFIGURED)
    states = [check(Pose.planar(3.0, y)).state for y in (4.5, 4.83, 4.87, 5.2, 7.0)]
    assert states == [CellState.FREE, CellState.FREE, CellState.LETHAL, CellState.LETHAL, CellState.OUTSIDE]


@pytest.mark.parametrize(
    ("y", "yaw", "wz", "duration", "refused"),
    [
        (5.01, 0.5 * math.pi, -5.0, 0.1 * math.pi, False),  # straight on, its ground would begin 3 cm ahead
        (5.01, 0.5 * math.pi, 5.0, 0.1 * math.pi, False),
        (5.03, 0.0, 5.0, 0.2 * math.pi, True),  # straight on, it would never come there
        (5.03, 0.0, -5.0, 0.2 * math.pi, False),
        (5.01, 0.5 * math.pi, 0.0, 0.1, False),  # it drives 1 cm
        (5.01, 0.5 * math.pi, 0.0, 0.5, True),
    ],
)
def test_a_centre_is_looked_at_where_its_motion_leads(plain, paint, y, yaw, wz, duration, refused):
    paint(plain, lambda v: np.where(v[:, 1] > 5.05, 1.0, 0.0))
    there = Pose.planar(3.0, y, yaw)
    assert bool(plain.obstacle_on_path(there, Twist.planar(0.1, wz=wz), duration)) == refused
