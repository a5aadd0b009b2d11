"""The types of an operation, found once per process: numba asks all its rules again at each ``a + b`` of each kernel.

When to use: as a step of ``passes.LoopCompiler``. When not: with functions that are compiled for the types that they
are called with; only numba's own ones are kept here.

For ``float + float`` numba tries every rule for ``+``, those for whole arrays too, writes a coloured error text for
each that does not fit, and forgets all of it. That is half of the time of its type inference (decision 0095).
"""

from __future__ import annotations

from types import BuiltinFunctionType
from typing import Any
from weakref import WeakKeyDictionary

from numba.core import types
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NopythonTypeInference

_known: WeakKeyDictionary[Any, dict[str, dict[Any, Any]]] = WeakKeyDictionary()
"""What is known, per typing context of numba and options of the compilation; numba compiles one function at a time."""


class KnownTypes:
    """numba's typing context, which keeps the types of calls of numba's own functions, and of operators."""

    def __init__(self, context: Any, known: dict[Any, Any]) -> None:
        self._context = context
        self._found = known

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Signature of a call of a function with arguments of some types; None where it cannot be called so."""
        if kws or not isinstance(func, types.Function):
            return self._context.resolve_function_type(func, args, kws)
        key = (func, tuple(args))
        if self._found.get(key) is None:
            self._found[key] = self._context.resolve_function_type(func, args, kws)
        return self._found[key]

    def resolve_value_type(self, val: Any) -> Any:
        """Type of a constant; kept for the operators of Python and other built-in functions."""
        if not isinstance(val, BuiltinFunctionType):
            return self._context.resolve_value_type(val)
        if val not in self._found:
            self._found[val] = self._context.resolve_value_type(val)
        return self._found[val]


@register_pass(mutates_CFG=True, analysis_only=False)
class KnownTypeInference(NopythonTypeInference):  # type: ignore[misc]
    """numba's type inference with ``KnownTypes``."""

    def run_pass(self, state: Any) -> bool:
        """Find the types of a function's variables."""
        usual = state.typingctx
        state.typingctx = KnownTypes(usual, _known.setdefault(usual, {}).setdefault(state.flags.summary(), {}))
        try:
            return bool(super().run_pass(state))
        finally:
            state.typingctx = usual
