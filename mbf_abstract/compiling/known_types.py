"""The types of an operation, found once per process: numba asks all its rules again at each ``a + b`` of each kernel.

When to use: as steps of ``passes.LoopCompiler``. When not: with functions that are compiled for the types that they
are called with; only numba's own ones are kept here.

For ``float + float`` numba tries every rule for ``+``, those for whole arrays too, writes a coloured error text for
each that does not fit, and forgets all of it. That is half of the time of its type inference (decision 0095). It also
compiles ``max`` or ``np.empty`` again for every set of options of a kernel, those too that make no difference to them
(``forceinline`` is passed on, but what is so short is part of its callers' code anyway).
"""

from __future__ import annotations

import operator
from types import BuiltinFunctionType
from typing import Any
from weakref import WeakKeyDictionary

from numba.core import types
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NopythonTypeInference

from mbf_abstract.compiling.calls_in_place import code_in_place, known_signature

INHERITED = ("nrt", "fastmath", "error_model")
"""Options of a kernel that numba compiles its own functions with; one with other options is a function of its own."""
_known: WeakKeyDictionary[Any, dict[tuple[str, ...], dict[Any, Any]]] = WeakKeyDictionary()
"""What is known, per typing context of numba and inherited options; numba compiles one function at a time."""
_operations: WeakKeyDictionary[Any, dict[tuple[Any, Any], Any]] = WeakKeyDictionary()
"""Signatures of operations of numbers, per typing context, operator and types of the operands."""
KEPT = (types.Function, types.NumberClass, BuiltinFunctionType)
"""Kinds of functions whose types depend on those of the arguments alone: numba's own, conversions, operators."""


class KnownTypes:
    """numba's typing context, which keeps the types of calls of numba's own functions, and of operators."""

    def __init__(self, context: Any, known: dict[Any, Any]) -> None:
        self._context = context
        self._found = known

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Signature of a call of a function with arguments of some types; None where it cannot be called so."""
        if not isinstance(func, KEPT):
            return self._context.resolve_function_type(func, args, kws)
        key = (func, tuple(args), tuple(kws.items()))
        if self._found.get(key) is None:
            in_place = known_signature(func, args, kws)
            self._found[key] = in_place or self._context.resolve_function_type(func, args, kws)
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
        options = tuple(str(getattr(state.flags, name)) for name in INHERITED)
        state.typingctx = KnownTypes(usual, _known.setdefault(usual, {}).setdefault(options, {}))
        try:
            return bool(super().run_pass(state))
        finally:
            state.typingctx = usual


class KnownOperators(Lower):  # type: ignore[misc]
    """numba's step from its own code to LLVM's, which takes the types of ``a + b`` of numbers as they were found.

    Calls that have a ``known_signature`` are made in place.
    """

    def _lower_call_normal(self, fnty: Any, expr: Any, signature: Any) -> Any:
        if signature.pysig is not None or known_signature(fnty, signature.args, ()) != signature:
            return super()._lower_call_normal(fnty, expr, signature)
        variables = [*expr.args, *dict(expr.kws).values()]
        values = [self._cast_var(variable, kind) for variable, kind in zip(variables, signature.args, strict=True)]
        return code_in_place(self.context, self.builder, fnty, signature, values)

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Code of an operation of two operands.

        numba looks for code for constants first, which it has for powers, and asks all rules for the types again.
        """
        signature, context = self.fndesc.calltypes[expr], self.context.typing_context
        if op in (operator.pow, operator.ipow) or not all(isinstance(kind, types.Number) for kind in signature.args):
            return super().lower_binop(resty, expr, op)
        names = (expr.lhs.name, expr.rhs.name)
        loaded = [self.loadvar(name) for name in names]
        operands = [
            self.context.cast(self.builder, value, self.typeof(name), kind)
            for value, name, kind in zip(loaded, names, signature.args, strict=True)
        ]
        function = context.resolve_value_type(op)
        key = function, signature.args
        known = _operations.setdefault(context, {})
        if key not in known:
            known[key] = function.get_call_type(context, signature.args, {})
        code = self.context.get_function(function, known[key])
        return self.context.cast(self.builder, code(self.builder, operands), signature.return_type, resty)
