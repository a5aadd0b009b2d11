"""Turns on the spot on a mesh: the corners of a long robot count, and so does the slope, also where it creeps."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.turning import points_on

LONG = ((-0.5, -0.35), (0.5, -0.35), (0.5, 0.35), (-0.5, 0.35))
EDGE = 0.1
TURN = Twist.planar(wz=0.8)


@pytest.fixture
def beside_a_wall(paint):
    """A level plain of 6 m x 6 m; lethal from y = 3.4 on."""
    return paint(MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE), lambda v: np.where(v[:, 1] > 3.35, np.inf, 0.0))


def test_a_long_robot_does_not_turn_its_corner_into_a_wall(beside_a_wall):
    here = Pose.planar(3.0, 2.85)
    assert beside_a_wall.obstacle_ahead(here, TURN, 0.6) == "", "a disc of the inscribed radius fits"
    beside_a_wall.inscribed_radius, beside_a_wall.footprint = 0.35, LONG
    assert "would touch it at (3." in beside_a_wall.obstacle_ahead(here, TURN, 0.6)
    creeping = Twist.planar(0.1, wz=0.8)
    assert "would touch it at (3." in beside_a_wall.obstacle_ahead(here, creeping, 0.6)
    assert beside_a_wall.obstacle_ahead(Pose.planar(3.0, 2.6), TURN, 4.0) == "", "it is far enough off"


def test_a_corner_in_a_wall_may_be_turned_out_of_it_and_no_deeper(beside_a_wall):
    beside_a_wall.inscribed_radius, beside_a_wall.footprint = 0.35, LONG
    tilted = Pose.planar(3.0, 2.88, 0.3)
    assert beside_a_wall.obstacle_ahead(tilted, TURN, 0.4)
    assert beside_a_wall.obstacle_ahead(tilted, Twist.planar(wz=-0.8), 0.35) == ""


def test_no_corner_is_turned_over_the_border(beside_a_wall):
    beside_a_wall.inscribed_radius, beside_a_wall.footprint = 0.35, LONG
    assert "would touch it" in beside_a_wall.obstacle_ahead(Pose.planar(0.4, 1.5, 0.5 * math.pi), TURN, 0.6)


def test_on_a_path_corners_may_be_turned_over_a_free_border_but_not_over_a_lethal_one(paint):
    here = Pose.planar(0.4, 1.5, 0.5 * math.pi)
    for cost, refused in ((0.0, False), (np.inf, True)):
        rim = paint(
            MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE), lambda v, c=cost: np.where(v[:, 0] < 0.05, c, 0)
        )
        rim.inscribed_radius, rim.footprint = 0.35, LONG
        assert "would touch it" in rim.obstacle_ahead(here, TURN, 0.6)
        assert bool(rim.obstacle_on_path(here, TURN, 0.6)) == refused


@given(
    st.floats(1.0, 5.0),
    st.floats(1.0, 5.0),
    st.floats(-3.0, 3.0),
    st.sampled_from([-0.8, 0.5, 1.2]),
    st.integers(0, 99),
)
@settings(max_examples=25, deadline=None)
def test_what_a_turn_sweeps_is_that_of_a_naive_twin_on_level_ground(paint, x, y, yaw, wz, seed):
    """The twin turns points in the plane and looks for the nearest vertex of all."""
    posts = np.random.default_rng(seed).uniform(0.8, 5.2, (25, 2))
    near = lambda v: np.hypot(*(v[:, None, :2] - posts[None]).transpose(2, 0, 1)).min(axis=1) < 0.09  # noqa: E731
    plain = paint(MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE), lambda v: np.where(near(v), np.inf, 0.0))
    plain.footprint, outline = LONG, points_on(LONG)
    lethal = np.isposinf(plain.snapshot().costs) | plain.snapshot().lethal

    def touches(angle):
        c, s = math.cos(angle), math.sin(angle)
        places = outline @ np.array([[c, s], [-s, c]]) + (x, y)
        away = np.hypot(*(places[:, None] - plain.vertices[None, :, :2]).transpose(2, 0, 1))
        return int(lethal[away.argmin(axis=1)].sum())

    steps = math.ceil(abs(wz) * 0.6 * math.hypot(0.5, 0.35) / 0.05)
    counts = [touches(yaw + wz * 0.6 * step / steps) for step in range(steps + 1)]
    found = plain.obstacle_ahead(Pose.planar(x, y, yaw), Twist.planar(wz=wz), 0.6)
    if "stands on an obstacle" not in found:
        assert bool(found) == (max(counts) > counts[0])


@pytest.mark.parametrize(("vx", "refused"), [(0.0, True), (0.1, True), (0.2, True), (0.6, False)])
def test_a_turn_that_creeps_is_a_turn_on_the_spot_on_steep_ground(vx, refused):
    steep = MeshMap.from_heights(np.tile(0.05 * np.arange(61), (61, 1)), EDGE, EDGE)  # 0.46 rad
    steep.inscribed_radius = 0.3
    found = steep.obstacle_ahead(
        Pose((3.0, 3.0, 1.5), Pose.planar(0.0, 0.0).orientation), Twist.planar(vx, wz=0.8), 0.5
    )
    assert ("the ground slopes 0.46 rad" in found) == refused
    assert refused or found == ""


def test_the_guard_sees_the_corners(beside_a_wall):
    beside_a_wall.inscribed_radius = 0.35
    assert beside_a_wall.robot_box == RobotBox.disc(0.35)
    beside_a_wall.footprint = LONG
    assert beside_a_wall.robot_box == RobotBox(-0.5, 0.5, -0.35, 0.35, 0.0)


@pytest.mark.parametrize("corners", [[[1.0, 0.0], [0.0, 1.0]], [[0.1, 0.0], [1.0, 0.0], [1.0, 1.0]], [[1.0, 2.0, 3.0]]])
def test_a_footprint_is_an_outline_around_the_robot(corners):
    with pytest.raises(ValidationError, match="footprint"):
        MeshMapParameters(footprint=corners)
