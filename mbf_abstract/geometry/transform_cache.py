"""The recent history of one frame: transforms to its parent, ordered by time.

Samples may come in any order. Those older than the newest by more than the window are forgotten. Between two samples
with the same parent the transform is interpolated; where the parent changed, the older one holds until the next.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping
from operator import attrgetter

from mbf_abstract.geometry.transform import Transform

MAX_SAMPLES = 10_000

_by_stamp = attrgetter("stamp")


class TransformCache:
    """Samples of one child frame.

    Parameters
    ----------
    window : float
        Length of the history [s].
    """

    def __init__(self, window: float) -> None:
        self.window = window
        self._samples: list[Transform] = []  # oldest first; of equal stamps the last inserted comes last
        self._received = math.inf  # when the newest sample came

    def __len__(self) -> int:
        return len(self._samples)

    def __iter__(self) -> Iterator[Transform]:
        """Iterate from the newest to the oldest."""
        return reversed(self._samples)

    @property
    def newest(self) -> Transform:
        """The newest sample; a cache has at least one."""
        return self._samples[-1]

    @property
    def oldest(self) -> Transform:
        """The oldest kept sample."""
        return self._samples[0]

    @property
    def fresh_at(self) -> float:
        """Time [s] up to which the newest sample is known to hold: its stamp, but never later than it came."""
        return min(self.newest.stamp, self._received)

    def insert(self, sample: Transform, received: float = math.inf) -> bool:
        """Keep a sample that came at the time ``received`` [s]; False if it is a duplicate or older than the window.

        A static transform replaces the history, and a moving one replaces a static one.
        """
        if not self._samples or sample.static or self.newest.static:
            self._samples = [sample]
            self._received = received
            return True
        if sample.stamp < self.newest.stamp - self.window:
            return False
        index = bisect_right(self._samples, sample.stamp, key=_by_stamp)
        first = bisect_left(self._samples, sample.stamp, key=_by_stamp)
        if sample in self._samples[first:index]:
            return False
        self._samples.insert(index, sample)
        if index == len(self._samples) - 1:
            self._received = received
        self._prune()
        return True

    def at(self, stamp: float) -> Transform | None:
        """Return the transform at ``stamp``, interpolated; None outside the kept history."""
        if self.newest.static:
            return self.newest
        index = bisect_right(self._samples, stamp, key=_by_stamp)
        if index == 0:
            return None
        earlier = self._samples[index - 1]
        if earlier.stamp == stamp:
            return earlier
        if index == len(self._samples):
            return None
        later = self._samples[index]
        return earlier.interpolate(later, stamp) if earlier.parent == later.parent else earlier

    def forget_after(self, stamp: float) -> bool:
        """Drop the moving samples later than ``stamp`` [s]; False if none is left."""
        if not self.newest.static:
            del self._samples[bisect_right(self._samples, stamp, key=_by_stamp) :]
        return bool(self._samples)

    def _prune(self) -> None:
        limit = self.newest.stamp - self.window
        keep_from = max(len(self._samples) - MAX_SAMPLES, 0)
        while self._samples[keep_from].stamp < limit:
            keep_from += 1
        del self._samples[:keep_from]


def steps_up(caches: Mapping[str, TransformCache], frame: str, time: float | None = None) -> list[Transform]:
    """Steps from a frame up to the root, or to the first frame whose history does not cover the time.

    Parameters
    ----------
    caches : mapping of str to TransformCache
        By the names of child frames.
    time : float, optional
        [s]; the newest of each frame if not given.
    """
    steps: list[Transform] = []
    while (cache := caches.get(frame)) is not None and len(steps) <= len(caches):
        step = cache.newest if time is None else cache.at(time)
        if step is None:
            break
        steps.append(step)
        frame = step.parent
    return steps
