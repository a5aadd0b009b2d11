"""What was in a bag and what became of it: counts, gaps and delays of topics and transforms, and what was dropped."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from mbf_abstract.geometry.transform import InvalidTransformError, Transform
from mbf_abstract.geometry.transform_problems import (
    ConnectivityError,
    ExtrapolationError,
    StaleTransformError,
    UnknownFrameError,
)

DIGITS = 6  # of seconds: recordings count microseconds


@dataclass
class Intervals:
    """The stamps [s] of something that comes again and again."""

    count: int = 0
    first: float = 0.0
    last: float = 0.0
    largest_gap: float = 0.0
    gap_at: float = 0.0
    """Where the largest gap begins [s]."""

    def take(self, stamp: float) -> None:
        """Count one; an older one than the last makes no gap."""
        if self.count == 0:
            self.first = self.last = stamp
        self.count += 1
        if stamp - self.last > self.largest_gap:
            self.largest_gap, self.gap_at = stamp - self.last, self.last
        self.last = max(self.last, stamp)

    @property
    def rate(self) -> float:
        """How many come in a second [Hz]; 0 for less than two."""
        return (self.count - 1) / (self.last - self.first) if self.last > self.first else 0.0


@dataclass
class Delays:
    """How long after their stamps [s] messages came."""

    count: int = 0
    total: float = 0.0
    largest: float = 0.0

    def take(self, delay: float) -> None:
        """Count one."""
        self.largest = delay if self.count == 0 else max(self.largest, delay)
        self.count += 1
        self.total += delay

    @property
    def mean(self) -> float:
        """The mean [s]; 0 where there is none."""
        return self.total / self.count if self.count else 0.0


@dataclass
class TopicStatistics:
    """One topic of a bag.

    Attributes
    ----------
    type, used_as : str
        Its type, and what it is replayed as; empty where it is not.
    recorded : Intervals
        When its messages were recorded.
    dropped : Counter of str
        How many messages were not used, by reason.
    dropped_by_map : Counter of str
        How many scans one map did not use and another one did, by ``map: reason``.
    examples : dict of str to str
        The first text by reason.
    placed_by_newest : int
        Scans newer than the newest transform, placed by that one: as they are live, up to ``transform_tolerance``.
    """

    type: str
    used_as: str = ""
    recorded: Intervals = field(default_factory=Intervals)
    delays: Delays = field(default_factory=Delays)
    dropped: Counter[str] = field(default_factory=Counter)
    dropped_by_map: Counter[str] = field(default_factory=Counter)
    examples: dict[str, str] = field(default_factory=dict)
    placed_by_newest: int = 0

    def drop(self, reason: str, text: str) -> None:
        """Count a message, or a transform of one, that could not be used."""
        self.dropped[reason] += 1
        self.examples.setdefault(reason, text)

    def drop_by_map(self, name: str, reason: str, text: str) -> None:
        """Count a scan that the map ``name`` could not use, and another one could."""
        self.dropped_by_map[f"{name}: {reason}"] += 1
        self.examples.setdefault(f"{name}: {reason}", text)

    def to_json(self) -> dict[str, Any]:
        """Everything, times in seconds."""
        return {
            "type": self.type,
            "used_as": self.used_as,
            **_intervals(self.recorded),
            **_delays(self.delays),
            "dropped": self._counted(self.dropped),
            "dropped_by_map": self._counted(self.dropped_by_map),
            "placed_by_newest_transform": self.placed_by_newest,
        }

    def _counted(self, dropped: Counter[str]) -> dict[str, Any]:
        return {reason: {"count": dropped[reason], "first": self.examples[reason]} for reason in sorted(dropped)}


@dataclass
class FrameStatistics:
    """The transforms of one frame to its parent; ``stamps`` are those of the transforms."""

    parent: str
    static: bool = False
    stamps: Intervals = field(default_factory=Intervals)
    delays: Delays = field(default_factory=Delays)

    def take(self, transform: Transform, now: float) -> None:
        """Count a transform that came at ``now`` [s]."""
        self.parent, self.static = transform.parent, transform.static
        self.stamps.take(transform.stamp)
        if not transform.static:
            self.delays.take(now - transform.stamp)

    def to_json(self) -> dict[str, Any]:
        """Everything, times in seconds."""
        return {"parent": self.parent, "static": self.static, **_intervals(self.stamps), **_delays(self.delays)}


def reason_of(error: Exception) -> str:
    """Why a message could not be used, in a few words: messages with the same reason are counted together."""
    if isinstance(error, ExtrapolationError):
        sides = {"into the past": "older than the transforms", "into the future": "newer than the transforms"}
        return next((name for text, name in sides.items() if text in str(error)), "outside of the transforms")
    kinds = {
        UnknownFrameError: "unknown frame",
        ConnectivityError: "frames in separate trees",
        StaleTransformError: "transforms too old",
        InvalidTransformError: "invalid transform",
    }
    return next((text for kind, text in kinds.items() if isinstance(error, kind)), "invalid message")


def _intervals(of: Intervals) -> dict[str, Any]:
    return {
        "count": of.count,
        "first_s": round(of.first, DIGITS),
        "last_s": round(of.last, DIGITS),
        "rate_hz": round(of.rate, 3),
        "largest_gap_s": round(of.largest_gap, DIGITS),
        "largest_gap_at_s": round(of.gap_at, DIGITS),
    }


def _delays(of: Delays) -> dict[str, Any]:
    if not of.count:
        return {"mean_delay_s": None, "largest_delay_s": None}
    return {"mean_delay_s": round(of.mean, DIGITS) + 0.0, "largest_delay_s": round(of.largest, DIGITS) + 0.0}  # no -0.0
