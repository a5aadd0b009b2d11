"""The clock of a replay: 0 at the whole second before a bag begins, and stamps of messages on the same clock.

A bag that was recorded while a simulator gave the time has stamps that have nothing to do with the times at which its
messages were recorded. The stamps are then moved so that the first messages come as fast as the fastest of them did.
"""

from __future__ import annotations

from itertools import islice
from typing import Any

from mbf_ros.bags.reading import Bag
from mbf_ros.bags.topics import BagTopics
from mbf_ros.messages.geometry import NANOSECONDS, MessageContext
from mbf_ros.messages.interfaces import Message, MessageError

OTHER_CLOCK = 10.0
"""Messages that come later than this [s], or so much too early, are stamped by another clock."""
LOOKED_AT = 100  # messages


class RecordedTime:
    """Times of a bag on our clock.

    Parameters
    ----------
    bag : Bag
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
    """

    def __init__(self, bag: Bag, topics: BagTopics, global_frame: str) -> None:
        self._epoch = bag.start // NANOSECONDS
        self.began = self.of_recording(bag.start)
        self.duration = (bag.end - bag.start) / NANOSECONDS
        plain = MessageContext(global_frame, float(self._epoch))
        lags = sorted(self._lags(bag, topics, plain))
        is_other = bool(lags) and abs(lags[len(lags) // 2]) > OTHER_CLOCK
        self.stamp_shift = lags[0] if is_other else 0.0
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


def first_stamp(message: Message) -> dict[str, Any] | None:
    """Return the stamp of a message, or of the first of its transforms; None where it has none."""
    transforms = message.get("transforms")
    header = transforms[0]["header"] if transforms else message.get("header")
    stamp: dict[str, Any] | None = None if header is None else header["stamp"]
    return stamp
