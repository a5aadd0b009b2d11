"""Kernels compiled in a second process: on disk for the first one, at the cost of nobody where that cannot be."""

import os
import subprocess
import sys

import pytest
from numba.core.caching import FunctionCache

from mbf_abstract.compiling import ahead, kernel_cache
from mbf_abstract.compiling.ahead import LOCK, compile_from_the_end, compiling_ahead, mark_of
from mbf_abstract.compiling.shared_cache import locked, try_to_lock

MODULE = "few.kernels.first_start"
DECORATOR = "from mbf_abstract.compiling.kernel_cache import compile_lazily as kernel\n"
SEARCH = DECORATOR + "@kernel\ndef search(x):\n    return 10 * x\n"
BROKEN = DECORATOR + "@kernel\ndef broken(x):\n    return x.nothing\n"
FIRST_START = """
from few.kernels.broken import broken
from few.kernels.search import search

def kernels():
    return [(search, (1,)), (broken, (1,))]
"""
CALL = "from few.kernels.search import search; print(search(1), sum(search.stats.cache_hits.values()))"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with a kernel that a first start needs, one that cannot be compiled, and a cache of its own."""
    folder = tmp_path / "few" / "kernels"
    folder.mkdir(parents=True)
    for file, text in {"search": SEARCH, "broken": BROKEN, "first_start": FIRST_START}.items():
        (folder / f"{file}.py").write_text(text)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    monkeypatch.setattr(kernel_cache.config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(tmp_path)
    remembered = kernel_cache._cache_folder
    remembered.cache_clear()
    yield tmp_path
    for name in [name for name in sys.modules if name.partition(".")[0] == "few"]:
        del sys.modules[name]
    remembered.cache_clear()


def value_and_hits():
    """Return what a kernel returns in a process of its own, and how often its code came from the disk."""
    done = subprocess.run([sys.executable, "-c", CALL], check=True, capture_output=True, text=True)
    return tuple(map(int, done.stdout.split()))


def started(monkeypatch, cores=2):
    """The processes that a command starts."""
    processes = []

    class Process(subprocess.Popen):
        def __init__(self, *arguments, **options):
            processes.append(self)
            super().__init__(*arguments, **options)

    monkeypatch.setattr(ahead.subprocess, "Popen", Process)
    monkeypatch.setattr(ahead, "_cores", lambda: cores)
    return processes


def test_what_the_second_process_has_compiled_is_found_by_the_next_and_no_other_process_is_started(
    package, monkeypatch, capfd
):
    processes = started(monkeypatch)
    with compiling_ahead(MODULE) as look_after:
        assert processes[0].wait() == 0
        look_after()
    assert mark_of(MODULE).exists()
    with compiling_ahead(MODULE):
        assert len(processes) == 1
    assert capfd.readouterr() == ("", ""), "what cannot be compiled is an error where it is used"
    assert value_and_hits() == (10, 1)


def test_the_second_process_is_gone_when_the_command_ends(package, monkeypatch):
    processes = started(monkeypatch)
    with pytest.raises(KeyboardInterrupt), compiling_ahead(MODULE):
        raise KeyboardInterrupt
    assert processes[0].returncode is not None


def test_it_ends_with_its_parent_and_has_not_been_through_then(package):
    compile_from_the_end(MODULE, parent=os.getppid() + 1)
    assert not mark_of(MODULE).exists() and not list(package.rglob("*.nbc"))


def test_of_two_first_runs_at_once_one_compiles_ahead(package):
    with try_to_lock(mark_of(MODULE).parent / LOCK):
        compile_from_the_end(MODULE, os.getppid())
        assert not mark_of(MODULE).exists()
    compile_from_the_end(MODULE, os.getppid())
    assert mark_of(MODULE).exists()


def test_on_one_core_nothing_is_compiled_ahead(package, monkeypatch):
    processes = started(monkeypatch, cores=1)
    with compiling_ahead(MODULE):
        assert processes == []


@pytest.mark.filterwarnings("ignore:compiled kernels cannot be kept")
def test_without_a_folder_to_write_to_nothing_is_compiled_ahead(package, monkeypatch):
    monkeypatch.setattr(kernel_cache, "_cache_folder", lambda kernels: None)
    processes = started(monkeypatch)
    with compiling_ahead(MODULE):
        assert processes == []


@pytest.mark.parametrize("module", ["", "few.kernels.nothing", "nobody.kernels.first_start"])
def test_a_package_that_names_no_kernels_has_none_compiled_ahead(package, monkeypatch, module):
    processes = started(monkeypatch)
    with compiling_ahead(module):
        assert processes == []


def test_one_process_at_a_time_writes_to_the_disk(package, monkeypatch):
    held = []

    def save(cache, signature, code):
        held.append(try_to_lock(package / "probe"))
        held.append(try_to_lock(next(iter(package.rglob(".lock")))))

    monkeypatch.setattr(FunctionCache, "save_overload", save)
    from few.kernels.search import search

    assert search(1) == 10
    free, taken = held
    assert free is not None and taken is None
    free.close()


def test_where_there_is_no_lock_to_be_had_the_code_is_written_all_the_same(tmp_path):
    (tmp_path / "file").touch()
    with locked(tmp_path / "file" / ".lock"):
        assert try_to_lock(tmp_path / "file" / ".lock") is None
