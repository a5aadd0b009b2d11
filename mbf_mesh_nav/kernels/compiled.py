"""The one way kernels are compiled: lazily, cached on disk, without the interpreter lock, types kept for mypy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])


def kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` with numba at its first call; IEEE arithmetic throughout, also where it divides by zero."""
    return cast(KernelFunction, njit(cache=True, nogil=True, error_model="numpy")(function))
