"""Values that take long to make, kept while they are asked for; for any number of threads."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class RecentlyUsed(Generic[K, V]):
    """The values that were used most recently, within a limit on the sum of their sizes; the last one always stays.

    A thread waits for no other: threads that ask for the same new value at once make it twice.

    Parameters
    ----------
    make : callable
        Key -> value. What it raises reaches the caller, and nothing is kept.
    most : float
        Limit of the sum of the sizes.
    size : callable, optional
        Size of a value; without it each counts as 1.
    """

    def __init__(self, make: Callable[[K], V], most: float, size: Callable[[V], float] = lambda value: 1.0) -> None:
        self._make, self._most, self._size = make, most, size
        self._lock = threading.Lock()  # never held while a value is made
        self._values: OrderedDict[K, V] = OrderedDict()  # least recently used first
        self._clearings = 0

    @property
    def kept_size(self) -> float:
        """Sum of the sizes of what is kept."""
        with self._lock:
            return sum(map(self._size, self._values.values()))

    def get(self, key: K) -> V:
        """The value of a key, made if it is not there."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
            begun = self._clearings
        value = self._make(key)
        with self._lock:
            if begun == self._clearings:  # else it may be made of what has changed since
                self._values[key] = value
                self._values.move_to_end(key)
                while len(self._values) > 1 and sum(map(self._size, self._values.values())) > self._most:
                    self._values.popitem(last=False)
        return value

    def clear(self) -> None:
        """Forget all; what is being made now is not kept either."""
        with self._lock:
            self._clearings += 1
            self._values.clear()
