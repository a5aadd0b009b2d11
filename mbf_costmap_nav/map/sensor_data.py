"""What a sensor saw, kept until the costmap's next update, and the limits of its source."""

from __future__ import annotations

import threading
from collections import deque

from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.maps.sensing import MAX_STAMP_LEAD, RangeScan
from mbf_abstract.parameters import ParameterModel, parameter

MAX_OBSERVATIONS = 256
"""Bound of the memory of one source, however long its persistence."""


class SourceTiming(ParameterModel):
    """How often a sensor must send."""

    expected_update_rate: float = parameter(
        1.0, "Longest allowed time between two observations; 0 switches the check off.", unit="s", ge=0.0
    )


class SourceParameters(SourceTiming):
    """One observation source of a layer."""

    marking: bool = parameter(True, "Whether hits of this source put obstacles on the map.")
    clearing: bool = parameter(True, "Whether rays of this source remove obstacles along them.")
    obstacle_max_range: float = parameter(2.5, "Hits farther than this are not marked.", unit="m", gt=0.0)
    obstacle_min_range: float = parameter(0.0, "Hits nearer than this are not marked.", unit="m", ge=0.0)
    raytrace_max_range: float = parameter(3.0, "Rays clear up to this distance.", unit="m", gt=0.0)
    raytrace_min_range: float = parameter(0.0, "Rays clear from this distance on.", unit="m", ge=0.0)
    min_obstacle_height: float = parameter(0.0, "Points below this height (map frame) are ignored.", unit="m")
    max_obstacle_height: float = parameter(2.0, "Points above this height (map frame) are ignored.", unit="m")
    observation_persistence: float = parameter(
        0.0, "How long an observation is used; 0 = only the newest one.", unit="s", ge=0.0, le=60.0
    )


class ObservationBuffer:
    """The observations of one source that are still in use, at most ``MAX_OBSERVATIONS``.

    Parameters
    ----------
    name : str
        Name of the source, for messages.
    """

    def __init__(self, name: str, parameters: SourceParameters) -> None:
        self.parameters = parameters
        self.watch = SourceWatch(name)
        self._lock = threading.Lock()  # the sensor does not wait for an update of the whole map
        kept = 1 if parameters.observation_persistence == 0.0 else MAX_OBSERVATIONS
        self._observations: deque[RangeScan] = deque(maxlen=kept)

    def insert(self, scan: RangeScan) -> None:
        """Keep a scan; without persistence it replaces the one before. Called on the thread of the sensor."""
        limits = self.parameters
        seen = scan.between_heights(limits.min_obstacle_height, limits.max_obstacle_height)
        with self._lock:
            self._observations.append(seen)
        self.watch.heard(scan.stamp)

    def current(self, now: float) -> list[RangeScan]:
        """Observations for an update at ``now`` [s], oldest first; those out of their time are forgotten.

        One from the future is used only as the last one that came, or it would stay until its time.
        """
        with self._lock:
            seen = list(self._observations)
            if self.parameters.observation_persistence > 0.0:
                seen = self._in_time(seen, now)
                self._observations = deque(seen, maxlen=MAX_OBSERVATIONS)
        if seen:
            self.watch.used()
        return seen

    def _in_time(self, seen: list[RangeScan], now: float) -> list[RangeScan]:
        earliest = now - self.parameters.observation_persistence
        return [
            scan for scan in seen if earliest <= scan.stamp and (scan is seen[-1] or scan.stamp <= now + MAX_STAMP_LEAD)
        ]

    def forget(self) -> None:
        """Drop the kept observations, e.g. because the map is cleared."""
        with self._lock:
            self._observations.clear()
        self.watch.cleared()
