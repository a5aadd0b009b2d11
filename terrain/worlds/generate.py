"""Make terrain: fractal ground of a wanted steepness, and features to put on it.

Each function takes a ``Heightfield`` and returns another; random numbers come from a ``numpy`` Generator, so the same
seed gives the same ground. Fractal ground is filtered noise with a power spectrum that falls with the wave number (M.
Ebert et al., Texturing and Modeling, spectral synthesis); then its heights are scaled so that the median slope is
exactly the wanted one, which works because the tangent of every slope is proportional to the heights.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import exp, power, tan
from terrain.worlds.heightfield import Heightfield, samples

CLEAR_RADIUS = 2.0  # m around start and goals without boulders


def flat_terrain(size_x: float, size_y: float, spacing: float, x0: float = 0.0, y0: float = 0.0) -> Heightfield:
    """Level ground at height 0 with about ``spacing`` [m] between samples."""
    nx, ny = samples(size_x, size_y, spacing)
    return Heightfield(np.zeros((ny, nx), np.float32), size_x / (nx - 1), size_y / (ny - 1), x0, y0)


def fractal_noise(terrain: Heightfield, rng: np.random.Generator, exponent: float = 2.0) -> FloatArray:
    """Noise (ny, nx) of mean 0 and root mean square 1 whose amplitude falls as wave number ** -``exponent``.

    An exponent of 2 looks like hills, 1 like rubble. The noise is made on twice the area and cut, so that opposite
    borders do not match.
    """
    ny, nx = 2 * terrain.ny, 2 * terrain.nx
    wave_number = np.hypot(np.fft.fftfreq(ny, terrain.dy)[:, None], np.fft.rfftfreq(nx, terrain.dx)[None, :])
    wave_number[0, 0] = np.inf  # no constant term
    spectrum = np.fft.rfft2(rng.normal(size=(ny, nx))) * power(wave_number, -exponent)
    noise = np.fft.irfft2(spectrum, s=(ny, nx))[: terrain.ny, : terrain.nx]
    noise = noise - noise.mean()
    return np.asarray(noise / noise.std())


def fractal_terrain(
    size_x: float,
    size_y: float,
    spacing: float,
    rng: np.random.Generator,
    median_slope: float = 10.0,
    roughness: float = 0.0,
    exponent: float = 2.2,
) -> Heightfield:
    """Hills whose median slope is ``median_slope`` [degrees], with bumps of ``roughness`` [m] rms added after that."""
    terrain = flat_terrain(size_x, size_y, spacing)
    hills = terrain.with_heights(fractal_noise(terrain, rng, exponent))
    tangent = np.median(tan(np.radians(hills.slopes())))
    hills = hills.with_heights(hills.heights * (math.tan(math.radians(median_slope)) / tangent))
    return add_roughness(hills, rng, roughness) if roughness > 0.0 else hills


def add_roughness(terrain: Heightfield, rng: np.random.Generator, roughness: float) -> Heightfield:
    """Add small bumps of ``roughness`` [m] root mean square, strongest at the smallest wavelengths a wheel feels."""
    return terrain.with_heights(terrain.heights + roughness * fractal_noise(terrain, rng, exponent=1.0))


def _grid(terrain: Heightfield) -> tuple[FloatArray, FloatArray]:
    return np.meshgrid(terrain.x0 + terrain.dx * np.arange(terrain.nx), terrain.y0 + terrain.dy * np.arange(terrain.ny))


def _nearest_on_polyline(terrain: Heightfield, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Horizontal distance [m] of every sample (ny, nx) to a polyline (n, 3), and the polyline's z at the nearest point.

    A polyline (n, 2) has z = 0.
    """
    corners = np.asarray(points, dtype=float)
    corners = np.column_stack([corners, np.zeros(len(corners))])[:, :3]
    x, y = _grid(terrain)
    nearest, z = np.full(x.shape, np.inf), np.zeros(x.shape)
    for a, b in pairwise(corners):
        along, length_squared = b - a, max(float(np.sum((b - a)[:2] ** 2)), 1e-12)
        t = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / length_squared, 0.0, 1.0)
        distance = np.hypot(x - a[0] - t * along[0], y - a[1] - t * along[1])
        z = np.where(distance < nearest, a[2] + t * along[2], z)
        nearest = np.minimum(nearest, distance)
    return nearest, z


def add_ridge(terrain: Heightfield, points: ArrayLike, height: float, width: float) -> Heightfield:
    """Raise a ridge of Gaussian section along a polyline (n, 2) [m]; ``width`` [m] is from foot to foot (4 sigma)."""
    distance, _ = _nearest_on_polyline(terrain, points)
    return terrain.with_heights(terrain.heights + height * exp(-0.5 * (4.0 * distance / width) ** 2))


