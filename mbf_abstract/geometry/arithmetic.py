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
    products = np.asarray(a, dtype=np.float64) * np.asarray(b, dtype=np.float64)
    total = products[..., 0]
    for component in range(1, products.shape[-1]):
        total = total + products[..., component]
    return np.asarray(total)


def norm(vectors: ArrayLike) -> FloatArray:
    """Euclidean norms (...) float64 of vectors (..., d), along the last axis."""
    return np.asarray(np.sqrt(scalar_products(vectors, vectors)))


def plane_rotation(yaw: float) -> FloatArray:
    """(2, 2) float64 matrix of a rotation by ``yaw`` [rad]."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])


def rotated(rotation: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Vectors (..., d) float64 turned by a rotation matrix (d, d): ``rotation`` times each vector."""
    rows = np.asarray(rotation, dtype=np.float64)
    return np.stack([scalar_products(vectors, row) for row in rows], axis=-1)


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
