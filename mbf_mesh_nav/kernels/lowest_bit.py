"""The place of the lowest set bit of a number, which is one instruction of the processor.

A loop over the few that passed a test, out of many, costs a wrong guess of the processor for nearly each of them if it
branches at the test. Marked as bits and taken out one after the other they cost one guess in all.

LLVM makes a branch of ``bits |= bit if passed else 0`` on CPUs without AVX-512, also of ``bit * passed``, and vectors,
which are too long for six, of a shift by the number of each. Twice what there is, plus the next one, stays what it is:
``bits += bits + passed``, from the last to the first.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config
from numba.extending import intrinsic

from mbf_mesh_nav.kernels.compiled import Index

BITS: Any = Index(64)
"""Of a number of type ``Index``."""


def _lowest_bit(typing_context: Any, number: Any) -> Any:
    """Place of the lowest set bit of an integer that is not zero, in the integer's type."""

    def generated(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        is_never_zero = ir.Constant(ir.IntType(1), 1)
        return builder.cttz(arguments[0], is_never_zero)

    return number(number), generated


def _by_halves(number: Any) -> Any:
    """The same in plain Python, where kernels are not compiled."""
    return type(number)((int(number) & -int(number)).bit_length() - 1)


lowest_bit: Any = _by_halves if config.DISABLE_JIT else intrinsic(_lowest_bit)
"""Called in kernels with an unsigned number above 0."""
