"""Compiling the kernels of a first start in a second process, the last needed first, while the first one begins.

When to use: around a command that is going to need all of them, on a machine with two cores. When not: for a short
call, which ends before the other process has begun.

``compiling_ahead`` starts ``python -m mbf_abstract.compiling.ahead MODULE PARENT``. The module's ``kernels()`` returns
kernels with examples of their arguments, in the order in which a first start needs them. The process takes them from
the end; where both meet, the command finds the rest on disk. It says nothing, is never waited for, and ends with its
parent. Nothing depends on it: what it has not compiled is compiled at its first use. Once it is through, a mark in the
cache's folder says so (decision 0075).
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

BACKGROUND = 5
"""By how much the other process is nicer than its parent, which goes first where cores are scarce."""
LOCK = "ahead.lock"


@contextmanager
def compiling_ahead(module: str) -> Iterator[Callable[[], None]]:
    """Compile the kernels of ``module`` in a process of its own, unless they are on disk; it is ended at the end.

    Yields what is called now and then, so that a process that has ended leaves nothing behind.
    """
    process = _started(module)

    def look_after() -> None:
        if process is not None:
            process.poll()

    try:
        yield look_after
    finally:
        if process is not None:
            process.kill()
            process.wait()


def _started(module: str) -> subprocess.Popen[bytes] | None:
    if _cores() < 2 or not sys.executable:
        return None
    mark = mark_of(module)
    if mark is None or mark.exists():
        return None
    command = [sys.executable, "-m", "mbf_abstract.compiling.ahead", module, str(os.getpid())]
    with suppress(OSError):  # no process to be had: all is compiled here
        return subprocess.Popen(
            command,
            env=os.environ | {"PYTHONSAFEPATH": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # a Ctrl-C is for the parent, which ends this process
        )
    return None


def mark_of(module: str) -> Path | None:
    """Return the file that says that the kernels of ``module`` are on disk, there or not; None: they cannot be kept.

    Machine code is of one processor, so the name has that of this one; a home folder may be shared.
    """
    import llvmlite.binding
    import numba

    from mbf_abstract.compiling.kernel_cache import cache_folder
    from mbf_abstract.compiling.shared_cache import CAN_LOCK

    try:
        found = find_spec(module)
    except (ImportError, ValueError):  # a package without such a module
        return None
    if found is None or found.origin is None or numba.config.DISABLE_JIT or not CAN_LOCK:
        return None
    folder = cache_folder(Path(found.origin))
    processor = f"{platform.python_version()}-{numba.__version__}-{llvmlite.binding.get_host_cpu_name()}"
    return folder and folder / f"ahead-{processor}"


def _cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def compile_from_the_end(module: str, parent: int) -> None:
    """Compile the kernels of ``module``, the last first, as long as the parent lives and no other process does so."""
    from mbf_abstract.compiling.shared_cache import try_to_lock

    mark = mark_of(module)
    lock = None if mark is None else try_to_lock(mark.parent / LOCK)
    if mark is None or lock is None:
        return
    with lock:
        for kernel, arguments in reversed(import_module(module).kernels()):
            if os.getppid() != parent:
                return
            with suppress(Exception):  # where the kernel is used, the error is shown
                _compile(kernel, arguments)
        with suppress(OSError):
            mark.touch()


def _compile(kernel: Any, arguments: tuple[Any, ...]) -> None:
    """Compile a kernel for arguments such as these, or load it, without calling it."""
    from numba import typeof

    kernel.compile(tuple(typeof(argument) for argument in arguments))


if __name__ == "__main__":
    if hasattr(os, "nice"):
        os.nice(BACKGROUND)
    compile_from_the_end(sys.argv[1], int(sys.argv[2]))
