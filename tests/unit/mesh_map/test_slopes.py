"""Angles from normals against the formulas written out."""

import math

import numpy as np
import pytest

from mbf_mesh_nav.kernels.compiled import kernel
from mbf_mesh_nav.kernels.mesh.slopes import arc_cosine, inclinations, tilt_of_normals

HEADINGS = np.arange(16) * 2.0 * math.pi / 16


def unit_normals(count=40):
    normals = np.random.default_rng(0).normal(size=(count, 3))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_inclination_is_the_angle_to_the_vertical_from_level_to_upside_down():
    extremes = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0 + 1e-15]])
    normals = np.concatenate([extremes, unit_normals()])
    expected = [math.acos(min(max(z, -1.0), 1.0)) for z in normals[:, 2].tolist()]
    assert inclinations(np.ascontiguousarray(normals[:, 2])).tolist() == np.float32(expected).tolist()


def test_arc_cosines_are_those_of_the_c_library_to_one_unit_in_the_last_place():
    random = np.random.default_rng(1)
    near_one = 1.0 - 10.0 ** random.uniform(-16.0, 0.0, 20_000)
    between = random.uniform(-1.0, 1.0, 20_000)
    cosines = np.concatenate([[-1.0, -0.5, -0.0, 0.0, 0.5, 1.0], near_one, -near_one, between])
    expected = np.array([math.acos(cosine) for cosine in cosines.tolist()])
    found = arc_cosines(cosines)
    assert np.all(np.abs(found - expected) <= np.spacing(expected))
    assert np.float32(found).tolist() == np.float32(expected).tolist()


@kernel
def arc_cosines(cosines):
    angles = np.empty(len(cosines), dtype=np.float64)
    for place in range(len(cosines)):
        angles[place] = arc_cosine(cosines[place])
    return angles


def test_roll_and_pitch_are_those_of_a_robot_on_the_tangent_plane():
    normals = unit_normals()
    allowed, roll = tilt_of_normals(normals, HEADINGS, 0.5, 0.7)
    for vertex, (x, y, z) in enumerate(normals.tolist()):
        for heading, angle in enumerate(HEADINGS.tolist()):
            pitch_here = math.atan2(-(x * math.cos(angle) + y * math.sin(angle)), z)
            roll_here = math.atan2(-(y * math.cos(angle) - x * math.sin(angle)), z)
            assert roll[vertex, heading] == pytest.approx(roll_here, abs=1e-6)
            assert allowed[vertex, heading] == (abs(roll_here) <= 0.5 and abs(pitch_here) <= 0.7)


def test_a_slope_that_falls_to_the_right_lifts_the_left_side():
    right = np.array(
        [[0.0, -math.sin(0.2), math.cos(0.2)]]
    )  # the normal leans to the right of a robot that looks along x
    assert tilt_of_normals(right, HEADINGS[:1], 1.0, 1.0)[1][0, 0] == pytest.approx(0.2)
