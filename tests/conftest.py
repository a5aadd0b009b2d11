"""Fixtures that every test may use."""

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from numba.core import event

REPOSITORY = Path(__file__).resolve().parent.parent

# The same examples on every machine, however slow it is; HYPOTHESIS_PROFILE=explore looks for new ones.
settings.register_profile("repeat", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeat"))

LONGEST = ("unit/actions/test_interleavings.py", "determinism/", "system/ros2/test_actions_and_services.py")
"""Files of minutes. A worker takes a file whole, so these come first: the last ones to begin are short."""
WAITING = ("system/ros2/", "system/rosbridge/", "system/npm/", "unit/viewer/")
"""Files that mostly wait, for other processes and for pages. All at once they would leave the processors idle."""


class UncountedCompiler(event.Listener):
    """Holds the time limit of a test while numba compiles, on any thread, as patience of the product is held.

    The kernels of one planner are half a minute of CPU on a machine that has none; beside eight other programs that is
    more than the two minutes that a test has.
    """

    def __init__(self) -> None:
        self._depth, self._left = 0, 0.0

    def on_start(self, event: event.Event) -> None:
        """A compilation begins, perhaps within another one."""
        self._depth += 1
        if self._depth == 1:
            self._left, _ = signal.setitimer(signal.ITIMER_REAL, 0.0)

    def on_end(self, event: event.Event) -> None:
        """It has ended; its test, whose limit goes on, perhaps before."""
        self._depth -= 1
        test_runs = callable(signal.getsignal(signal.SIGALRM)) and signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
        if self._depth == 0 and self._left > 0.0 and test_runs:
            signal.setitimer(signal.ITIMER_REAL, self._left)


if hasattr(signal, "setitimer"):  # elsewhere than on Windows; it is what pytest-timeout uses
    event.register("numba:compile", UncountedCompiler())


@pytest.fixture(scope="module")
def one_core() -> Iterator[None]:
    """For drives in simulated time: their threads run by turns, and handing a turn to another core doubles its cost.

    As a batch they do not interrupt who hands them their turn and still has the interpreter: a third of its cost.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores, policy = sorted(os.sched_getaffinity(0)), os.sched_getscheduler(0)
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    os.sched_setaffinity(0, {cores[worker % len(cores)]})  # of this thread, and of what it starts
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    yield
    os.sched_setscheduler(0, policy, os.sched_param(0))
    os.sched_setaffinity(0, cores)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real maps, meshes and terrains: $MBF_DATA, or ../shared/data beside the clone."""
    folder = Path(os.environ.get("MBF_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no shared data at {folder}; set MBF_DATA to the folder that holds maps/ and meshes/")
    return folder


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep the garbage collector off the 600,000 objects of modules and tests, which stay."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first, and spread those that wait evenly among the others."""

    def is_of(parts: tuple[str, ...], file: Path) -> bool:
        return any(f"tests/{part}" in file.as_posix() for part in parts)

    files, place = dict.fromkeys(item.path for item in items), dict[Path, float]()
    for waits in (True, False):
        group = [file for file in files if is_of(WAITING, file) == waits]
        place |= {file: (number + 0.5) / len(group) for number, file in enumerate(group)}
    items.sort(key=lambda item: (not is_of(LONGEST, item.path), place[item.path]))


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """In CI everything a test needs is there: a skipped test is a failure."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    skipped = reporter.stats.get("skipped", []) if reporter is not None else []
    if os.environ.get("CI") and skipped and exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        reporter.write_line(f"{len(skipped)} test(s) were skipped; in CI nothing may be", red=True)
