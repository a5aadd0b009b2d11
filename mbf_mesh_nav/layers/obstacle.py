"""Obstacles seen by a sensor: points of a cloud above the surface make the faces below them lethal.

When to use: anything that is not in the mesh; feed an ``inflation`` layer with it. When not: for points of the ground
itself on a badly localised robot; raise ``ground_tolerance`` then.
Rule of mesh_navigation: cast a ray from every point downwards and mark the three corners of the face it hits, cost
inf. Deviations: points within ``ground_tolerance`` of the mesh are explained by it and mark nothing; the ray ends at
``robot_height``, which has a finite default, so nothing spills to the storey below; hits may be kept for
``decay_time`` and are cleared when later rays pass through them; a sensor that is silent for longer than
``expected_update_rate`` makes the map not current, so that no controller drives on it, and so does clearing until the
next cloud: what was forgotten may still be there.
Cost: two tree queries a point, about 2 microseconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.layer import (
    NOTHING_CHANGED,
    CostArray,
    FloatArray,
    IntArray,
    LayerContext,
    LayerParameters,
    LethalArray,
    MeshLayer,
)
from mbf_mesh_nav.range_image import RangeImage


class ObstacleParameters(LayerParameters):
    """Parameters of ``obstacle``."""

    robot_height: float = parameter(1.0, "Points higher above the surface are no obstacle.", unit="m", gt=0.0)
    max_obstacle_dist: float = parameter(
        np.inf, "Points farther from the sensor are ignored.", unit="m", gt=0.0, allow_inf=True
    )
    ground_tolerance: float = parameter(0.05, "Points nearer to the mesh are part of it.", unit="m", ge=0.0)
    decay_time: float = parameter(
        0.0, "How long an unseen hit is kept; 0 = until the next cloud.", unit="s", ge=0.0, allow_inf=True
    )
    clearing: bool = parameter(True, "Forget kept hits that later rays pass through.")
    expected_update_rate: float = parameter(
        1.0, "Longest allowed time between two clouds; 0 switches the check off.", unit="s", ge=0.0
    )
    down_axis: tuple[float, float, float] = parameter((0.0, 0.0, -1.0), "Direction of projection in the map's frame.")

    @field_validator("down_axis")
    @classmethod
    def _points_somewhere(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        if axis == (0.0, 0.0, 0.0):
            raise ValueError("the axis must have a direction")
        return axis


class ObstacleLayer(MeshLayer):
    """Lethal vertices below the points of recent clouds."""

    Parameters = ObstacleParameters
    parameters: ObstacleParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._last_cloud = -np.inf
        self._keep(np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros(0))

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost inf and lethal at the corners of the marked faces."""
        lethal = np.zeros(self.topology.vertex_count, dtype=np.bool_)
        lethal[self.topology.faces[self._faces]] = True
        return np.where(lethal, np.inf, 0.0).astype(np.float32), lethal

    def insert_points(self, points: FloatArray, sensor_origin: FloatArray, stamp: float) -> IntArray:
        """Mark the faces below a cloud (n, 3), forget what is too old or seen through."""
        self._last_cloud = max(self._last_cloud, stamp)
        faces, hits = self._project(points, sensor_origin)
        kept = self._still_valid(points, sensor_origin, stamp)
        all_faces = np.concatenate([faces, self._faces[kept]])
        all_hits = np.vstack([hits, self._hits[kept]])
        stamps = np.concatenate([np.full(len(faces), stamp), self._stamps[kept]])
        unique, newest = np.unique(all_faces, return_index=True)
        return self._change(unique, all_hits[newest], stamps[newest])

    def expire(self, now: float) -> IntArray:
        """Forget hits older than ``decay_time``; with 0 they stay until the next cloud."""
        if self.parameters.decay_time == 0.0:
            return NOTHING_CHANGED
        kept = now - self._stamps <= self.parameters.decay_time
        return NOTHING_CHANGED if kept.all() else self._change(self._faces[kept], self._hits[kept], self._stamps[kept])

    def clear(self) -> IntArray:
        """Forget all hits, and that there was a cloud."""
        self._last_cloud = -np.inf
        return self._change(self._faces[:0], self._hits[:0], self._stamps[:0])

    def is_current(self, now: float) -> bool:
        """Whether a cloud came within ``expected_update_rate``, and since the layer was cleared."""
        limit = self.parameters.expected_update_rate
        return limit == 0.0 or now - self._last_cloud <= limit

    def _project(self, points: FloatArray, sensor_origin: FloatArray) -> tuple[IntArray, FloatArray]:
        """Faces (k,) below the points that are obstacles, and those points (k, 3)."""
        settings = self.parameters
        near = points[np.linalg.norm(points - sensor_origin, axis=1) <= settings.max_obstacle_dist]
        near = near[self.locator.locate(near, settings.ground_tolerance).faces < 0]
        down = np.array(settings.down_axis) / np.linalg.norm(settings.down_axis)
        faces, _ = self.locator.cast_rays(near, down, settings.robot_height)
        return faces[faces >= 0], near[faces >= 0]

    def _still_valid(self, points: FloatArray, sensor_origin: FloatArray, stamp: float) -> NDArray[np.bool_]:
        """Mask of the kept hits that this cloud neither outdates nor sees through."""
        young = stamp - self._stamps < self.parameters.decay_time
        if self.parameters.clearing and len(points) and young.any():
            young &= ~RangeImage(points, sensor_origin).sees_through(self._hits)
        return np.asarray(young)

    def _change(self, faces: IntArray, hits: FloatArray, stamps: FloatArray) -> IntArray:
        """Replace the hits and write only the vertices that change."""
        before = np.unique(self.topology.faces[self._faces])
        self._keep(faces, hits, stamps)
        after = np.unique(self.topology.faces[self._faces])
        self._costs[before], self._lethal[before] = 0.0, False
        self._costs[after], self._lethal[after] = np.inf, True
        return np.setxor1d(before, after, assume_unique=True)

    def _keep(self, faces: IntArray, hits: FloatArray, stamps: FloatArray) -> None:
        self._faces, self._hits, self._stamps = faces, hits, stamps
