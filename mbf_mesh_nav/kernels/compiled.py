"""The one way kernels are compiled: lazily, cached on disk, without the interpreter lock, types kept for mypy.

Five habits keep compilation short: indices and counters start as ``Index(0)`` or ``Count(0)`` (a plain 0 passed on to
another kernel makes numba compile that one for the literal first), rows of arrays are copied by loops (slices and array
expressions bring in their error messages' string formatting), arrays handed in are of one kind everywhere (read-only
and writable ones are different types), arrays begin as ``np.empty`` with ``dtype=`` and are filled by ``fill``
(``np.zeros`` compiles three more functions per type of array), and points are vectors of ``vectors.py`` (the components
written out are three times the work for type inference).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from mbf_abstract.compiling.kernel_cache import compile_lazily
from mbf_abstract.compiling.passes import LoopCompiler

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])

Index: Any = np.uint64
"""Type of indices in hot loops: numba asks of every signed one whether it counts from the end, a fifth of a wave."""
ONE: Any = Index(1)
Count: Any = np.int64
"""Type of counters and codes handed on to other kernels."""


OPTIONS: dict[str, Any] = {"error_model": "numpy", "pipeline_class": LoopCompiler}
"""Divisions by zero follow IEEE arithmetic instead of raising; kernels are loops over numbers."""


def kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` with numba at its first call; IEEE arithmetic throughout, also where it divides by zero."""
    return cast(KernelFunction, compile_lazily(function, **OPTIONS, _nrt=True))


def plain_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a kernel that makes no array and returns none: nobody counts who holds the arrays that it is given.

    That saves a twentieth of its compilation. It calls plain and inner kernels only, which a test of the
    architecture checks: what an array kernel returns would never be freed.
    """
    return cast(KernelFunction, compile_lazily(function, **OPTIONS, _nrt=False))


def inner_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a plain step of other kernels. Python itself cannot call it, which saves an eighth of its compilation."""
    return cast(KernelFunction, compile_lazily(function, **OPTIONS, no_cpython_wrapper=True, _nrt=False))


def inlined_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a plain step that is called once, in a hot loop, as part of what calls it.

    Each array takes seven words of the stack with every call.
    """
    return cast(
        KernelFunction, compile_lazily(function, **OPTIONS, no_cpython_wrapper=True, forceinline=True, _nrt=False)
    )


def inner_array_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a step of other kernels that makes or returns arrays."""
    return cast(KernelFunction, compile_lazily(function, **OPTIONS, no_cpython_wrapper=True, _nrt=True))
