"""Obstacles seen by a sensor: points of a cloud above the surface make the faces below them lethal.

When to use: anything that is not in the mesh; feed an ``inflation`` layer with it. When not: for points of the ground
itself on a badly localised robot; raise ``ground_tolerance`` then.
Rule of mesh_navigation: cast a ray from every point downwards and mark the three corners of the face it hits, cost
inf. Deviations: points within ``ground_tolerance`` of the mesh are explained by it and mark nothing; the ray ends at
``robot_height``, which has a finite default, so nothing spills to the storey below; hits may be kept for
``decay_time`` and are cleared when later rays pass through them, also rays that hit nothing. A layer may listen to
several sensors: what one has seen is forgotten by its own next cloud, and by another's rays only where they pass
through. A sensor that is silent for longer than ``expected_update_rate`` makes the map stale, so that no
controller drives on it, and so does clearing until the next cloud: what was forgotten may still be there.
Cost: two tree queries a point, about 2 microseconds.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray, sorted_once
from mbf_mesh_nav.map.layer import (
    NOTHING_CHANGED,
    CostArray,
    LayerContext,
    LayerParameters,
    LethalArray,
    MeshLayer,
    in_square,
)
from mbf_mesh_nav.map.range_image import NO_RANGE, RangeImage

MAX_WAITING = 256
"""Scans that may wait for an update; older ones are dropped."""


class ObstacleParameters(LayerParameters):
    """Parameters of ``obstacle``."""

    sources: tuple[str, ...] = parameter(
        (), "Names of the sensors it listens to, each of which must send scans; empty = all that send any."
    )
    robot_height: float = parameter(1.0, "Points higher above the surface are not obstacles.", unit="m", gt=0.0)
    obstacle_min_range: float = parameter(
        0.0,
        "Points no farther from the sensor are ignored, such as those of the robot itself.",
        unit="m",
        was="min_obstacle_dist",
        ge=0.0,
    )
    obstacle_max_range: float = parameter(
        np.inf,
        "Points farther from the sensor are ignored.",
        unit="m",
        was="max_obstacle_dist",
        gt=0.0,
        allow_inf=True,
    )
    ground_tolerance: float = parameter(0.05, "Points nearer to the mesh are part of it.", unit="m", ge=0.0)
    decay_time: float = parameter(
        0.0, "How long an unseen hit is kept; 0 = until the next cloud.", unit="s", ge=0.0, allow_inf=True
    )
    clearing: bool = parameter(True, "Remove kept hits that later rays pass through.")
    expected_update_rate: float = parameter(
        1.0, "Longest allowed time between two clouds; 0 switches the check off.", unit="s", ge=0.0
    )
    down_axis: tuple[float, float, float] = parameter((0.0, 0.0, -1.0), "Direction of projection in the map's frame.")

    @field_validator("down_axis")
    @classmethod
    def _points_somewhere(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        if axis == (0.0, 0.0, 0.0):
            raise ValueError("an axis that has a direction")
        return axis


class Hits(NamedTuple):
    """What is remembered, one row for each marked face and sensor: face, point [m], time [s], number of the sensor."""

    faces: IntArray
    points: FloatArray
    stamps: FloatArray
    sources: IntArray

    @classmethod
    def none(cls) -> Hits:
        """Return no hits."""
        return cls(np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int32))

    def where(self, rows: NDArray[Any]) -> Hits:
        """Return some of the rows."""
        return Hits(*[column[rows] for column in self])

    def joined_with(self, older: Hits) -> Hits:
        """Add hits that were there before; of those of one sensor in one face the newest stays."""
        both = Hits(*[np.concatenate([new, old]) for new, old in zip(self, older, strict=True)])
        both = both.where(np.argsort(-both.stamps, kind="stable"))  # clouds may come late
        sensor_count = int(both.sources.max(initial=0)) + 1
        _, newest = np.unique(both.faces.astype(np.int64) * sensor_count + both.sources, return_index=True)
        return both.where(newest)


class ObstacleLayer(MeshLayer):
    """Lethal vertices below the points of recent clouds."""

    Parameters = ObstacleParameters
    parameters: ObstacleParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._watches: dict[str, SourceWatch] = {}  # its order numbers the sensors
        self._waiting: deque[RangeScan] = deque(maxlen=MAX_WAITING)
        self._hits = Hits.none()

    @classmethod
    def reach(cls, parameters: ObstacleParameters) -> float:
        """0: without scans it marks nothing."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost inf and lethal at the corners of the marked faces; drop those of sensors no longer listened to."""
        unheard = [number for number, name in enumerate(self._watches) if not self.listens_to(name)]
        self._hits = self._hits.where(~np.isin(self._hits.sources, unheard))
        lethal = np.zeros(self.topology.vertex_count, dtype=np.bool_)
        lethal[self.topology.faces[self._hits.faces]] = True
        return np.where(lethal, np.inf, 0.0).astype(np.float32), lethal

    def take_over(self, old: MeshLayer) -> None:
        """Take over sensors, scans that wait, and the hits above this part of the surface."""
        assert isinstance(old, ObstacleLayer)
        self._watches, self._waiting = old._watches, old._waiting
        faces = self._below(old._hits.points)
        self._hits = old._hits._replace(faces=faces).where(faces >= 0)

    def insert_scan(self, scan: RangeScan) -> None:
        """Keep a scan for the next update."""
        self._watches.setdefault(scan.source, SourceWatch(scan.source)).heard(scan.stamp)
        self._waiting.append(scan)

    def update(self, now: float) -> IntArray:
        """Mark the faces below the hits, drop hits that are too old or seen through.

        With a ``decay_time`` of 0 hits stay until the next cloud.
        """
        hits = self._hits
        while self._waiting:
            scan = self._waiting.popleft()
            if self.listens_to(scan.source):
                hits = self._with_scan(hits, scan)
                self._watches[scan.source].used()
        if self.parameters.decay_time > 0.0:
            kept = now - hits.stamps <= self.parameters.decay_time
            hits = hits if kept.all() else hits.where(kept)
        return NOTHING_CHANGED if hits is self._hits else self._change(hits)

    def _with_scan(self, hits: Hits, scan: RangeScan) -> Hits:
        """The hits that are known after a scan."""
        sensor = list(self._watches).index(scan.source)
        faces, points = self._project(scan)
        seen = Hits(faces, points, np.full(len(faces), scan.stamp), np.full(len(faces), sensor, dtype=np.int32))
        return seen.joined_with(hits.where(self._still_valid(hits, scan, sensor)))

    def clear(self) -> IntArray:
        """Drop all hits; the map is stale until every source has sent a new scan."""
        return self._keep_only(Hits.none())

    def clear_area(self, center: FloatArray, size: float, inside: bool) -> IntArray:
        """Drop the hits inside, or outside, a square (``in_square``); the map is then stale as after dropping all."""
        within = in_square(self._hits.points, center, size, self.parameters.robot_height)
        return self._keep_only(self._hits.where(within != inside))

    def _keep_only(self, hits: Hits) -> IntArray:
        self._waiting.clear()
        for watch in self._watches.values():
            watch.cleared()
        return self._change(hits)

    def stale_reason(self, now: float) -> str:
        """Which sensor is silent for longer than ``expected_update_rate``, or has sent nothing since a clearing."""
        if self.parameters.expected_update_rate > 0.0 and not self.parameters.sources and not self._watches:
            return "no observation source has sent anything yet"
        return super().stale_reason(now)

    def watched_sources(self) -> Iterator[tuple[SourceWatch, float]]:
        """The sources that the layer requires, else all that have sent something, with one limit."""
        sources = self.parameters.sources or tuple(self._watches)
        watches = (self._watches.get(source, SourceWatch(source)) for source in sources)
        return ((watch, self.parameters.expected_update_rate) for watch in watches)

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the scan sources that the layer requires; empty if it takes all."""
        return tuple(self.parameters.sources)

    def listens_to(self, source: str) -> bool:
        """Whether the layer takes scans of a source."""
        return not self.parameters.sources or source in self.parameters.sources

    def _project(self, scan: RangeScan) -> tuple[IntArray, FloatArray]:
        """Faces (k,) below the points that are obstacles, and those points (k, 3)."""
        settings, points = self.parameters, scan.points
        distances = norm(points - scan.origin)
        least = max(settings.obstacle_min_range, NO_RANGE)
        near = points[(distances > least) & (distances <= settings.obstacle_max_range)]
        near = near[self.locator.locate(near, settings.ground_tolerance).faces < 0]
        faces = self._below(near)
        return faces[faces >= 0], near[faces >= 0]

    def _below(self, points: FloatArray) -> IntArray:
        """Faces (n,) that points (n, 3) project onto, -1 where there is none within ``robot_height``."""
        down = np.array(self.parameters.down_axis) / norm(self.parameters.down_axis)
        faces, _ = self.locator.cast_rays(points, down, self.parameters.robot_height)
        return faces

    def _still_valid(self, hits: Hits, scan: RangeScan, sensor: int) -> BoolArray:
        """Mask of the kept hits that this scan neither outdates nor sees through.

        A scan that comes late, from a slow sensor, knows nothing of what another saw after its stamp.
        """
        valid = (scan.stamp - hits.stamps < self.parameters.decay_time) | (hits.sources != sensor)
        if self.parameters.clearing and len(scan.ends) and valid.any():
            seen_through = RangeImage(scan.ends, scan.origin).sees_through(hits.points)
            valid &= ~(seen_through & (hits.stamps <= scan.stamp))
        return np.asarray(valid, dtype=np.bool_)

    def _change(self, hits: Hits) -> IntArray:
        """Replace the hits and write only the vertices that change."""
        before = sorted_once(self.topology.faces[self._hits.faces])
        self._hits = hits
        after = sorted_once(self.topology.faces[self._hits.faces])
        self._costs[before], self._lethal[before] = 0.0, False
        self._costs[after], self._lethal[after] = np.inf, True
        return np.setxor1d(before, after, assume_unique=True)
