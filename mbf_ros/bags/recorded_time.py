"""The clock of a replay: 0 at the whole second before a bag begins, and stamps of messages on the same clock.

A bag that was recorded while a simulator gave the time has stamps that have nothing to do with the times at which its
messages were recorded. The stamps are then moved so that the first messages come as fast as the fastest of them did.

Simulated time passes in steps of a tenth of a second, so a recording whose own clock jumps by years would not end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import datetime, timezone
from itertools import islice
from typing import Any

from mbf_ros.bags.reading import Bag, BagError, Recorded
from mbf_ros.bags.topics import BagTopics
from mbf_ros.messages.geometry import NANOSECONDS, MessageContext
from mbf_ros.messages.interfaces import Message, MessageError

OTHER_CLOCK = 10.0
"""Messages that come later than this [s], or so much too early, are stamped by another clock."""
LOOKED_AT = 100  # messages
LONGEST_GAP, LONGEST_BAG = 3600, 24 * 3600  # s that are replayed, between two messages and in all


class RecordedTime:
    """Times of a bag on our clock.

    Parameters
    ----------
    topics : BagTopics
        Whose stamps are looked at.
    global_frame : str
        Frame that is meant where a message names none.

    Attributes
    ----------
    began : float
        When the first message was recorded [s], below 1.
    duration : float
        Length of the bag [s].
    stamp_shift : float
        By how much [s] stamps were moved; 0 where they are of the clock that recorded.
    context : MessageContext
        For stamps of messages.

    Raises
    ------
    BagError
        The bag is too long, or nothing was recorded for too long.
    """

    def __init__(self, bag: Bag, topics: BagTopics, global_frame: str) -> None:
        if bag.end - bag.start > LONGEST_GAP * NANOSECONDS:
            for _ in steady_messages(bag):  # before anything is replayed
                pass
        self._epoch = bag.start // NANOSECONDS
        self.began = self.of_recording(bag.start)
        self.duration = (bag.end - bag.start) / NANOSECONDS
        plain = MessageContext(global_frame, float(self._epoch))
        lags = sorted(self._lags(bag, topics, plain))
        median = lags[len(lags) // 2] if lags else 0.0
        near = (lag for lag in lags if abs(lag - median) <= OTHER_CLOCK)  # not a single stamp that means nothing
        self.stamp_shift = next(near) if abs(median) > OTHER_CLOCK else 0.0
        self.context = MessageContext(global_frame, self._epoch - self.stamp_shift)

    def of_recording(self, time: int) -> float:
        """Our time [s] of the time at which a message was recorded [ns]."""
        return (time - self._epoch * NANOSECONDS) / NANOSECONDS

    def _lags(self, bag: Bag, topics: BagTopics, context: MessageContext) -> list[float]:
        """How long after their stamps [s] the first messages were recorded."""
        stamped = {topics.transforms, topics.odometry, *topics.sensors} - {""}
        lags = []
        for recorded in islice((one for one in bag.messages() if one.topic in stamped), LOOKED_AT):
            try:
                stamp = first_stamp(bag.decode(recorded))
            except MessageError:
                continue
            if stamp is not None and (time := context.stamp(stamp)):
                lags.append(self.of_recording(recorded.time) - time)
        return lags


def steady_messages(bag: Bag) -> Iterator[Recorded]:
    """All messages of a bag; raises BagError where the clock that recorded them jumps.

    The times of a bag as a whole are checked by the messages themselves, as they may be written wrongly, too.
    """
    last = bag.start
    for recorded in bag.messages():
        _check_step(bag, last, recorded.time)
        last = max(last, recorded.time)
        yield recorded
    _check_step(bag, last, bag.end)


def _check_step(bag: Bag, last: int, time: int) -> None:
    if time - last > LONGEST_GAP * NANOSECONDS:
        jump = f"a message of {_date(last)} is followed by one of {_date(time)}"
        raise BagError(f"{bag.path}: {jump}; allowed are {LONGEST_GAP} s without messages")
    if time - bag.start > LONGEST_BAG * NANOSECONDS:
        span = f"the bag goes from {_date(bag.start)} to {_date(max(time, bag.end))}"
        raise BagError(f"{bag.path}: {span}; allowed are {LONGEST_BAG} s")


def _date(time: int) -> str:
    return datetime.fromtimestamp(time // NANOSECONDS, timezone.utc).strftime("%Y-%m-%d %H:%M:%S UTC")


def check_seconds(option: str, seconds: float) -> None:
    """Raise ValueError for an option in seconds that is negative or NaN."""
    if not seconds >= 0.0:
        raise ValueError(f"{option}: expected 0 s or more, got {seconds}")


def check_end(option: str, seconds: float, bag: Bag) -> None:
    """Raise ValueError for an option in seconds from the beginning of a bag that is after its end and finite."""
    duration = (bag.end - bag.start) / NANOSECONDS
    if duration < seconds < math.inf:
        raise ValueError(f"{option}: expected at most {duration:.3f} s, where the bag ends, got {seconds:g} s")


def first_stamp(message: Message) -> dict[str, Any] | None:
    """Return the stamp of a message, or of the first of its transforms; None where it has none."""
    transforms = message.get("transforms")
    header = transforms[0]["header"] if transforms else message.get("header")
    stamp: dict[str, Any] | None = None if header is None else header["stamp"]
    return stamp
