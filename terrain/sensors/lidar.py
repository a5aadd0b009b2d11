"""Lidars and depth cameras: scanners with a fixed fan of rays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbf_abstract.geometry import FloatArray, Vector3
from mbf_abstract.geometry.arithmetic import norm, rotated
from mbf_abstract.maps.sensing import RangeScan
from terrain.physics.protocols import SimulatedRobot
from terrain.sensors.rays import RayCaster
from terrain.sensors.sensor import Sensor

RINGS, MAX_ELEVATION = 16, np.radians(15.0)
WRONG_RANGE_FACTOR = 0.5  # a lidar gone wrong sees everything at half its distance


@dataclass(frozen=True)
class LidarModel:
    """What a scanner can do.

    Attributes
    ----------
    position : (3,) float
        In base_link [m].
    directions : (n, 3) float64
        Unit rays in base_link.
    rate : float
        Turns per second [Hz].
    max_range, min_range : float
        Farther hits are no hits, nearer ones are dropped [m].
    noise : float
        Standard deviation of ranges [m].
    drop_out : float
        Share of rays without any answer, 0..1.
    """

    position: Vector3
    directions: FloatArray
    rate: float
    max_range: float = 20.0
    noise: float = 0.01
    drop_out: float = 0.0
    min_range: float = 0.1


class Lidar(Sensor[RangeScan]):
    """A scanner with a fixed fan of rays; all rays of a turn are cast at once.

    Its scans are in map. Rays without a hit end at maximum range, which was seen to be free; rays that dropped out or
    hit something nearer than the minimum are not in the scan at all.

    Parameters
    ----------
    source : str
        Name of this sensor in its scans, as layers of a server's configuration call it.
    casters : sequence of RayCaster
        What it can see.
    """

    def __init__(
        self,
        robot: SimulatedRobot,
        source: str,
        casters: Sequence[RayCaster],
        model: LidarModel,
        rng: np.random.Generator,
    ) -> None:
        super().__init__(robot, model.rate, rng)
        self.source = source
        self.casters = list(casters)
        self.model = model

    def _sense(self, stamp: float) -> RangeScan:
        model, pose = self.model, self.robot.pose()
        R_map_base = pose.rotation
        origin = np.array(pose.position) + rotated(R_map_base, np.asarray(model.position, dtype=float))
        directions = rotated(R_map_base, model.directions)
        origins = np.broadcast_to(origin, directions.shape)
        ranges = np.full(len(directions), np.inf)
        for caster in self.casters:
            ranges = np.minimum(ranges, caster.distances(origins, directions, model.max_range))
        # every turn draws the same amount of noise, whatever it sees: seeds stay comparable between scenarios
        noise = model.noise * self.rng.normal(size=len(ranges))
        kept = self.rng.uniform(size=len(ranges)) >= model.drop_out
        hit = np.isfinite(ranges)
        kept &= ~hit | (ranges >= model.min_range)
        ranges = np.where(hit, np.clip(ranges + noise, model.min_range, model.max_range), model.max_range)
        ends = origin + ranges[:, None] * directions
        return RangeScan(self.source, pose.frame_id, origin, ends[kept], hit[kept], stamp)

    def _falsify(self, measurement: RangeScan) -> RangeScan:
        ends = measurement.origin + WRONG_RANGE_FACTOR * (measurement.ends - measurement.origin)
        return replace(measurement, ends=ends, hits=np.ones_like(measurement.hits))


def ray_fan(azimuths: FloatArray, elevations: FloatArray) -> FloatArray:
    """Unit rays (len(elevations) * len(azimuths), 3) of every azimuth at every elevation [rad]."""
    elevation, azimuth = np.meshgrid(elevations, azimuths, indexing="ij")
    rays = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    return np.stack(rays, axis=-1).reshape(-1, 3)


def planar_directions(rays: int = 360) -> FloatArray:
    """Rays (rays, 3) of a planar lidar, all around."""
    return ray_fan(_azimuths(rays), np.zeros(1))


def ring_directions(rays: int = 360) -> FloatArray:
    """Rays (16 * rays, 3) of a turning multi-beam lidar, its rings from -15 to +15 degrees."""
    return ray_fan(_azimuths(rays), np.linspace(-MAX_ELEVATION, MAX_ELEVATION, RINGS))


def _azimuths(rays: int) -> FloatArray:
    return (np.arange(rays) + 0.5) / rays * 2.0 * np.pi - np.pi


def camera_directions(width: int = 160, height: int = 120, field_of_view: float = np.radians(70.0)) -> FloatArray:
    """Rays (height * width, 3) of a depth camera that looks ahead, row by row from the top left pixel.

    A depth camera is a ``Lidar`` with these rays; its ranges are along the rays, not along the optical axis.

    Parameters
    ----------
    field_of_view : float
        Horizontal [rad]; pixels are square.
    """
    pixel = 2.0 * math.tan(0.5 * field_of_view) / width
    left = 0.5 * (width - 1) - np.arange(width)
    up = 0.5 * (height - 1) - np.arange(height)
    rays = np.stack(
        [
            np.ones((height, width)),
            np.broadcast_to(pixel * left, (height, width)),
            np.broadcast_to(pixel * up[:, None], (height, width)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    return np.asarray(rays / norm(rays)[..., None])
