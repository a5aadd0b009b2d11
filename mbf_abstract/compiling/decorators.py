"""The decorators with which kernels are compiled: lazily, cached on disk, without the interpreter lock, types kept.

When to use: for loops over numbers and elements of arrays, in a folder named ``kernels``. When not: for a kernel with
closures or expressions of several whole arrays, which would not become one loop; see ``passes``.

Nothing is compiled at import: numba specialises a kernel at its first call and keeps the machine code until a file of
its folder changes. Arithmetic is that of IEEE 754, also where it divides by zero: NaN and inf keep their meaning.

Habits that keep a first start short: indices and counters start as ``Index(0)`` or ``Count(0)`` (a plain 0 passed on
to another kernel makes numba compile that one for the literal first), rows of arrays are copied by loops (slices and
array expressions bring in their error messages' string formatting), the largest and the least of an array are found
by loops, and arrays handed in are of one kind everywhere (read-only and writable ones are different types).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from mbf_abstract.compiling.kernel_cache import compile_lazily
from mbf_abstract.compiling.passes import WholeStepCompiler

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])

Index: Any = np.uint64
"""Type of indices in hot loops: numba asks of every signed one whether it counts from the end."""
Count: Any = np.int64
"""Type of counters and codes handed on to other kernels."""

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "pipeline_class": WholeStepCompiler}


def kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` with numba at its first call."""
    return cast(KernelFunction, compile_lazily(function, **_OPTIONS, _nrt=True))


def brief_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a kernel of a few microseconds that Python calls between longer ones; it keeps the interpreter's lock.

    Who gives the lock away may have to wait for it, and to be woken again takes longer than such a kernel.
    """
    return cast(KernelFunction, compile_lazily(function, **_OPTIONS, _nrt=True, nogil=False))


def plain_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a kernel that makes no array and returns none: nobody counts who holds the arrays that it is given.

    That saves a twentieth of its compilation. It calls plain and inner kernels only, which a test of the
    architecture checks: what another one returns would never be freed.
    """
    return cast(KernelFunction, compile_lazily(function, **_OPTIONS, _nrt=False))


def inner_kernel(function: KernelFunction) -> KernelFunction:
    """Compile a plain step of other kernels. Python itself cannot call it, which saves an eighth of its compilation."""
    return cast(KernelFunction, compile_lazily(function, **_OPTIONS, no_cpython_wrapper=True, _nrt=False))


def inlined_kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` as a part of each kernel that calls it, for bodies of loops to be vectorised.

    A loop round a call is unrolled before the call is opened, and then there is no loop left to vectorise.
    """
    return cast(KernelFunction, compile_lazily(function, **_OPTIONS, inline="always"))
