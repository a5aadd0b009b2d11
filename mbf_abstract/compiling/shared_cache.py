"""Machine code on disk that several processes add to: one at a time writes, so that no index names another one's code.

numba chooses the name of a data file by its index and then writes both. Two processes that compile one kernel for
different types at the same moment would give both the same name, and one would run the code of the other.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

import numba.cpython.hashing  # noqa: F401  machine code that hashes texts asks for what it announces
from numba.core.caching import FunctionCache
from numba.core.runtime import rtsys

if sys.platform != "win32":  # processes there write without waiting for each other
    import fcntl

CAN_LOCK = sys.platform != "win32"


class SharedCache(FunctionCache):  # type: ignore[misc]
    """numba's own cache of a function, which waits while another process writes to the same folder.

    What is on disk is loaded without numba's registries of what can be compiled, which it takes in by itself before it
    compiles: a start at which nothing is compiled does not need them, and they are 0.5 s of its CPU.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the machine code for one signature; None: there is none."""
        rtsys.initialize(target_context)  # machine code takes memory for arrays from it
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the machine code for one signature; without room for it on the disk a warning says so, once."""
        try:
            with locked(Path(self.cache_path) / ".lock"):
                super().save_overload(sig, data)
        except OSError as error:
            _warn_that_it_is_not_kept(str(Path(self.cache_path).parent), error.strerror or str(error))


@lru_cache
def _warn_that_it_is_not_kept(folder: str, reason: str) -> None:
    warnings.warn(f"compiled kernels cannot be kept in {folder}: {reason}", stacklevel=3)


def share_cache(dispatcher: Any, function: Callable[..., Any]) -> Any:
    """Let a dispatcher of numba keep its code in a ``SharedCache``, as its ``enable_caching`` does in numba's own."""
    dispatcher._cache = SharedCache(function)
    return dispatcher


@contextmanager
def locked(file: Path) -> Iterator[None]:
    """Hold the lock of a file; where the file system has none, go on without."""
    stream: IO[bytes] | None = None
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        stream = file.open("ab")
        if sys.platform != "win32":
            fcntl.flock(stream, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if stream is not None:
            stream.close()


def try_to_lock(file: Path) -> IO[bytes] | None:
    """Take the lock of a file without waiting; it is held until what is returned is closed. None: another has it."""
    if sys.platform == "win32":
        return None
    try:
        stream = file.open("ab")
    except OSError:
        return None
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        stream.close()
        return None
    return stream
