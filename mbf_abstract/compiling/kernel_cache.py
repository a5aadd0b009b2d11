"""Machine code of numba kernels on disk, made anew when any file of the kernels' folder has changed.

When to use: by the one decorator with which a map backend compiles its kernels. When not: for a kernel that calls none
of another file; ``cache=True`` alone is right for it.

numba keeps the machine code of a kernel for as long as the very file that defines it stays as it was. But that code
holds the kernels and constants that were taken from other files too, so that after an upgrade old steps would go on
working on new arrays (a limitation of caching that numba's manual names). Here all files of the folder count as the
source of each kernel in it.
"""

from __future__ import annotations

import gc
import hashlib
import inspect
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core import event
from numba.core.caching import IndexDataCacheFile, NullCache

from mbf_abstract.compiling.compilation import CompilerClock


def compile_lazily(function: Callable[..., Any], **options: Any) -> Any:
    """Compile ``function`` at its first call, without the interpreter lock, and keep the machine code on disk.

    Where neither the package's folder nor the user's home can be written to, as in a read-only installation, nothing is
    kept: every process compiles anew, and a warning says so and what to set.

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
    try:
        dispatcher = njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # numba found no folder that it may write to
        _tell_that_nothing_is_kept()
        return njit(nogil=True, **options)(function)
    cache = dispatcher._cache
    stamp = _sources(_folder_of_kernels(Path(inspect.getfile(function))))
    # numba has no option for this; its own constructor makes the same object with the stamp of one file.
    cache._cache_file = IndexDataCacheFile(cache.cache_path, cache._impl.filename_base, stamp)
    return dispatcher


@lru_cache
def _tell_that_nothing_is_kept() -> None:
    text = (
        "compiled kernels cannot be kept, so every process compiles them anew: neither the folder of the package nor "
        "the home folder can be written to; set NUMBA_CACHE_DIR to a folder of your own"
    )
    warnings.warn(text, stacklevel=3)


def _folder_of_kernels(file: Path) -> Path:
    """Return the folder named ``kernels`` that a file is in, at any depth, else the file's own folder."""
    return next((folder for folder in file.parents if folder.name == "kernels"), file.parent)


@lru_cache
def _sources(folder: Path) -> bytes:
    """Digest of all Python files of a folder and those below it."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        digest.update(file.relative_to(folder).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.digest()


class _CompilerWatch(event.Listener):  # type: ignore[misc]
    """Tells who watches calls, and lets Python's search for cyclic garbage wait while numba compiles.

    The search cost a tenth of every compilation. The compiler makes some hundred thousand objects and keeps them until
    it is done, so the collector searches them, and all others of the process, again and again in vain. numba tells of
    start and end while it holds its lock, so one count of the compilations within each other is right for all threads.
    """

    depth = 0
    was_enabled = False
    clock = CompilerClock()

    def on_start(self, event: event.Event) -> None:
        """A compilation begins, perhaps within another one."""
        dispatcher = event.data["dispatcher"]
        function = dispatcher.py_func
        kept = not isinstance(dispatcher._cache, NullCache)
        self.clock.start(f"{function.__module__}.{function.__qualname__}", kept)
        if self.depth == 0:
            self.was_enabled = gc.isenabled()
            gc.disable()
        self.depth += 1

    def on_end(self, _event: event.Event) -> None:
        """A compilation has ended, or failed."""
        self.depth -= 1
        if self.depth == 0 and self.was_enabled:
            gc.enable()
        self.clock.end()


event.register("numba:compile", _CompilerWatch())
