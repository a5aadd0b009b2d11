"""Compilation of this package's kernels: at the first call, cached on disk, IEEE arithmetic throughout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from mbf_abstract.compiling.kernel_cache import compile_lazily

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])

Index: Any = np.uint64
"""Type of indices in hot loops: numba asks of every signed one whether it counts from the end."""


def kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` with numba at its first call; divisions by zero give infinities, as in IEEE 754."""
    return cast(KernelFunction, compile_lazily(function, error_model="numpy"))


def inner_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a step of other kernels. Python itself cannot call it, which saves an eighth of its compilation."""
    return cast(KernelFunction, compile_lazily(function, error_model="numpy", no_cpython_wrapper=True))


def inlined_kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` as a part of each kernel that calls it, for bodies of loops to be vectorised.

    A loop round a call is unrolled before the call is opened, and then there is no loop left to vectorise.
    """
    return cast(KernelFunction, compile_lazily(function, error_model="numpy", inline="always"))
