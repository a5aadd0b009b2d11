"""What a sensor saw, kept until the costmap's next update, and the age limits of its source.

A source that has fallen silent is the classic reason for a robot driving into something it can no longer see, so
``expected_update_rate`` is on by default: a layer whose source is late makes the whole map not current.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.maps.sensing import MAX_STAMP_LEAD
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_costmap_nav.map.layer import CostmapLayer

MAX_OBSERVATIONS = 256
"""Bound of the memory of one source, however long its persistence."""


class SourceTiming(ParameterModel):
    """How often a sensor must speak."""

    expected_update_rate: float = parameter(
        1.0, "Longest allowed time between two observations; 0 switches the check off.", unit="s", ge=0.0
    )


class SourceParameters(SourceTiming):
    """One observation source of a layer."""

    marking: bool = parameter(True, "Whether hits of this source put obstacles on the map.")
    clearing: bool = parameter(True, "Whether rays of this source remove obstacles along their way.")
    obstacle_max_range: float = parameter(2.5, "Hits farther than this are not marked.", unit="m", gt=0.0)
    obstacle_min_range: float = parameter(0.0, "Hits nearer than this are not marked.", unit="m", ge=0.0)
    raytrace_max_range: float = parameter(3.0, "Rays clear up to this distance.", unit="m", gt=0.0)
    raytrace_min_range: float = parameter(0.0, "Rays clear from this distance on.", unit="m", ge=0.0)
    min_obstacle_height: float = parameter(0.0, "Points below this height (map frame) are ignored.", unit="m")
    max_obstacle_height: float = parameter(2.0, "Points above this height (map frame) are ignored.", unit="m")
    observation_persistence: float = parameter(
        0.0, "How long an observation is used; 0 = only the newest one.", unit="s", ge=0.0, le=60.0
    )


@dataclass(frozen=True, eq=False)
class Observation:
    """One measurement in the costmap's frame.

    Attributes
    ----------
    origin : (3,) float64
        Where the sensor was [m].
    ends : (n, 3) float64
        Ends of the rays [m], all finite.
    hits : (n,) bool
        Whether there is something at the end.
    stamp : float
        Time of the measurement [s].
    """

    origin: NDArray[np.float64]
    ends: NDArray[np.float64]
    hits: NDArray[np.bool_]
    stamp: float

    @classmethod
    def of_points(cls, points: ArrayLike, origin: ArrayLike, stamp: float) -> Observation:
        """Take a cloud in which every point (n, 3) is a hit."""
        return cls.of_scan(origin, points, np.ones(len(np.asarray(points)), dtype=bool), stamp)

    @classmethod
    def of_scan(cls, origin: ArrayLike, ends: ArrayLike, hits: ArrayLike, stamp: float) -> Observation:
        """Take a scan; rays with an end that is not finite are dropped. The arrays are copied.

        Raises
        ------
        ValueError
            Wrong shapes, or the origin or the stamp is not finite.
        """
        if not math.isfinite(stamp):
            raise ValueError(f"the stamp of an observation must be finite, got {stamp}")
        start = np.array(origin, dtype=np.float64).reshape(-1)
        points = np.array(ends, dtype=np.float64).reshape(-1, 3)
        mask = np.array(hits, dtype=bool).reshape(-1)
        if start.shape != (3,) or not np.isfinite(start).all():
            raise ValueError(f"sensor_origin must be three finite numbers, got {start.tolist()}")
        if len(points) != len(mask):
            raise ValueError(f"{len(points)} ray ends but {len(mask)} hit flags")
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            points, mask = points[finite], mask[finite]
        return cls(start, points, mask, float(stamp))

    def between_heights(self, lowest: float, highest: float) -> Observation:
        """Return the observation without the rays that end below ``lowest`` or above ``highest`` [m]."""
        z = self.ends[:, 2]
        inside = (z >= lowest) & (z <= highest)
        if inside.all():
            return self
        return Observation(self.origin, self.ends[inside], self.hits[inside], self.stamp)


class SourceWatch:
    """Notices when a source falls silent, and when nothing of it is in the map yet, at the start or after clearing.

    The age of a source is that of what it said last, not of its newest stamp: a single stamp from the future would
    otherwise cover its silence. A stamp from the future is a problem until the source says another one.

    Parameters
    ----------
    name : str
        Name of the source, for messages.
    timing : SourceTiming
    """

    def __init__(self, name: str, timing: SourceTiming) -> None:
        self.name = name
        self._limit = timing.expected_update_rate
        self._last: float | None = None
        self._in_map = False

    def heard(self, stamp: float) -> None:
        """Note an observation made at ``stamp`` [s]."""
        self._last = stamp

    def used(self) -> None:
        """Note that an update has put an observation into the map."""
        self._in_map = True

    def cleared(self) -> None:
        """Note that the map has forgotten the source: it must not be driven on before it sees again."""
        self._in_map = False

    def stale_reason(self, now: float) -> str:
        """Say how late the source is at ``now`` [s]; empty while it is in time."""
        if self._limit == 0.0:
            return ""
        if self._last is None:
            return f"observation source {self.name!r} has not sent anything yet"
        age = now - self._last
        if age < -MAX_STAMP_LEAD:
            return f"observation source {self.name!r} has a stamp {-age:.2f} s in the future, is its clock right?"
        if age > self._limit:
            return f"observation source {self.name!r} is silent for {age:.2f} s, expected every {self._limit:.2f} s"
        return "" if self._in_map else f"nothing of observation source {self.name!r} is in the map since it was cleared"


class ObservationBuffer:
    """The observations of one source that are still in use, at most ``MAX_OBSERVATIONS``.

    Parameters
    ----------
    name : str
        Name of the source, for messages.
    parameters : SourceParameters
    """

    def __init__(self, name: str, parameters: SourceParameters) -> None:
        self.parameters = parameters
        self.watch = SourceWatch(name, parameters)
        self._observations: deque[Observation] = deque(
            maxlen=1 if parameters.observation_persistence == 0.0 else MAX_OBSERVATIONS
        )

    def insert(self, observation: Observation) -> None:
        """Keep an observation; without persistence it replaces the one before."""
        limits = self.parameters
        self._observations.append(observation.between_heights(limits.min_obstacle_height, limits.max_obstacle_height))
        self.watch.heard(observation.stamp)

    def current(self, now: float) -> list[Observation]:
        """Observations for an update at ``now`` [s], oldest first; those out of their time are forgotten.

        One from the future is used only as the last one that came, or it would stay until its time.
        """
        persistence = self.parameters.observation_persistence
        if persistence > 0.0 and self._observations:
            last = self._observations[-1]
            kept = [
                seen
                for seen in self._observations
                if now - persistence <= seen.stamp and (seen is last or seen.stamp <= now + MAX_STAMP_LEAD)
            ]
            self._observations = deque(kept, maxlen=MAX_OBSERVATIONS)
        if self._observations:
            self.watch.used()
        return list(self._observations)

    def forget(self) -> None:
        """Drop the kept observations, e.g. because the map is cleared."""
        self._observations.clear()
        self.watch.cleared()


class SensorLayer(CostmapLayer):
    """A layer that takes observations."""

    @property
    @abstractmethod
    def source_names(self) -> tuple[str, ...]:
        """Names of the sources it listens to."""

    @abstractmethod
    def insert(self, source: str, observation: Observation) -> None:
        """Keep an observation of one of its sources for the next update."""
