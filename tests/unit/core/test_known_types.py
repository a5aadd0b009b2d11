"""Types of operations that are found once: those that numba finds (decision 0095)."""

import math
import operator
from itertools import product

import numba
import numpy as np
import pytest
from numba import types
from numba.core import errors
from numba.core.registry import cpu_target

from mbf_abstract.compiling.known_types import KnownTypes
from mbf_abstract.compiling.passes import LoopCompiler

OPERANDS = (types.int64, types.uint64, types.float32, types.float64, types.boolean, types.intp, types.float64[:, ::1])
FUNCTIONS = (operator.add, operator.floordiv, operator.lt, operator.getitem, math.hypot, max, np.minimum)


@pytest.fixture
def context():
    cpu_target.target_context.refresh()
    cpu_target.typing_context.refresh()
    return cpu_target.typing_context


def found(context, function, operands):
    """The signature of a call, or the kind of error."""
    try:
        return context.resolve_function_type(context.resolve_value_type(function), operands, {})
    except errors.TypingError as error:
        return type(error)


def test_types_are_those_that_numba_finds_at_the_first_call_and_at_the_next(context):
    known = KnownTypes(context, {})
    for function, *operands in product(FUNCTIONS, OPERANDS, OPERANDS):
        expected = found(context, function, tuple(operands))
        assert found(known, function, tuple(operands)) == expected
        assert found(known, function, tuple(operands)) == expected


def test_what_is_known_is_not_asked_for_again(context):
    found_types = {}
    known = KnownTypes(context, found_types)
    first = found(known, operator.add, (types.int64, types.float64))
    nobody = KnownTypes(None, found_types)
    assert found(nobody, operator.add, (types.int64, types.float64)) is first
    with pytest.raises(AttributeError):
        found(nobody, operator.add, (types.float32, types.float64))


def test_what_is_allowed_with_some_options_is_not_known_with_others():
    def makes_an_array(count):
        return np.empty(count, np.float64).size

    allowed = numba.njit(pipeline_class=LoopCompiler, _nrt=True)(makes_an_array)
    refused = numba.njit(pipeline_class=LoopCompiler, _nrt=False)(makes_an_array)
    assert allowed(3) == 3
    with pytest.raises(errors.TypingError):
        refused(3)
