"""Machine code on disk: used again by the next process, and made anew when a kernel of another file has changed."""

import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numba
import pytest

from mbf_abstract.compiling import kernel_cache
from mbf_abstract.compiling.compilation import Compiled, record_compilations
from mbf_abstract.compiling.decorators import brief_kernel, kernel
from mbf_abstract.compiling.garbage import NEW_OBJECTS
from mbf_abstract.compiling.kernel_cache import compile_lazily

DECORATOR = "from mbf_abstract.compiling.kernel_cache import compile_lazily as kernel\n"
STEP = DECORATOR + "@kernel\ndef step(x):\n    return x + {}\n"
SEARCH = DECORATOR + "from kernels.step import step\n@kernel\ndef search(x):\n    return 10 * step(x)\n"
CALL = """
from kernels.search import search
value = search(1)
print(value, sum(search.stats.cache_hits.values()))
"""
HASHES = DECORATOR + "import numpy as np\n@kernel\ndef hashed(text, x):\n    return hash(text), np.cumsum(x)\n"
CALL_HASHES = """
import sys
import numpy as np
from kernels.hashes import hashed
for numbers in (np.ones(3), np.ones(2, int))[: int(sys.argv[1])]:
    value, sums = hashed("text", numbers)
    print(value == hash("text"), *sums, "numba.np.polynomial.polynomial_core" in sys.modules)
"""