def add_crater(
    terrain: Heightfield, x: float, y: float, radius: float, depth: float, rim: float | None = None
) -> Heightfield:
    """Dig a parabolic bowl with a raised rim that decays outside, as impact craters do.

    Parameters
    ----------
    radius : float
        From the centre to the crest of the rim [m].
    depth, rim : float
        Of the bowl below and of the crest above the old ground [m]; the rim defaults to a fifth of the depth.
    """
    rim = 0.2 * depth if rim is None else rim
    gx, gy = _grid(terrain)
    r = np.hypot(gx - x, gy - y) / radius
    inside = (depth + rim) * r**2 - depth
    r_outside = np.maximum(r, 1e-9)
    outside = rim / (r_outside * r_outside * r_outside)
    return terrain.with_heights(terrain.heights + np.where(r < 1.0, inside, outside))


def add_ruts(terrain: Heightfield, points: ArrayLike, track: float, width: float, depth: float) -> Heightfield:
    """Press two wheel ruts, ``track`` [m] apart, along a polyline (n, 2) [m]."""
    distance, _ = _nearest_on_polyline(terrain, points)
    across = (distance - 0.5 * track) / (0.5 * width)
    return terrain.with_heights(terrain.heights - depth * np.clip(1.0 - across**2, 0.0, 1.0))


def add_road(terrain: Heightfield, points: ArrayLike, width: float, shoulder: float) -> Heightfield:
    """Cut and fill a road that is level across; hairpins make a switchback.

    Parameters
    ----------
    points : (n, 3) float
        Middle of the road with its height, along a polyline [m].
    width : float
        Of the level part [m].
    shoulder : float
        Over which the road's height fades into the old ground's on both sides [m].
    """
    nearest, road_height = _nearest_on_polyline(terrain, points)
    share = np.clip(1.0 - (nearest - 0.5 * width) / shoulder, 0.0, 1.0)
    return terrain.with_heights(terrain.heights + share * (road_height - terrain.heights))


def add_boulders(
    terrain: Heightfield,
    rng: np.random.Generator,
    density: float,
    radius_min: float = 0.1,
    radius_max: float = 0.8,
    keep_clear: FloatArray | None = None,
) -> Heightfield:
    """Lay half-buried round boulders, many small and few large (radius density falls as its third power).

    Parameters
    ----------
    density : float
        Boulders on 100 square metres, on average.
    radius_min, radius_max : float
        [m]
    keep_clear : (n, 2) float, optional
        Places [m], such as start and goal, that no boulder comes nearer to than 2 m.
    """
    count = rng.poisson(density * terrain.size[0] * terrain.size[1] / 100.0)
    centres = np.column_stack(
        [rng.uniform(terrain.x0, terrain.x_max, count), rng.uniform(terrain.y0, terrain.y_max, count)]
    )
    u = rng.uniform(size=count)  # inverse of the cumulative distribution of r**-3 between the two radii
    radii = 1.0 / np.sqrt(radius_min**-2 + u * (radius_max**-2 - radius_min**-2))
    clear = np.zeros((0, 2)) if keep_clear is None else np.asarray(keep_clear, dtype=float).reshape(-1, 2)
    heights = terrain.heights.astype(np.float64)
    for (x, y), radius in zip(centres.tolist(), radii.tolist(), strict=True):
        if len(clear) and np.hypot(*(clear - (x, y)).T).min() < CLEAR_RADIUS + radius:
            continue
        _raise_dome(terrain, heights, x, y, radius)
    return terrain.with_heights(heights)


def _raise_dome(terrain: Heightfield, heights: FloatArray, x: float, y: float, radius: float) -> None:
    """Put a half sphere on ``heights`` (in place), standing on the old ground under its centre."""
    columns = slice(
        max(0, math.ceil((x - radius - terrain.x0) / terrain.dx)),
        math.floor((x + radius - terrain.x0) / terrain.dx) + 1,
    )
    rows = slice(
        max(0, math.ceil((y - radius - terrain.y0) / terrain.dy)),
        math.floor((y + radius - terrain.y0) / terrain.dy) + 1,
    )
    patch = heights[rows, columns]
    if patch.size == 0:
        return
    gx = terrain.x0 + terrain.dx * (columns.start + np.arange(patch.shape[1]))
    gy = terrain.y0 + terrain.dy * (rows.start + np.arange(patch.shape[0]))
    squared = (gx[None, :] - x) ** 2 + (gy[:, None] - y) ** 2
    dome = float(terrain.height_at(x, y)) + np.sqrt(np.maximum(radius**2 - squared, 0.0))
    heights[rows, columns] = np.where(squared < radius**2, np.maximum(patch, dome), patch)


def add_steps(terrain: Heightfield, x: float, height: float, length: float, count: int) -> Heightfield:
    """Cut ``count`` stairs of ``height`` x ``length`` [m], rising along +x from ``x`` [m], one sample steep."""
    gx, _ = _grid(terrain)
    step = np.clip(np.floor((gx - x) / length) + 1.0, 0, count)
    return terrain.with_heights(terrain.heights + height * step)
