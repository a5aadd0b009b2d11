"""Products, lengths and elementary functions of arrays that have the same bytes on every CPU.

When to use: wherever numbers reach a robot or an event. ``@``, ``dot``, ``einsum`` and ``linalg`` call BLAS, which
chooses its kernels, and with them the order of its sums, by the CPU. numpy's own ``exp``, ``power``, ``tan`` and the
inverse trigonometric functions are other code on CPUs with AVX-512. What stands here is made of elementwise products
and sums in written order, and of the C library's functions.

When not: inside numba kernels, which compile to the same scalar code everywhere, and for pictures and reports.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def scalar_products(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Scalar products (...) float64 of the vectors (..., d) in ``a`` and ``b``, summed from the first component on."""
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if first.ndim == second.ndim == 1:
        return np.asarray(_product_of_two(first.tolist(), second.tolist()))
    total = first[..., 0] * second[..., 0]
    for component in range(1, first.shape[-1]):
        total = total + first[..., component] * second[..., component]
    return np.asarray(total)


def _product_of_two(a: list[float], b: list[float]) -> float:
    """Scalar product of two single vectors: in Python floats, which for so few numbers are faster than arrays."""
    total = a[0] * b[0]
    for component in range(1, len(a)):
        total += a[component] * b[component]  # not ``sum``: from Python 3.12 on it corrects for rounding
    return total


def cross_product(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Cross product (3,) float64 of two single vectors (3,); ``numpy.cross`` takes 15 times as long for one."""
    ax, ay, az = np.asarray(a, dtype=np.float64).tolist()
    bx, by, bz = np.asarray(b, dtype=np.float64).tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def norm(vectors: ArrayLike) -> FloatArray:
    """Euclidean norms (...) float64 of vectors (..., d), along the last axis."""
    return np.asarray(np.sqrt(scalar_products(vectors, vectors)))


def plane_rotation(yaw: float) -> FloatArray:
    """(2, 2) float64 matrix of a rotation by ``yaw`` [rad]."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])


def rotated(rotation: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Vectors (..., d) float64 turned by a rotation matrix (d, d): ``rotation`` times each vector."""
    matrix, turned = np.asarray(rotation, dtype=np.float64), np.asarray(vectors, dtype=np.float64)
    rows = matrix.tolist()
    if turned.ndim == 1:
        single = turned.tolist()
        return np.array([_product_of_two(row, single) for row in rows])
    result = np.empty((*turned.shape[:-1], len(rows)))
    for component, row in enumerate(rows):
        total = row[0] * turned[..., 0]
        for along in range(1, len(row)):
            total += row[along] * turned[..., along]
        result[..., component] = total
    return result


def rotated_back(rotation: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Vectors (..., d) float64 turned by the inverse of a rotation matrix (d, d)."""
    return rotated(np.asarray(rotation, dtype=np.float64).T, vectors)


def _elementwise(function: Callable[..., float], inputs: int) -> Callable[..., FloatArray]:
    """Apply a function of the C library to every element of ``inputs`` arrays, which are broadcast."""
    of_elements = np.frompyfunc(function, inputs, 1)

    def of_arrays(*arrays: ArrayLike) -> FloatArray:
        result: Any = of_elements(*(np.asarray(array, dtype=np.float64) for array in arrays))
        return np.asarray(result, dtype=np.float64)

    return of_arrays


tan = _elementwise(math.tan, 1)
arcsin = _elementwise(math.asin, 1)
arccos = _elementwise(math.acos, 1)
arctan = _elementwise(math.atan, 1)
arctan2 = _elementwise(math.atan2, 2)
exp = _elementwise(math.exp, 1)
power = _elementwise(math.pow, 2)
