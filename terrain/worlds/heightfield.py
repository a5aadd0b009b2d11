"""A terrain as a regular grid of heights: one array from which physics, planner and pictures take the same surface.

Use it for any outdoor world without overhangs; a bridge, a ramp over a road or a building needs a mesh. Every cell is
split into two triangles along its anti-diagonal, from ``(ix + 1, iy)`` to ``(ix, iy + 1)``, because that is how Bullet
splits its heightfields: ``height_at`` and ``surface`` are that surface and not a smooth interpolation of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RectBivariateSpline

from mbf_abstract.geometry import FloatArray, Pose, quaternion_from_yaw, quaternion_multiply
from mbf_abstract.geometry.arithmetic import arctan
from terrain.worlds.smoothing import smoothed
from terrain.worlds.surface import Surface, height_grid

SMOOTHING_WIDTH = 0.5  # m; four sigma of the Gaussian that parts hills from bumps, about a wheelbase
EDGE_TOLERANCE = 1e-9  # cells; a query on the far border must not fall off by a rounding error
MAX_SAMPLES = 20_000_000  # unless a caller asks for more; absurd sizes are refused before memory is asked for


def samples(length_x: float, length_y: float, spacing: float) -> tuple[int, int]:
    """Samples about ``spacing`` [m] apart on a rectangle [m], along x and y; ValueError for none and for too many."""
    if not min(length_x, length_y, spacing) > 0.0:
        got = f"{length_x:g} m x {length_y:g} m with samples {spacing:g} m apart"
        raise ValueError(f"expected lengths of more than 0 m, got {got}")
    along_x, along_y = length_x / spacing, length_y / spacing
    if not along_x * along_y <= MAX_SAMPLES:
        raise ValueError(f"expected at most {MAX_SAMPLES} samples, got {along_x:.3g} x {along_y:.3g}")
    return max(2, round(along_x) + 1), max(2, round(along_y) + 1)


@dataclass(frozen=True)
class SlopeReport:
    """How steep and rough a terrain is.

    Attributes
    ----------
    median, p90, p99, maximum : float
        Slopes of the triangles [degrees], weighted by their area on the map.
    relief : float
        From the lowest to the highest sample [m].
    roughness : float
        Root mean square [m] of what is left of the heights when they are smoothed over half a metre: what wheels feel.
    """

    median: float
    p90: float
    p99: float
    maximum: float
    relief: float
    roughness: float

    def __str__(self) -> str:
        return (
            f"slope median {self.median:.1f}, p90 {self.p90:.1f}, p99 {self.p99:.1f}, max {self.maximum:.1f} deg; "
            f"relief {self.relief:.2f} m; roughness {1000.0 * self.roughness:.0f} mm"
        )


@dataclass(frozen=True, eq=False)
class Heightfield:
    """Heights on a regular grid.

    Parameters
    ----------
    heights : (ny, nx) float32
        Heights [m], row = y, column = x; copied and made read-only.
    dx, dy : float
        Distance between samples [m].
    x0, y0 : float
        Position [m] of sample ``[0, 0]``, the corner with the smallest coordinates.

    Raises
    ------
    ValueError
        Fewer than 2 x 2 samples, a height that is not finite, or a distance that is not positive.
    """

    heights: NDArray[np.float32]
    dx: float
    dy: float
    x0: float = 0.0
    y0: float = 0.0

    def __post_init__(self) -> None:
        heights = np.array(self.heights, dtype=np.float32)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ValueError(f"a heightfield needs at least 2 x 2 samples, got shape {heights.shape}")
        if not np.isfinite(heights).all():
            iy, ix = np.argwhere(~np.isfinite(heights))[0].tolist()
            raise ValueError(f"height [{iy}, {ix}] is not finite")
        if not (self.dx > 0.0 and self.dy > 0.0):
            raise ValueError(f"sample distances must be positive, got dx {self.dx}, dy {self.dy}")
        heights.flags.writeable = False
        object.__setattr__(self, "heights", heights)

    @property
    def nx(self) -> int:
        """Samples along x."""
        return int(self.heights.shape[1])

    @property
    def ny(self) -> int:
        """Samples along y."""
        return int(self.heights.shape[0])

    @property
    def x_max(self) -> float:
        """Largest x [m]."""
        return self.x0 + (self.nx - 1) * self.dx

    @property
    def y_max(self) -> float:
        """Largest y [m]."""
        return self.y0 + (self.ny - 1) * self.dy

    @property
    def size(self) -> tuple[float, float]:
        """Extent along x and y [m]."""
        return self.x_max - self.x0, self.y_max - self.y0

    def _locate(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
        """Cell indices and the position inside the cell, each 0..1; nan positions outside the terrain."""
        u = (np.asarray(x, dtype=float) - self.x0) / self.dx
        v = (np.asarray(y, dtype=float) - self.y0) / self.dy
        outside = (u < -EDGE_TOLERANCE) | (u > self.nx - 1 + EDGE_TOLERANCE)
        outside |= (v < -EDGE_TOLERANCE) | (v > self.ny - 1 + EDGE_TOLERANCE)
        outside |= ~(np.isfinite(u) & np.isfinite(v))
        u, v = np.where(outside, 0.0, u), np.where(outside, 0.0, v)
        ix = np.clip(np.floor(u).astype(np.intp), 0, self.nx - 2)
        iy = np.clip(np.floor(v).astype(np.intp), 0, self.ny - 2)
        return ix, iy, np.where(outside, np.nan, u - ix), np.where(outside, np.nan, v - iy)

    def height_at(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Height [m] of the triangulated surface, float64 of the broadcast shape; nan outside the terrain."""
        ix, iy, s, t = self._locate(x, y)
        corners = ((iy, ix), (iy, ix + 1), (iy + 1, ix), (iy + 1, ix + 1))
        h00, h10, h01, h11 = (np.asarray(self.heights[corner], dtype=np.float64) for corner in corners)
        lower = h00 * (1.0 - s - t) + h10 * s + h01 * t
        upper = h11 * (s + t - 1.0) + h10 * (1.0 - t) + h01 * (1.0 - s)
        return np.asarray(np.where(s + t <= 1.0, lower, upper))

    def ground_at(self, x: float, y: float) -> tuple[float, float, float]:
        """Height [m] and its derivatives along x and y at one place, without the cost of array calls.

        Raises
        ------
        ValueError
            The place is not on the terrain.
        """
        u, v = (x - self.x0) / self.dx, (y - self.y0) / self.dy
        columns, rows = self.nx - 1, self.ny - 1
        if not (0.0 <= u <= columns and 0.0 <= v <= rows):
            raise ValueError(
                f"({x:g}, {y:g}) is off the terrain x {self.x0:g}..{self.x_max:g}, y {self.y0:g}..{self.y_max:g}"
            )
        ix, iy = min(int(u), columns - 1), min(int(v), rows - 1)
        s, t = u - ix, v - iy
        h10, h01 = float(self.heights[iy, ix + 1]), float(self.heights[iy + 1, ix])
        if s + t <= 1.0:
            h00 = float(self.heights[iy, ix])
            rise_x, rise_y = h10 - h00, h01 - h00
            height = h00 + s * rise_x + t * rise_y
        else:
            h11 = float(self.heights[iy + 1, ix + 1])
            rise_x, rise_y = h11 - h01, h11 - h10
            height = h11 - (1.0 - s) * rise_x - (1.0 - t) * rise_y
        return height, rise_x / self.dx, rise_y / self.dy

    def pose_at(self, x: float, y: float, yaw: float = 0.0) -> Pose:
        """Pose on the ground at (x, y) [m]: z axis along the normal, x axis towards ``yaw`` [rad] seen from above.

        Raises
        ------
        ValueError
            The position is not on the terrain.
        """
        height, slope_x, slope_y = self.ground_at(x, y)
        length = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        a, b, c = -slope_x / length, -slope_y / length, 1.0 / length  # the normal
        # tilt is the shortest rotation from z to the normal; the heading is then turned about the normal
        scale = math.sqrt(2.0 * (1.0 + c))
        tilt = (-b / scale, a / scale, 0.0, 0.5 * scale)
        dx, dy = math.cos(yaw), math.sin(yaw)
        dz = slope_x * dx + slope_y * dy
        along_x = dx * (1.0 - a * a / (1.0 + c)) - dy * a * b / (1.0 + c) - dz * a
        along_y = dy * (1.0 - b * b / (1.0 + c)) - dx * a * b / (1.0 + c) - dz * b
        turn = quaternion_from_yaw(math.atan2(along_y, along_x))
        return Pose((x, y, height), quaternion_multiply(tilt, turn))

    def surface(self) -> Surface:
        """Return the terrain as a mesh; sample ``[iy, ix]`` is vertex ``iy * nx + ix``."""
        x, y = self.x0 + self.dx * np.arange(self.nx), self.y0 + self.dy * np.arange(self.ny)
        return height_grid(x, y, self.heights)

    def crop(self, x_min: float, x_max: float, y_min: float, y_max: float) -> Heightfield:
        """Keep the samples inside a rectangle [m], borders included; raises ValueError if under 2 x 2 are left."""
        ix = np.flatnonzero(np.abs(self.x0 + self.dx * np.arange(self.nx) - (x_min + x_max) / 2) <= (x_max - x_min) / 2)
        iy = np.flatnonzero(np.abs(self.y0 + self.dy * np.arange(self.ny) - (y_min + y_max) / 2) <= (y_max - y_min) / 2)
        if ix.size < 2 or iy.size < 2:
            here = f"x {self.x0:g} to {self.x_max:g}, y {self.y0:g} to {self.y_max:g} [m] with 2 x 2 samples or more"
            raise ValueError(f"expected a part of {here}, got x {x_min:g} to {x_max:g}, y {y_min:g} to {y_max:g}")
        heights = self.heights[iy[0] : iy[-1] + 1, ix[0] : ix[-1] + 1]
        return Heightfield(heights, self.dx, self.dy, self.x0 + ix[0] * self.dx, self.y0 + iy[0] * self.dy)

    def resample(self, spacing: float, order: int = 3) -> Heightfield:
        """Sample again at about ``spacing`` [m] in x and y, over the same rectangle.

        Parameters
        ----------
        order : int
            Degree of the spline: 1 bilinear, 3 bicubic (can overshoot the original heights by a little).
        """
        nx, ny = samples(*self.size, spacing)
        spline = RectBivariateSpline(
            np.arange(self.ny), np.arange(self.nx), self.heights, kx=min(order, self.ny - 1), ky=min(order, self.nx - 1)
        )
        heights = np.float32(spline(np.linspace(0, self.ny - 1, ny), np.linspace(0, self.nx - 1, nx))).reshape(ny, nx)
        return Heightfield(heights, self.size[0] / (nx - 1), self.size[1] / (ny - 1), self.x0, self.y0)

    def scaled(self, factor: float) -> Heightfield:
        """Multiply all lengths by ``factor``, heights included: slopes stay what they are."""
        heights = self.heights * np.float32(factor)
        return Heightfield(heights, self.dx * factor, self.dy * factor, self.x0 * factor, self.y0 * factor)

    def with_heights(self, heights: ArrayLike) -> Heightfield:
        """Return the same grid with other heights (ny, nx)."""
        return replace(self, heights=np.asarray(heights, dtype=np.float32))

    def slopes(self) -> FloatArray:
        """Slope [degrees] of each triangle, float64, in the order of the faces of ``surface``."""
        h = self.heights.astype(np.float64)
        along_x, along_y = np.diff(h, axis=1) / self.dx, np.diff(h, axis=0) / self.dy
        lower = np.hypot(along_x[:-1], along_y[:, :-1])
        upper = np.hypot(along_x[1:], along_y[:, 1:])
        return np.asarray(np.degrees(arctan(np.stack([lower, upper], axis=2).ravel())))

    def slope_report(self) -> SlopeReport:
        """Summarise how steep and how rough the terrain is."""
        median, p90, p99, maximum = np.percentile(self.slopes(), [50, 90, 99, 100]).tolist()
        heights = self.heights.astype(np.float64)
        sigma = 0.25 * SMOOTHING_WIDTH
        bumps = heights - smoothed(heights, (sigma / self.dy, sigma / self.dx))
        return SlopeReport(median, p90, p99, maximum, float(np.ptp(heights)), float(np.sqrt(np.mean(bumps**2))))
