"""Freshness of the sensors of a layer.

A robot whose sensor is silent would drive into what it no longer sees. So ``expected_update_rate`` is on by default: a
layer with a late source makes the whole map stale.
"""

from __future__ import annotations

from collections.abc import Iterable

from mbf_abstract.maps.sensing import MAX_STAMP_LEAD


class SourceWatch:
    """Freshness of one observation source of a layer.

    The age of a source is that of its last observation, not of its newest stamp: a single stamp from the future would
    otherwise cover its silence. A stamp from the future is a problem until the source sends another one. A source is
    stale, too, as long as nothing of it is in the map: at the start, and after the map was cleared.

    Parameters
    ----------
    name : str
        Name of the source, for messages.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._last: float | None = None
        self._in_map = False
        self._before_clearing: float | None = None  # stamp of the last observation of which the map lost something

    def heard(self, stamp: float) -> None:
        """Note an observation made at ``stamp`` [s]."""
        self._last = stamp

    def used(self) -> None:
        """Note that an update has put an observation into the map."""
        self._in_map, self._before_clearing = True, None

    def cleared(self) -> None:
        """Note that the map has lost what the source saw: it must not be driven on before the next scan."""
        self._in_map, self._before_clearing = False, self._last

    def awaits_scan(self, now: float, limit: float) -> bool:
        """Whether nothing of it is in the map since it was cleared, and its next observation may come in time.

        That is up to ``limit`` [s] after the last one before the clearing. Whoever waits longer may wait for ever, for
        a sensor that has failed, or one whose observations a layer does not use.
        """
        before = self._before_clearing
        return limit > 0.0 and before is not None and -MAX_STAMP_LEAD <= now - before <= limit

    def stale_reason(self, now: float, limit: float) -> str:
        """Why the source is stale at ``now`` [s] if it may be silent for ``limit`` [s], 0 = for ever; "" if fresh."""
        if limit == 0.0:
            return ""
        if self._last is None:
            return f"observation source {self.name!r} has not sent anything yet"
        age = now - self._last
        if age < -MAX_STAMP_LEAD:
            return f"observation source {self.name!r} is stamped {-age:.2f} s in the future; check its clock"
        if age > limit:
            return f"observation source {self.name!r} is silent for {age:.2f} s, expected every {limit:.2f} s"
        return "" if self._in_map else f"nothing of observation source {self.name!r} is in the map since it was cleared"


def first_reason(reasons: Iterable[str]) -> str:
    """The first reason that is not empty; empty if all are."""
    return next((reason for reason in reasons if reason), "")
