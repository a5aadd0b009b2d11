"""Arithmetic with the same bytes on every CPU equals the ordinary one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mbf_abstract.geometry import arithmetic, quaternion_from_yaw, rotation_matrix

VECTORS = arrays(np.float64, (7, 3), elements=st.floats(-1e3, 1e3))


@given(VECTORS, VECTORS)
def test_scalar_products_and_norms_are_sums_from_the_first_component_on(a, b):
    expected = [u[0] * v[0] + u[1] * v[1] + u[2] * v[2] for u, v in zip(a.tolist(), b.tolist(), strict=True)]
    assert arithmetic.scalar_products(a, b).tolist() == expected
    assert [float(arithmetic.scalar_products(u, v)) for u, v in zip(a, b, strict=True)] == expected
    assert arithmetic.norm(a).tolist() == [math.sqrt(x * x + y * y + z * z) for x, y, z in a.tolist()]


@given(VECTORS, VECTORS)
def test_turning_and_crossing_add_in_written_order_for_one_vector_and_for_many(rows, vectors):
    turn = rows[:3]
    expected = [[r[0] * v[0] + r[1] * v[1] + r[2] * v[2] for r in turn.tolist()] for v in vectors.tolist()]
    assert arithmetic.rotated(turn, vectors).tolist() == expected
    assert [arithmetic.rotated(turn, vector).tolist() for vector in vectors] == expected
    assert np.array_equal(arithmetic.cross_product(rows[0], vectors[0]), np.cross(rows[0], vectors[0]))


@given(VECTORS, st.floats(-7.0, 7.0))
def test_turning_back_undoes_a_turn(vectors, yaw):
    rotation = rotation_matrix(quaternion_from_yaw(yaw))
    turned = arithmetic.rotated(rotation, vectors)
    assert turned == pytest.approx(vectors @ rotation.T, abs=1e-9)
    assert arithmetic.rotated_back(rotation, turned) == pytest.approx(vectors, abs=1e-9)


def test_a_single_vector_is_turned_like_a_row_of_many():
    vectors = np.random.default_rng(0).normal(size=(5, 2))
    turn = arithmetic.plane_rotation(0.7)
    assert np.array_equal(arithmetic.rotated(turn, vectors)[3], arithmetic.rotated(turn, vectors[3]))
    assert arithmetic.rotated(turn, [1.0, 0.0]) == pytest.approx([math.cos(0.7), math.sin(0.7)])


@pytest.mark.parametrize("name", ["tan", "arcsin", "arccos", "arctan", "exp"])
def test_elementary_functions_are_those_of_the_c_library(name):
    numbers = np.linspace(-0.9, 0.9, 21).reshape(3, 7)
    function = getattr(math, {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}.get(name, name))
    expected = [[function(number) for number in row] for row in numbers.tolist()]
    result = getattr(arithmetic, name)(numbers)
    assert result.dtype == np.float64 and result.tolist() == expected


def test_functions_of_two_arguments_broadcast_them():
    assert arithmetic.arctan2([[1.0], [-1.0]], [1.0, -1.0]).tolist() == [
        [math.atan2(1.0, 1.0), math.atan2(1.0, -1.0)],
        [math.atan2(-1.0, 1.0), math.atan2(-1.0, -1.0)],
    ]
    assert arithmetic.power([2.0, 4.0, math.inf], -0.5).tolist() == [2.0**-0.5, 0.5, 0.0]
