"""The decorator with which all kernels of this package are compiled; it keeps their annotations visible to mypy.

Nothing is compiled at import: numba specialises a kernel at its first call and keeps the machine code on disk, until a
file of this folder changes. Kernels run without the interpreter lock and in strict IEEE arithmetic, so NaN and inf keep
their meaning.

Three habits keep a first start short. Rows of arrays are copied by loops: a slice that is assigned to brings in the
string formatting of its error's text, a second of compilation. The largest and the least of an array are found by
loops: ``max()`` and ``min()`` of an array are up to four more functions of numba. Whole numbers are handed on to
other kernels as ``Count``: a plain 0, and each other width, makes numba compile that kernel once more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from mbf_abstract.compiling.kernel_cache import compile_lazily

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])

Count: Any = np.int64
"""Type of counters and codes handed on to other kernels."""


def kernel(function: KernelFunction) -> KernelFunction:
    """Compile ``function`` with numba when it is first called."""
    return cast(KernelFunction, compile_lazily(function))
