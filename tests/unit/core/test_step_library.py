"""Steps without machine code of their own: kernels that call them work as ever, from the disk too (decision 0095)."""

import os
import subprocess
import sys

import numba
import pytest

from mbf_abstract.compiling.passes import LoopCompiler, WholeStepCompiler
from mbf_abstract.compiling.step_library import WholeStepLibrary

OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True, "pipeline_class": LoopCompiler}


@numba.njit(no_cpython_wrapper=True, **OPTIONS)
def doubled(number):
    """A step that refers to objects of Python: the parts of an error's text."""
    if number > 3:
        raise ValueError("too great", number)
    return 2 * number


@numba.njit(**OPTIONS)
def sum_of_doubled(count):
    """A kernel that calls it."""
    total = 0
    for number in range(count):
        total += doubled(number)
    return total


def test_a_kernel_runs_its_step_which_has_no_machine_code():
    assert sum_of_doubled(3) == 6
    (step,) = doubled.overloads.values()
    assert step.library.get_pointer_to_function(step.fndesc.llvm_func_name) == 0
    with pytest.raises(ValueError, match="too great") as caught:
        sum_of_doubled(10)
    assert caught.value.args == ("too great", 4)


def test_steps_may_be_optimised_as_a_whole():
    options = OPTIONS | {"pipeline_class": WholeStepCompiler}
    step = numba.njit(no_cpython_wrapper=True, **options)(doubled.py_func)
    kernel = numba.njit(**options)(lambda number: step(number) + 1)
    assert kernel(3) == 7
    assert [type(overload.library) for overload in step.overloads.values()] == [WholeStepLibrary]


@numba.njit(no_cpython_wrapper=True, **OPTIONS)
def factorial(number):
    """A step that calls itself."""
    if number < 2:
        return 1
    return number * factorial(number - 1)


@numba.njit(no_cpython_wrapper=True, **OPTIONS)
def is_odd(number):
    """Two steps that call each other."""
    if number == 0:
        return False
    return is_even(number - 1)


@numba.njit(no_cpython_wrapper=True, **OPTIONS)
def is_even(number):
    """The other one."""
    if number == 0:
        return True
    return is_odd(number - 1)


@numba.njit(**OPTIONS)
def factorial_of(number):
    return factorial(number)


@numba.njit(**OPTIONS)
def is_even_number(number):
    return is_even(number)


def test_a_step_may_call_itself_but_not_by_way_of_another_one():
    assert factorial_of(5) == 120
    with pytest.raises(NotImplementedError, match="calls itself by way of another step"):
        is_even_number(4)


KERNELS = """
from mbf_abstract.compiling.kernel_cache import compile_lazily
from mbf_abstract.compiling.passes import LoopCompiler, WholeStepCompiler
from mbf_abstract.compiling.step_library import WholeStepLibrary
def step(function):
    return compile_lazily(function, pipeline_class=LoopCompiler, no_cpython_wrapper=True)
def kernel(function):
    return compile_lazily(function, pipeline_class=LoopCompiler)
@step
def checked(number):
    if number > 3:
        raise ValueError("too great", number)
    return number
@kernel
def first(number):
    return checked(number) + 1
@kernel
def second(number):
    return checked(number) + 2
"""
CALL = """
import sys
from kernels import steps
kernel = getattr(steps, sys.argv[1])
print(kernel(1), sum(kernel.stats.cache_hits.values()), sum(steps.checked.stats.cache_hits.values()))
try:
    kernel(7)
except ValueError as error:
    print(*error.args)
"""


def call(folder, kernel):
    """What a process of its own prints: the result, whether kernel and step came from the disk, and the error."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", CALL, kernel]
    return subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True).stdout


def test_kernels_and_steps_from_the_disk_are_those_that_were_compiled(tmp_path):
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "__init__.py").touch()
    (tmp_path / "kernels" / "steps.py").write_text(KERNELS)
    assert call(tmp_path, "first") == "2 0 0\ntoo great 7\n"
    assert call(tmp_path, "first") == "2 1 0\ntoo great 7\n"  # a kernel holds its steps
    assert call(tmp_path, "second") == "3 0 1\ntoo great 7\n"  # a new kernel with a step from the disk
    assert call(tmp_path, "second") == "3 1 0\ntoo great 7\n"
