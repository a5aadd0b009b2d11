"""The cancel token: made when a goal is accepted, set at most once, never reset.

Plugins poll ``token.cancelled`` (or hand ``token.flag`` to a numba kernel, which polls it without the interpreter
lock) and return their CANCELED outcome. A token that is set before the plugin starts is honoured too.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray


class CancelToken:
    """One goal's wish to end, visible to Python code and to compiled kernels.

    Attributes
    ----------
    flag : (1,) uint8
        0, or 1 once cancelled. Kernels read it every few hundred steps; only ``cancel`` may write it.
    reason : str
        Why, empty while the token is not set.
    """

    __slots__ = ("_callbacks", "_lock", "flag", "reason")

    def __init__(self) -> None:
        self.flag: NDArray[np.uint8] = np.zeros(1, dtype=np.uint8)
        self.reason = ""
        self._callbacks: list[Callable[[], None]] = []
        self._lock = threading.Lock()  # held for a few assignments only, never while a callback runs

    @property
    def cancelled(self) -> bool:
        """Whether the goal is to end."""
        return bool(self.flag[0])

    def on_cancel(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` once when the token is set, at once if it is set already."""
        with self._lock:
            if not self.cancelled:
                self._callbacks.append(callback)
                return
        callback()

    def cancel(self, reason: str = "canceled by the client") -> bool:
        """Set the token; return whether this call was the one that set it."""
        with self._lock:
            if self.cancelled:
                return False
            self.reason = reason
            self.flag[0] = 1
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback()
        return True
