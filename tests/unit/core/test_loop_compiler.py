"""The compiler of loops over numbers: numba's own less five steps, and the same instructions (decisions 0089, 0095)."""

import re
from collections import Counter

import numba
import numpy as np
from numba.core import event

from mbf_abstract.compiling import passes
from mbf_abstract.compiling.passes import LoopCompiler

OURS = {"pipeline_class": LoopCompiler}


def lengths(points, found):
    """Lengths of the rows of an array, written to another one; the number of those above 1."""
    above = 0
    for row in range(len(points)):
        x, y = points[row, 0], points[row, 1]
        found[row] = np.sqrt(x * x + y * y)
        if found[row] > 1.0:
            above += 1
    return above


def compiled(**options):
    """The function, compiled for an example, and the names of the steps of its compilation."""
    kernel = numba.njit(error_model="numpy", **options)(lengths)
    with event.install_recorder("numba:run_pass") as recorder:
        kernel(np.zeros((1, 2)), np.zeros(1))
    return kernel, {entry[1].data["name"].split()[0] for entry in recorder.buffer if "lengths" in entry[1].data["name"]}


def instructions(kernel):
    """The optimised code without the names in it."""
    return re.findall(r"^  (?:%\S+ = )?(\w+)", next(iter(kernel.inspect_llvm().values())), re.MULTILINE)


def test_results_and_code_are_those_of_numbas_compiler_with_fewer_steps():
    points = np.random.default_rng(0).normal(size=(200, 2))
    (usual, all_steps), (ours, our_steps) = (compiled(_nrt=False, **kind) for kind in ({}, OURS))
    expected, found = np.empty(200), np.empty(200)

    assert ours(points, found) == usual(points, expected) == np.sum(expected > 1.0)
    assert np.array_equal(found, expected)
    assert Counter(instructions(ours)) == Counter(instructions(usual))
    assert all_steps - our_steps == {
        "inline_closure_likes",
        "generic_rewrites",
        "inline_overloads",
        "nopython_rewrites",
        "annotate_types",
    }


def test_a_numba_that_nobody_has_tried_compiles_by_its_own_steps(monkeypatch):
    _, tried = compiled(pipeline_class=LoopCompiler)
    monkeypatch.setattr(passes, "LAST_NUMBA", (0, 1))
    kernel, untried = compiled(pipeline_class=LoopCompiler)

    ours, numbas = {"known_type_inference", "kernel_lowering"}, {"nopython_type_inference", "native_lowering"}
    assert kernel(np.ones((3, 2)), np.zeros(3)) == 3
    assert untried == (tried - ours) | numbas, (tried, untried)
