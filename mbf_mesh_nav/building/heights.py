"""Heights of surface patches: from their points, along the slopes around them, as smooth as the points' noise asks.

A cell's mean has the noise of a point over the square root of their number. A scanner's 2 cm become 1 cm, and nothing
more is needed. Scans from wrong poses have 6 cm and more: the bands of ground and of what stands on it have to be as
wide, and heights are weighed against the smoothness that the ground itself shows.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.building.surface_patches import SurfacePatches
from mbf_mesh_nav.kernels.building.columns import LOWEST
from mbf_mesh_nav.kernels.building.patches import DIRECTIONS, settle_patches, slopes_of_patches
from mbf_mesh_nav.kernels.building.quads import distances_to_faces, fitted_heights
from mbf_mesh_nav.kernels.building.smoothing import ACROSS, smoothed_heights

SETTLINGS = 2
"""Times that slopes and heights are computed from each other."""
FITTINGS, IMPROBABLE, IMPROBABLE_AFTER_SMOOTHING = 2, 2.0, 3.0
"""Times that heights are moved towards their points, and the standard errors from which a difference is no chance."""
MEDIAN_OF_ERRORS = 0.6745
"""Median of the absolute values of normally distributed errors, in standard errors."""
SCANNER = 0.03
"""Noise [m] for which the limits of ``SurfaceParameters`` are made."""
BAND, STANDING = 6.0, 5.0
"""Where there is more, in standard errors: how thick ground may be, and above which height something stands on it."""
UNSTEADY = 0.02
"""Standard error [m] of a cell's mean from which heights are smoothed."""
ROUNDS, FREQUENCIES = 60, 32
LEAST_BENDS = 0.1
"""Least variance of the ground's bends, in variances of a point: noise hides what is less."""
BEND_SHARE = 0.362
"""Variance of a bend of a surface of which all bends are weighed as in ``smoothed_heights``, in units of one bend's."""


class HeightLimits(NamedTuple):
    """What is ground and what stands on it.

    Attributes
    ----------
    noise : float
        Standard error of a point along z [m].
    thickness : float
        Points up to this height above the lowest of a cell are ground [m].
    step : float
        What stands up to this height is driven over [m].
    clearance : float
        Points higher than this are no obstacle [m].
    rise : float
        Greatest difference of the heights of linked patches [m].
    """

    noise: float
    thickness: float
    step: float
    clearance: float
    rise: float

    def with_noise(self, noise: float) -> HeightLimits:
        """Limits wide enough for points with a standard error [m]."""
        if noise <= SCANNER:
            return self._replace(noise=noise)
        thickness, step = max(self.thickness, BAND * noise), max(self.step, STANDING * noise)
        return self._replace(noise=noise, thickness=thickness, step=step)


class KeptNoise(NamedTuple):
    """Shares of the variance of the noise of a cell's mean that a surface has.

    Attributes
    ----------
    at_vertices, between : float
        Of the height of a vertex, and of a place on a face, averaged over all places.
    """

    at_vertices: float
    between: float

    @property
    def is_less(self) -> bool:
        """Whether heights were smoothed."""
        return self.at_vertices < 1.0


NOT_SMOOTHED = KeptNoise(1.0, 0.5)
"""The weights of the corners are 1/6 each when squared and averaged over a face, together 1/2."""


def noise_of_points(
    patches: SurfacePatches, points: FloatArray, counted: BoolArray, within: float, rise: float
) -> float:
    """Standard error of the points [m] about the faces between the patches; 0 where there are no faces.

    Parameters
    ----------
    counted : (P,) bool
        Patches whose points count, with the faces between these.
    within : float
        Points farther from the faces [m] do not count.
    """
    arrays = (points, patches.firsts, patches.ends, patches.centres, patches.heights, patches.links(rise))
    distances = distances_to_faces(*arrays, counted, patches.grid.cell, within)
    return float(np.nanmedian(np.abs(distances))) / MEDIAN_OF_ERRORS if np.isfinite(distances).any() else 0.0


def settled(patches: SurfacePatches, points: FloatArray, limits: HeightLimits) -> SurfacePatches:
    """Copy with heights along the slopes of the surface, and the points that stand on it counted."""
    bands = np.array([limits.thickness, limits.step, limits.clearance])
    for _ in range(SETTLINGS):
        links = patches.links(limits.rise)
        slopes = slopes_of_patches(patches.heights, links, patches.grid.cell)
        arrays = (patches.firsts, patches.ends, patches.kinds, patches.centres, patches.heights)
        heights, standing = settle_patches(points, *arrays, slopes, links, bands)
        patches = replace(patches, heights=heights, standing=standing)
    return patches


def smoothed(patches: SurfacePatches, limits: HeightLimits) -> tuple[SurfacePatches, KeptNoise]:
    """Copy with heights weighed against a smooth surface, and what these keep of the noise of a cell's mean.

    The ground's own bends are what the bends of the heights have beyond the noise: their median, as boulders are the
    business of ``fitted``. Maximum of the posterior probability for independent normal errors and bends (Wahba, "Spline
    models for observational data", 1990, 1.5). Its variance is the mean, over all frequencies, of what the smoothing
    lets through; it is stated for all bends, boulders included, which is more.
    """
    counts = (patches.ends - patches.firsts).astype(np.int32)
    usual = float(np.median(counts[patches.is_ground])) if patches.is_ground.any() else 1.0
    if limits.noise <= UNSTEADY * np.sqrt(usual):
        return patches, NOT_SMOOTHED
    links = patches.links(limits.rise)
    bends, variances = bends_of_patches(patches.heights, counts, links)
    if not len(bends):
        return patches, NOT_SMOOTHED
    variance, least = limits.noise * limits.noise, LEAST_BENDS * limits.noise * limits.noise
    usual_bend = float(np.median(np.abs(bends))) / MEDIAN_OF_ERRORS
    of_most, of_all = (
        max(square - variance * float(variances.mean()), least) / BEND_SHARE
        for square in (usual_bend * usual_bend, float((bends * bends).mean()))
    )
    heights = smoothed_heights(patches.heights, counts, links, variance / of_most, ROUNDS)
    return replace(patches, heights=heights), _kept_noise(variance / of_all / usual)


