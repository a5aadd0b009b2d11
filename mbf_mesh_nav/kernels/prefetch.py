"""Asking the processor for memory before it is needed.

A wave over a large map takes its vertices from where the front is, which no processor foresees: each one waits for
memory. But the queue says a dozen vertices ahead which ones are next. On a million vertices Dijkstra's field takes
three quarters of the time with their edges asked for in time; results are the same, as nothing is read.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic


def _prefetch(typing_context: Any, array: Any, index: Any) -> Any:
    """Ask for the cache line of an element of a one-dimensional array, or of the row of a two-dimensional one."""

    def generated(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array_type = signature.args[0]
        structure = context.make_array(array_type)(context, builder, arguments[0])
        zeros = [ir.Constant(arguments[1].type, 0)] * (array_type.ndim - 1)
        element = cgutils.get_item_pointer(
            context, builder, array_type, structure, [arguments[1], *zeros], wraparound=False
        )
        pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        function = builder.module.declare_intrinsic(
            "llvm.prefetch", (pointer,), ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        )
        read, into_all_caches, data = (ir.Constant(number, value) for value in (0, 3, 1))
        builder.call(function, [builder.bitcast(element, pointer), read, into_all_caches, data])
        return context.get_dummy_value()

    return types.void(array, index), generated


def _nothing(array: Any, index: int) -> None:
    """In plain Python, where kernels are not compiled, there is nothing to ask for."""


prefetch: Any = _nothing if config.DISABLE_JIT else intrinsic(_prefetch)
"""Called in kernels with an array and an unsigned index within it."""
