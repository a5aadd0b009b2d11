"""Scans of range sensors, in the form that every map takes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import FARTHEST_COORDINATE, FloatArray
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.geometry.transform_problems import ExtrapolationError

TRANSFORM_TOLERANCE = 0.3
"""How much newer [s] than the newest transform a scan may be; costmap_2d's and Nav2's default."""

MAX_STAMP_LEAD = 0.2
"""How far [s] a stamp may lie in the future; clocks of two computers differ by less."""


@dataclass(frozen=True, eq=False)
class RangeScan:
    """One scan of a lidar or depth camera.

    Attributes
    ----------
    source : str
        Name of the sensor, as layers of the configuration call it.
    frame_id : str
        Frame of ``origin`` and ``ends``.
    origin : (3,) float64
        Where the rays start [m].
    ends : (n, 3) float64
        Where each ray ends [m]: at what it hit, or at its maximal range.
    hits : (n,) bool
        Whether the ray hit something.
    stamp : float
        Time of the measurement [s].
    is_checked : bool
        Whether the arrays are those that ``checked`` has copied, or were made of them; nobody writes to them.
    """

    source: str
    frame_id: str
    origin: FloatArray
    ends: FloatArray
    hits: NDArray[np.bool_]
    stamp: float
    is_checked: bool = field(default=False, kw_only=True, repr=False)

    @classmethod
    def of_rays(
        cls, source: str, origin: ArrayLike, ends: ArrayLike, hits: ArrayLike, stamp: float, frame_id: str = "map"
    ) -> RangeScan:
        """Copy a driver's origin (3,), ends (n, 3) and hits (n,), arrays or lists, see the attributes.

        Raises
        ------
        ValueError
            Wrong shapes.
        """
        start = np.array(origin, dtype=np.float64).reshape(-1)
        points = np.array(ends, dtype=np.float64).reshape(-1, 3)
        mask = np.array(hits, dtype=np.bool_).reshape(-1)
        if start.shape != (3,):
            raise ValueError(f"the origin of a scan must be three numbers, got {start.tolist()}")
        if len(points) != len(mask):
            raise ValueError(f"{len(points)} ray ends but {len(mask)} hit flags")
        return cls(source, frame_id, start, points, mask, float(stamp))

    @classmethod
    def of_points(
        cls, source: str, points: ArrayLike, origin: ArrayLike, stamp: float, frame_id: str = "map"
    ) -> RangeScan:
        """Take a cloud (n, 3) as a scan in which every ray hit something."""
        cloud = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        return cls.of_rays(source, origin, cloud, np.ones(len(cloud), dtype=np.bool_), stamp, frame_id)

    def checked(self) -> RangeScan:
        """A copy as arrays, as a driver may reuse its buffers, without the rays whose end is not within 1e9 m of zero.

        A scan that is such a copy is returned as it is.

        Raises
        ------
        ValueError
            Wrong shapes, the stamp is not finite, or the origin not within ``FARTHEST_COORDINATE`` (1e9 m) of zero.
        """
        if self.is_checked:
            return self
        scan = RangeScan.of_rays(self.source, self.origin, self.ends, self.hits, self.stamp, self.frame_id)
        if not (np.isfinite(scan.origin).all() and math.isfinite(scan.stamp)):
            origin = scan.origin.tolist()
            raise ValueError(f"origin and stamp of a scan must be finite, got {origin} and {self.stamp}")
        if np.abs(scan.origin).max() > FARTHEST_COORDINATE:
            limits = f"within {FARTHEST_COORDINATE:g} m of zero"
            raise ValueError(f"the origin of a scan must be {limits}, got {scan.origin.tolist()}")
        known = np.asarray((np.abs(scan.ends) <= FARTHEST_COORDINATE).all(axis=1))  # not those with NaN either
        if not known.all():
            scan = replace(scan, ends=scan.ends[known], hits=scan.hits[known])
        return replace(scan, is_checked=True)

    def between_heights(self, lowest: float, highest: float) -> RangeScan:
        """The scan without the rays that end below ``lowest`` or above ``highest`` [m]."""
        z = self.ends[:, 2]
        inside = (z >= lowest) & (z <= highest)
        return self if inside.all() else replace(self, ends=self.ends[inside], hits=self.hits[inside])

    def in_frame(self, frame_id: str, transforms: TransformBuffer, tolerance: float = TRANSFORM_TOLERANCE) -> RangeScan:
        """Express the scan in another frame, by the transform of the moment it was measured.

        A scan newer than the newest transform by at most ``tolerance`` [s] is placed by that one.

        Raises
        ------
        TransformError
            There is no transform at the scan's stamp.
        """
        if frame_id == self.frame_id:
            return self
        transform = self.transform_to(frame_id, transforms, tolerance)
        origin = transform.apply(np.atleast_2d(self.origin))[0]
        return replace(self, frame_id=frame_id, origin=origin, ends=transform.apply(self.ends))

    def transform_to(
        self, frame_id: str, transforms: TransformBuffer, tolerance: float = TRANSFORM_TOLERANCE
    ) -> Transform:
        """Return the transform by which ``in_frame`` places the scan; its stamp is another one if it is the newest."""
        try:
            return transforms.lookup(frame_id, self.frame_id, self.stamp)
        except ExtrapolationError:
            newest = transforms.lookup(frame_id, self.frame_id)
            if not 0.0 <= self.stamp - newest.stamp <= tolerance:
                raise
            return newest

    @property
    def points(self) -> FloatArray:
        """(k, 3) float64, the points that were hit [m]."""
        return np.asarray(self.ends[self.hits], dtype=np.float64)