def _kept_noise(stiffness: float) -> KeptNoise:
    """Means of what smoothing lets through of noise, over all frequencies of a square grid.

    On a face, the product of two weights of corners is 1/12 on average and the square of one 1/6. So of a frequency
    comes 1/2 plus a third of the mean cosine along the three edges, either diagonal being as likely.
    """
    angles = [math.pi * (step + 0.5) / FREQUENCIES for step in range(2 * FREQUENCIES)]
    cosine, sine = np.array([math.cos(angle) for angle in angles]), np.array([math.sin(angle) for angle in angles])
    both, turned = cosine[:, None] * cosine, sine[:, None] * sine
    cosines = (cosine[:, None], cosine, both - turned, both + turned)  # of x, y, x + y and x - y
    along_x, along_y, *diagonal = (4.0 * (1.0 - one) * (1.0 - one) for one in cosines)
    bend = along_x + along_y + ACROSS * (diagonal[0] + diagonal[1])
    share = 1.0 / (1.0 + stiffness * bend)
    between = 0.5 + (cosine[:, None] + cosine + 0.5 * (cosines[2] + cosines[3])) / 6.0
    return KeptNoise(float(share.mean()), float((between * share).mean()))


def fitted(patches: SurfacePatches, points: FloatArray, limits: HeightLimits, is_smoothed: bool) -> SurfacePatches:
    """Copy whose faces are as near to the ground points as these are exact; see ``fitted_heights``."""
    everywhere = np.ones(len(patches.cells), dtype=np.bool_)
    improbable = IMPROBABLE_AFTER_SMOOTHING if is_smoothed else IMPROBABLE
    for _ in range(FITTINGS):
        error = noise_of_points(patches, points, everywhere, limits.thickness, limits.rise)
        arrays = (points, patches.firsts, patches.ends, patches.centres, patches.heights, patches.links(limits.rise))
        heights = fitted_heights(*arrays, patches.grid.cell, np.array([limits.thickness, improbable * error]))
        patches = replace(patches, heights=heights)
    return patches


def without_false_ground(patches: SurfacePatches, limits: HeightLimits, least: int) -> SurfacePatches:
    """Copy in which lowest patches that no ground holds up are what stands there, or gone if they have few points.

    Parameters
    ----------
    least : int
        Points that make an obstacle.
    """
    standing = patches.standing.copy()
    links, is_ground = patches.links(limits.rise), standing < least
    while True:
        found = unsupported_patches(patches.heights, patches.kinds, links, is_ground, limits.step)
        if not found.any():
            break
        is_ground &= ~found
        standing[found] = (patches.ends - patches.firsts)[found]
    return replace(patches, standing=standing).without(~is_ground & (standing < least))


def bends_of_patches(heights: FloatArray, counts: IntArray, links: IntArray) -> tuple[FloatArray, FloatArray]:
    """Second differences (n,) [m] of the heights along rows and columns, and what one point's error adds to each (n,).

    The second is the variance of a difference for heights that are means of ``counts`` (P,) points with a variance of
    one; ``links`` (P, 8) as in ``kernels.building.patches``.
    """
    one, other, is_seen = links[:, [0, 2]], links[:, [4, 6]], counts > 0
    is_whole = (one >= 0) & (other >= 0) & is_seen[:, None] & is_seen[one] & is_seen[other]
    patch, axis = np.nonzero(is_whole)
    one, other = one[patch, axis], other[patch, axis]
    bends = heights[one] - 2.0 * heights[patch] + heights[other]
    return bends, 1.0 / counts[one] + 4.0 / counts[patch] + 1.0 / counts[other]


def unsupported_patches(
    heights: FloatArray, kinds: IntArray, links: IntArray, is_ground: BoolArray, step: float
) -> BoolArray:
    """Mask (P,) of lowest patches at an edge that are more than ``step`` [m] above where the ground beside them leads.

    At the edge of what was seen a column may hold points of a post and none of the ground below it. Such a patch has
    ground on one side, from which it stands out, and none in the three cells on the other.

    Parameters
    ----------
    is_ground : (P,) bool
        Patches that are still taken for ground; links to others do not count.
    """
    has_ground = (links >= 0) & is_ground[links]
    mask = np.zeros(len(heights), dtype=np.bool_)
    for direction in range(DIRECTIONS):
        across = [(direction + turn) % DIRECTIONS for turn in (3, 4, 5)]
        is_edge = has_ground[:, direction] & ~has_ground[:, across].any(axis=1)
        edge = np.flatnonzero((kinds == LOWEST) & is_ground & is_edge)
        beside = links[edge, direction]
        behind = heights[links[beside, direction]]
        rise = np.where(has_ground[beside, direction], np.maximum(heights[beside] - behind, 0.0), 0.0)
        mask[edge[heights[edge] - heights[beside] - rise > step]] = True
    return mask
