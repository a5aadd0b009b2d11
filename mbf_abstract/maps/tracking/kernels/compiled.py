"""Compilation of the tracker's kernels: at the first call, cached on disk, IEEE arithmetic throughout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from mbf_abstract.compiling.kernel_cache import compile_lazily
from mbf_abstract.compiling.passes import LoopCompiler

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])


def kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` with numba at its first call; divisions by zero give infinities, as in IEEE 754."""
    return cast(KernelFunction, compile_lazily(function, error_model="numpy", pipeline_class=LoopCompiler))
