"""How wrong the height of each vertex of a built map may be, as far as its points show.

Two things make a height wrong. The noise of the points is what is left of it in the mean of a cell; where grass stands,
its blades are noise, too. And where points disagree by more than their noise, they have seen ground that the faces do
not show: relief between the vertices, or a boulder that scans from wrong poses have put to several places, so that it
is a low hill on the map. Their spread beyond the noise is how far the ground is from the faces there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.building.heights import MEDIAN_OF_ERRORS, KeptNoise
from mbf_mesh_nav.building.noise_by_place import medians_by_place
from mbf_mesh_nav.building.surface_patches import SurfacePatches
from mbf_mesh_nav.kernels.building.disagreement import INVERSES, PATCHES, POINTS, SQUARES, sums_around

BY_CHANCE = 2.0
"""Standard errors by which the variance of the points of a place may exceed that of all."""


def height_errors(
    patches: SurfacePatches, distances: NDArray[np.float32], links: IntArray, used: BoolArray, kept: KeptNoise
) -> tuple[FloatArray, FloatArray]:
    """Standard errors (P,) [m] of the heights of patches, of the place that is a patch and those linked to it.

    The variance of the noise is that of the median distance of the points around, which boulders do not change. Where
    heights were smoothed, i.e. where poses are wrong, it is that of all points: points next to each other are of
    different scans then, and what would look like grass may be boulders put to several places. A cell takes one degree
    of freedom of its points, less if its height was smoothed. The mean of a cell has the variance of a
    point over their number, on average over the place; where heights are smoothed, cells with few points lean on
    their neighbours, and the usual number counts. A place without a point, in a filled hole, has that of one point. To
    it comes the variance of the place beyond that of the noise, unless chance explains it: the variance of n
    normally distributed points has the standard error sqrt(2 / n) of itself. Errors that all points of a place have in
    common, as of scans from a drifting pose, lift it as a whole; they are not in it.

    A wheel stands on a face and not on a vertex: noise there is a mean of that of three vertices, relief is not.

    Parameters
    ----------
    distances : (n,) float32
        Of the points from the faces [m], sorted as the patches number them; NaN for points of no face.
    links : (P, 8) int32
        As in ``kernels.building.patches``.
    used : (P,) bool
        Patches that are vertices.
    kept : KeptNoise
        What smoothing lets through of the noise.

    Returns
    -------
    of_vertices, of_places : (P,) float64
        Standard errors [m] of the heights of the patches, and of places on the faces around them.
    """
    known = np.abs(distances[np.isfinite(distances)].astype(np.float64))
    if not len(known):
        return np.zeros(len(patches.cells)), np.zeros(len(patches.cells))
    kept_error = math.sqrt(kept.at_vertices)
    counts = (patches.ends - patches.firsts)[used & ~patches.is_filled]
    noise = np.full(len(used), np.median(known)) if kept.is_less else medians_by_place(patches, distances, used)
    noise *= 1.0 / MEDIAN_OF_ERRORS * np.sqrt(len(known) / max(len(known) - kept_error * len(counts), 1.0))
    sums = sums_around(distances, patches.firsts, patches.ends, links, used)
    points, cells = np.maximum(sums[:, POINTS], 1.0), np.maximum(sums[:, PATCHES], 1.0)
    of_cell = np.where(sums[:, PATCHES] > 0.0, sums[:, INVERSES] / cells, 1.0)
    if kept.is_less:
        of_cell = np.full(len(points), 1.0 / np.median(counts))
    by_chance = noise * noise * (1.0 + BY_CHANCE * np.sqrt(2.0 / points))
    variance = sums[:, SQUARES] / np.maximum(points - kept_error * sums[:, PATCHES], 1.0)
    unresolved = np.maximum(variance - by_chance, 0.0)
    of_mean = noise * noise * of_cell
    return np.sqrt(kept.at_vertices * of_mean + unresolved), np.sqrt(kept.between * of_mean + unresolved)


def root_mean_square(errors: FloatArray) -> float:
    """One number for errors (n,); 0 without any."""
    return float(np.sqrt((errors * errors).mean())) if len(errors) else 0.0
