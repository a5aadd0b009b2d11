"""Calls of numba's own functions that are made in place: what they give is what numba's functions give."""

import gc
import math
from itertools import product

import numba
import numpy as np
import pytest
from numba.core import event
from numba.core.runtime import _nrt_python, rtsys

from mbf_abstract.compiling.passes import LoopCompiler

NUMBERS = (0.0, -0.0, 1.5, -2.0, math.inf, -math.inf, math.nan)


def extremes(first, second, third):
    return min(first, second), max(first, second), min(first, second, third), max(first, second, third)


def bounded(number):
    return max(min(number, 3), 0)


def arrays(count, rows, columns):
    return np.empty(count, np.int32), np.empty(shape=(rows, columns), dtype=np.float32), np.empty(count, dtype=np.bool_)


def both(function):
    """A function by numba's own compiler, and by ours."""
    return numba.njit(function), numba.njit(pipeline_class=LoopCompiler)(function)


def bits(values):
    """Numbers with their sign and their kind of NaN."""
    return [np.asarray(value).tobytes() for value in values]


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_the_least_and_the_largest_are_those_of_numba_and_of_python_bit_by_bit(kind):
    usual, ours = both(extremes)
    for numbers in product(map(kind, NUMBERS), repeat=3):
        assert bits(ours(*numbers)) == bits(usual(*numbers)) == bits(map(float, extremes(*numbers)))


@pytest.mark.parametrize("kind", [np.int64, np.uint64, np.int32, np.uint8])
def test_the_least_and_the_largest_of_whole_numbers_are_those_of_numba(kind):
    usual, ours = both(extremes)
    ends = np.iinfo(kind).min, 0, 1, np.iinfo(kind).max
    for numbers in product(map(kind, ends), repeat=3):
        assert ours(*numbers) == usual(*numbers) == extremes(*numbers)
    assert [both(bounded)[1](kind(number)) for number in (0, 2, 7)] == [0, 2, 3]


def test_numbers_of_several_types_are_left_to_numba():
    usual, ours = both(extremes)
    numbers = np.int32(-3), 2.5, np.float32(0.1)
    assert ours(*numbers) == usual(*numbers)
    assert numba.typeof(ours(*numbers)) == numba.typeof(usual(*numbers))


@pytest.fixture
def counted_memory():
    """numba counts what it allocates and frees."""
    counted = _nrt_python.memsys_stats_enabled()
    _nrt_python.memsys_enable_stats()
    yield
    if not counted:
        _nrt_python.memsys_disable_stats()


def test_arrays_have_the_shape_and_the_type_of_numbas_and_are_freed(counted_memory):
    usual, ours = both(arrays)
    for sizes in ((0, 0, 3), (7, 2, 5), (np.uint64(3), 4, 1)):
        for found, expected in zip(ours(*sizes), usual(*sizes), strict=True):
            assert (found.shape, found.dtype, found.strides) == (expected.shape, expected.dtype, expected.strides)
            assert found.flags.c_contiguous and found.flags.writeable
    del found, expected
    gc.collect()
    before = rtsys.get_allocation_stats()
    for _ in range(10):
        ours(1000, 20, 30)
    after = rtsys.get_allocation_stats()
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free == 30


@pytest.mark.parametrize("sizes", [(-1, 1, 1), (1, 2, -3), (1, 1 << 40, 1 << 40)])
def test_sizes_of_which_there_is_no_array_are_refused_as_numba_refuses_them(sizes):
    usual, ours = both(arrays)
    with pytest.raises(ValueError) as expected:
        usual(*sizes)
    with pytest.raises(ValueError) as found:
        ours(*sizes)
    assert str(found.value) == str(expected.value)


def test_nothing_but_the_function_itself_is_compiled():
    def kernel(count, limit):
        return min(np.empty(count, np.uint8).size, limit)

    numba.njit(pipeline_class=LoopCompiler)(arrays)(1, 1, 1)  # numba's allocator is compiled once a process
    with event.install_recorder("numba:compile") as recorder:
        numba.njit(pipeline_class=LoopCompiler)(kernel)(3, 5)
    assert {entry.data["dispatcher"].py_func for _, entry in recorder.buffer} == {kernel}
