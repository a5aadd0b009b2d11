"""Machine code of numba kernels on disk, made anew when any file of the kernels' folder has changed.

When to use: by the one decorator with which a map backend compiles its kernels. When not: for a kernel that calls none
of another file; ``cache=True`` alone is right for it.

numba keeps the machine code of a kernel for as long as the very file that defines it stays as it was. But that code
holds the kernels and constants that were taken from other files too, so that after an upgrade old steps would go on
working on new arrays (a limitation of caching that numba's manual names). Here each state of a folder's files has a
cache folder of its own.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import shutil
import tempfile
import threading
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core import event
from numba.core.registry import CPUDispatcher

from mbf_abstract.compiling.compilation import CompilerClock
from mbf_abstract.compiling.garbage import PatientCollector
from mbf_abstract.compiling.shared_cache import share_cache
from mbf_abstract.compiling.sources import read_source_files

_OPTIONS: dict[str, Any] = {"nogil": True, "no_cfunc_wrapper": True}
"""Kernels run without the interpreter lock; none is called from C, so the wrapper for that is not compiled."""
_deciding_where = threading.Lock()


class StepDispatcher(CPUDispatcher):  # type: ignore[misc]
    """Stands in for a step that was compiled without a wrapper for Python, which would be run all the same."""

    def __call__(self, *arguments: Any) -> Any:
        """Refuse the call: it would jump to address 0."""
        raise TypeError(f"{self.py_func.__qualname__} is a step of other kernels, call one of those")


def compile_lazily(function: Callable[..., Any], **options: Any) -> Any:
    """Compile ``function`` at its first call, without the interpreter lock, and keep the machine code on disk.

    It is kept in NUMBA_CACHE_DIR, beside the source or in the user's home. Where none of them can be written to, as in
    a read-only installation, every process compiles anew, and a warning says so and what to set.

    Parameters
    ----------
    function : callable
        The kernel; the kernels it calls stand in the same folder.
    **options
        Further options of ``numba.njit``.

    Returns
    -------
    dispatcher
        numba's stand-in for the function; the function itself where NUMBA_DISABLE_JIT asks for that, to debug it.
    """
    if config.DISABLE_JIT:
        return function
    cache = cache_folder(Path(inspect.getfile(function)))
    if cache is None:
        return _stand_in(function, options)
    with _deciding_where:  # numba asks for the folder once, when it wraps the function
        usual, config.CACHE_DIR = config.CACHE_DIR, str(cache)
        try:
            return share_cache(_stand_in(function, options), function)
        finally:
            config.CACHE_DIR = usual


def _stand_in(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    dispatcher = njit(**{**_OPTIONS, **options})(function)
    if options.get("no_cpython_wrapper"):
        dispatcher.__class__ = StepDispatcher
    return dispatcher


def cache_folder(file: Path) -> Path | None:
    """Return the folder for the machine code of a file's kernels, as all around it are now; None: there is none."""
    return _cache_folder(_folder_of_kernels(file))


def _folder_of_kernels(file: Path) -> Path:
    """Return the folder named ``kernels`` that a file is in, at any depth, else the file's own folder."""
    return next((folder for folder in file.parents if folder.name == "kernels"), file.parent)


@lru_cache
def _cache_folder(kernels: Path) -> Path | None:
    """Folder for the machine code of the kernels as they are now; those of earlier versions are removed."""
    name = "kernels-" + hashlib.sha256(str(kernels.absolute()).encode()).hexdigest()[:16]
    for place in (config.CACHE_DIR, kernels / "__pycache__", os.path.expanduser("~/.cache/mbf-flex")):
        folder = Path(place, name, _sources(kernels, Path(__file__).parent))
        try:
            if not place or not kernels.is_dir():
                continue
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        for other in folder.parent.iterdir():
            if other != folder:
                shutil.rmtree(other, ignore_errors=True)
        return folder
    _warn_that_nothing_is_kept()
    return None


def _sources(*folders: Path) -> str:
    """Digest of all Python files of folders and those below them: the kernels, and how they are compiled."""
    digest = hashlib.sha256()
    for folder in folders:
        for file, content in read_source_files(folder, ".py"):
            digest.update(file.relative_to(folder).as_posix().encode() + b"\0" + content + b"\0")
    return digest.hexdigest()[:16]


@lru_cache
def _warn_that_nothing_is_kept() -> None:
    stated = f"NUMBA_CACHE_DIR ({config.CACHE_DIR}), " if config.CACHE_DIR else ""
    text = (
        f"compiled kernels cannot be kept, so every process compiles them anew: neither {stated}the folder of the "
        "package nor the home folder can be written to; set NUMBA_CACHE_DIR to a folder of your own"
    )
    warnings.warn(text, stacklevel=4)


class _CompilerWatch(event.Listener):  # type: ignore[misc]
    """Reports compilations to those who watch calls; numba notifies it while it holds its lock, a thread at a time."""

    def __init__(self) -> None:
        self._clock = CompilerClock()
        self._collector = PatientCollector()
        self._depth = 0

    def on_start(self, event: event.Event) -> None:
        """A compilation begins, perhaps within another one."""
        self._depth += 1
        if self._depth == 1:
            self._collector.begin()
        dispatcher = event.data["dispatcher"]
        function = dispatcher.py_func
        self._clock.start(f"{function.__module__}.{function.__qualname__}", dispatcher.stats.cache_path is not None)

    def on_end(self, _event: event.Event) -> None:
        """A compilation has ended, or failed."""
        self._clock.end()
        self._depth -= 1
        if self._depth == 0:
            self._collector.end()


event.register("numba:compile", _CompilerWatch())
