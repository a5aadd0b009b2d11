"""Types of operations that are found once: those that numba finds (decision 0095)."""

import math
import operator
from itertools import product

import numba
import numpy as np
import pytest
from numba import types
from numba.core import errors, event
from numba.core.registry import cpu_target

from mbf_abstract.compiling.known_types import KnownTypes
from mbf_abstract.compiling.passes import LoopCompiler

OPERANDS = (types.int64, types.uint64, types.float32, types.float64, types.boolean, types.intp, types.float64[:, ::1])
FUNCTIONS = (operator.add, operator.floordiv, operator.lt, operator.getitem, math.hypot, np.minimum)


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
    with pytest.raises(errors.NumbaError):
        refused(3)


@pytest.mark.parametrize("option", ["no_cpython_wrapper", "forceinline", "nogil"])
def test_a_function_of_numba_is_compiled_once_for_kernels_whose_options_do_not_concern_it(option):
    def kernel(first, second):
        return int(first) + second

    def other(first, second):
        return second - int(first)

    numbers = (types.float64, types.float64)
    numba.njit(pipeline_class=LoopCompiler)(kernel).compile(numbers)
    with event.install_recorder("numba:compile") as recorder:
        numba.njit(pipeline_class=LoopCompiler, **{option: True})(other).compile(numbers)
    assert {entry.data["dispatcher"].py_func for _, entry in recorder.buffer} == {other}


def test_numbers_given_by_name_are_known_too(context):
    found_types = {}
    arguments = ((types.int64,), {"dtype": types.NumberClass(types.float64)})
    first = KnownTypes(context, found_types).resolve_function_type(context.resolve_value_type(np.empty), *arguments)
    nobody = KnownTypes(None, found_types)
    assert nobody.resolve_function_type(context.resolve_value_type(np.empty), *arguments) is first


def operations(first, second, whole):
    """Operations of numbers of several types, with constants and powers, which numba has code of their own for."""
    return (
        first + second * 2 - whole / 3,
        first**2 + first**second + whole**3,
        (whole + 1) % 3 + (whole // 2 << 1 | whole & 6),
        (first < second) + (whole >= 2) * 4 + (first != whole),
        (first < second) & (whole >= 2),
    )


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64])
def test_operations_give_what_they_give_with_numbas_own_compiler(kind):
    usual, ours = numba.njit(operations), numba.njit(pipeline_class=LoopCompiler)(operations)
    for first, second, whole in product((0.5, 3.0), (2.5, 0.1), (1, 7)):
        arguments = kind(first), second, np.int32(whole)
        assert ours(*arguments) == usual(*arguments)


def test_the_rules_of_an_operation_are_asked_once(monkeypatch):
    asked = []

    def noted(function, context, arguments, names, ask=types.Function.get_call_type):
        asked.append((function, arguments))
        return ask(function, context, arguments, names)

    def product_and_sum(first, second):
        return first * second + first

    numbers = (types.float64, types.float64)
    numba.njit(pipeline_class=LoopCompiler)(product_and_sum).compile(numbers)
    monkeypatch.setattr(types.Function, "get_call_type", noted)
    numba.njit(pipeline_class=LoopCompiler, nogil=True)(product_and_sum).compile(numbers)
    assert asked == []