def call_in_a_process_of_its_own(folder: Path) -> tuple[int, int]:
    """What ``search(1)`` returns, and how many kernels came from the disk."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python's own cache misses a change within a second to the same size
    command = [sys.executable, "-c", CALL]
    done = subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    value, hits = done.stdout.split()
    return int(value), int(hits)


def test_a_kernel_is_compiled_anew_only_when_a_kernel_it_calls_from_another_file_has_changed(tmp_path):
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    (kernels / "__init__.py").touch()
    (kernels / "search.py").write_text(SEARCH)
    (kernels / "step.py").write_text(STEP.format(1))
    assert call_in_a_process_of_its_own(tmp_path) == (20, 0)
    assert call_in_a_process_of_its_own(tmp_path) == (20, 1)
    (kernels / "step.py").write_text(STEP.format(2))
    assert call_in_a_process_of_its_own(tmp_path) == (30, 0)


def test_code_on_disk_is_loaded_without_what_numba_needs_to_compile_which_it_can_still_do(tmp_path):
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "hashes.py").write_text(HASHES)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}

    def call(times):
        command = [sys.executable, "-c", CALL_HASHES, str(times)]
        done = subprocess.run(command, cwd=tmp_path, env=environment, check=True, capture_output=True, text=True)
        return done.stdout.splitlines()

    assert call(1) == ["True 1.0 2.0 3.0 True"]
    assert call(2) == ["True 1.0 2.0 3.0 False", "True 1 2 True"]


def test_two_first_runs_at_once_both_come_out_right_and_leave_a_cache_that_is_used(tmp_path):
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "__init__.py").touch()
    (tmp_path / "kernels" / "search.py").write_text(SEARCH)
    (tmp_path / "kernels" / "step.py").write_text(STEP.format(1))
    with ThreadPoolExecutor(2) as pool:
        results = [pool.submit(call_in_a_process_of_its_own, tmp_path) for _ in range(2)]
    assert [result.result()[0] for result in results] == [20, 20]
    assert call_in_a_process_of_its_own(tmp_path) == (20, 1)


def test_a_record_of_compilations_says_how_many_kernels_took_how_long_and_what_is_kept():
    names = ["search.step", "search.step", "search.leap"]  # one of them for two types
    assert str(Compiled(names, 1.24, kept=True)) == "kernels compiled once, kept on disk: 2 (1.2 s)"
    assert str(Compiled(names, 1.24, kept=False)) == "kernels compiled and not kept for the next time: 2 (1.2 s)"


def test_the_sources_are_read_without_a_look_into_caches_which_another_process_may_be_removing(tmp_path):
    (tmp_path / "search.py").write_text(SEARCH)
    before = kernel_cache._sources(tmp_path)
    cached = tmp_path / "__pycache__" / "kernels-of-before" / "states"
    cached.mkdir(parents=True)
    (cached / "step.py").write_text(STEP.format(1))
    assert kernel_cache._sources(tmp_path) == before
    (tmp_path / "steps").mkdir()
    (tmp_path / "steps" / "step.py").write_text(STEP.format(1))
    assert kernel_cache._sources(tmp_path) != before


def test_the_code_of_earlier_sources_is_removed_and_that_of_todays_is_kept_beside_them(tmp_path):
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    (kernels / "search.py").write_text(SEARCH)
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    for added in (1, 2):
        (kernels / "step.py").write_text(STEP.format(added))
        subprocess.run([sys.executable, "-c", CALL], cwd=tmp_path, env=environment, check=True)
        assert len({file.parents[1] for file in (kernels / "__pycache__").rglob("*.nbc")}) == 1


@pytest.mark.parametrize(("usual", "expected"), [(700, NEW_OBJECTS), (NEW_OBJECTS + 1, NEW_OBJECTS + 1), (0, 0)])
def test_garbage_is_looked_for_less_often_while_a_kernel_is_compiled_and_then_as_before(usual, expected):
    during = []

    @numba.extending.overload(call_in_a_process_of_its_own)
    def note_the_collector(_value):
        during.append((gc.isenabled(), gc.get_threshold()[0]))

    before = gc.get_threshold()
    gc.set_threshold(usual, *before[1:])
    try:
        with pytest.raises(numba.TypingError):  # a failed compilation ends like another
            compile_lazily(lambda value: call_in_a_process_of_its_own(value))(1)
        assert during and set(during) == {(True, expected)}
        assert gc.get_threshold() == (usual, *before[1:])
    finally:
        gc.set_threshold(*before)


def test_without_a_folder_to_write_to_kernels_are_compiled_anew_and_a_warning_says_what_to_set():
    kernel_cache._warn_that_nothing_is_kept.cache_clear()
    kernel_cache._cache_folder.cache_clear()
    space: dict = {}
    source = "def doubled(x):\n    return 2 * x\n\ndef halved(x):\n    return x / 2\n"
    exec(compile(source, "/a/read-only/installation/kernels.py", "exec"), space)  # for numba a file without a folder

    with pytest.warns(UserWarning, match="set NUMBA_CACHE_DIR to a folder of your own") as warned:
        doubled, halved = kernel_cache.compile_lazily(space["doubled"]), kernel_cache.compile_lazily(space["halved"])

    assert len(warned) == 1, "one warning for all kernels"
    with record_compilations(lambda name: None) as compiled:
        assert doubled(4) == 8 and halved(4) == 2.0
    assert len(compiled.kernels) == 2 and not compiled.kept


def test_a_record_names_kernels_that_are_kept_and_not_what_numba_needs_for_them(tmp_path):
    file = tmp_path / "kernels.py"
    file.write_text("import numpy as np\n\ndef ones(n):\n    return np.ones(n).sum()\n")
    space: dict = {"__name__": "kernels"}
    exec(compile(file.read_text(), str(file), "exec"), space)

    with record_compilations(lambda name: None) as compiled:
        assert compile_lazily(space["ones"])(3) == 3.0

    assert compiled.kernels == ["kernels.ones"] and compiled.kept and compiled.seconds > 0.0


@partial(compile_lazily, no_cpython_wrapper=True)
def twice(x):
    """A step without a wrapper for Python."""
    return 2 * x


@compile_lazily
def four_times(x):
    """A kernel that calls it."""
    return twice(twice(x))


def test_a_step_that_is_called_from_python_is_an_error_that_names_it():
    for _ in ("never compiled", "compiled for a kernel"):
        with pytest.raises(TypeError, match="twice is a step of other kernels, call one of those"):
            twice(3)
        assert four_times(3) == 12


def test_only_brief_kernels_keep_the_interpreters_lock():
    def step(x):
        return x + 1.0

    assert kernel(step).targetoptions["nogil"]
    assert not brief_kernel(step).targetoptions["nogil"]
    assert brief_kernel(step)(1.0) == 2.0
