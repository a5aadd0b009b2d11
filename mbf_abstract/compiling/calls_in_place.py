"""``min``, ``max`` and ``np.empty`` as a few instructions where they are called, not as functions compiled first.

When to use: as part of ``known_types``, in kernels that are loops over numbers. When not: for functions that numba has
more code for than a few instructions; one function for all callers is the shorter way then.

numba compiles a function for each set of types that ``min`` or ``np.empty`` is called with, as it compiles a kernel,
and LLVM then puts it into each caller's code: 15 to 30 ms each. Here the callers get the same instructions at once
(decision 0111).
"""

from __future__ import annotations

import operator
from typing import Any

import numba.np.arrayobj as arrays
import numpy as np
from numba.core import types as _types

types: Any = _types

COMPARISONS = {min: operator.lt, max: operator.gt}
"""Python's rule for each of them: the next one replaces the one held if it compares so, NaN therefore never does."""
EMPTY: Any = np.empty


def known_signature(function: Any, arguments: tuple[Any, ...], keywords: Any) -> Any:
    """Signature of a call of a numba function type that is made in place; None for any other call."""
    if not isinstance(function, types.Function):
        return None
    if function.typing_key in COMPARISONS:
        kinds = {types.unliteral(kind) for kind in arguments}
        if len(arguments) > 1 and len(kinds) == 1 and isinstance(kind := kinds.pop(), (types.Integer, types.Float)):
            return kind(*[kind] * len(arguments))
    elif function.typing_key is EMPTY:
        shape, *others = (*arguments, *dict(keywords).values())
        shape = types.unliteral(shape)
        if len(others) == 1 and isinstance(others[0], types.NumberClass) and _is_shape(shape):
            dimensions = 1 if isinstance(shape, types.Integer) else len(shape)
            return types.Array(others[0].dtype, dimensions, "C")(shape, others[0])
    return None


def _is_shape(kind: Any) -> bool:
    """Whether a type is that of one whole number or of several of one type."""
    return isinstance(kind.dtype if isinstance(kind, types.UniTuple) else kind, types.Integer)


def code_in_place(context: Any, builder: Any, function: Any, known: Any, values: list[Any]) -> Any:
    """Code of a call with a ``known_signature``, of values of its types."""
    if function.typing_key is EMPTY:
        kind, shape = arrays._parse_empty_args(context, builder, known, values)
        return arrays._empty_nd_impl(context, builder, kind, shape)._getvalue()
    kind = known.return_type
    compare = context.get_function(COMPARISONS[function.typing_key], types.boolean(kind, kind))
    held, *rest = values
    for value in rest:
        held = builder.select(compare(builder, (value, held)), value, held)
    return held
