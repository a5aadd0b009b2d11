"""Smooth a path: round its corners, keep clear of obstacles, and check that the robot can drive the curves.

When to use: behind a grid planner (A*, Theta*), before a controller that follows exactly. When not: paths of
``costmap.hybrid_astar``, which are drivable already - smoothing ignores headings and would break their curvature.

The result is no worse than the path given: where costs are above ``highest_cost`` it comes no more than a cell nearer
to obstacles, and on no line between its poses does the outline touch worse cells than it did near there on the path
given, robots looking along both; where it would, points stay.

The end poses stay, and so do the heights along the path. A path in another frame than the costmap's is smoothed there
and handed back in its own. A path that drives backward somewhere is handed back unchanged. With ``max_curvature`` the
weight of the original path is lowered until the largest curvature of the path is below it; if that fails, or if the
path runs through lethal cells before and after, the outcome is FAILURE, the message names the place, and the path of
the result is the one given.

Formula: the gradient smoother of Dolgov et al. 2010 without its Voronoi term, with a hard limit of the cost instead.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Path
from mbf_abstract.geometry.arithmetic import arctan2
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.maps.refiners.map_refiner import MapRefiner
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RefineResult
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.control.path_geometry import resample
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.kernels.control.smoothing import HIGHEST, costs_near, relax_path
from mbf_costmap_nav.kernels.map.swept_outline import swept_states
from mbf_costmap_nav.plugins import CostmapRefiner

FloatArray = NDArray[np.float64]

SOFTER = 0.25
"""Each further attempt for the curvature multiplies the weight of the original path by this."""
ATTEMPTS = 6
OUTLINE_ATTEMPTS = 12
"""How often more points stay, until the outline is nowhere on worse cells; each time those of a longer stretch."""
LETHAL_STEP = 0.1
"""Distance [cells] of the places at which the result is looked up."""
LINES = 2
"""The cost a point may have is found on so many lines of the path before it and behind it."""


class SmootherParameters(PluginParameters):
    """Parameters of ``costmap.smoother``."""

    data_weight: float = parameter(0.1, "Weight of a point's original position.", gt=0.0, lt=1.0)
    smooth_weight: float = parameter(0.35, "Weight of the midpoint of a point's neighbours.", gt=0.0, lt=0.5)
    spacing: float = parameter(0.1, "Largest distance of two poses.", unit="m", gt=0.0, le=5.0)
    highest_cost: int = parameter(
        50, "Points are moved to cells of more than this only where the path has such costs already.", ge=0, le=HIGHEST
    )
    max_curvature: float = parameter(0.0, "Limit of the curvature; 0 = none.", unit="1/m", ge=0.0, le=100.0)
    tolerance: float = parameter(0.001, "Stop when no point moves further in a sweep.", unit="m", gt=0.0, le=1.0)
    max_sweeps: int = parameter(1000, "Stop after this many sweeps.", ge=1, le=100000)


class SmootherRefiner(CostmapRefiner, MapRefiner):
    """Cost-aware path smoother."""

    Parameters: ClassVar[type[PluginParameters]] = SmootherParameters
    parameters: SmootherParameters

    def refine(self, path: Path, cancel_token: CancelToken) -> Path | RefineResult:
        """Smooth between the ends of the path."""
        costmap = self.costmap.snapshot()
        if not costmap.world_to_cells(path.positions)[1].all():
            return RefineResult(RefinePathOutcome.MAP_ERROR, f"the path leaves {costmap}")
        points = resample(path.positions[:, :2], self.parameters.spacing)
        lengths, old_lengths = polyline_lengths(points), polyline_lengths(path.positions[:, :2])
        heights = np.interp(lengths, old_lengths, path.positions[:, 2])
        near = max(self.costmap.footprint.circumscribed_radius, self.parameters.spacing)
        allowed = highest_near(self._states(costmap, points), lengths, near)
        fixed = np.zeros(len(points), dtype=np.bool_)
        for attempt in range(1, OUTLINE_ATTEMPTS + 1):
            smoothed = self._drivable(costmap, points, fixed, cancel_token)
            if isinstance(smoothed, RefineResult):
                return smoothed
            worse = np.flatnonzero((self._states(costmap, smoothed) > allowed).any(axis=1))
            if not len(worse) or cancel_token.cancelled:
                return _along(path, smoothed, heights)
            x, y = smoothed[worse[0]].tolist()
            ends = np.concatenate([lengths[worse], lengths[worse + 1]])
            fixed |= (np.abs(lengths[:, None] - ends) <= attempt * near).any(axis=1)
        text = f"smoothed, the path would be worse for the robot's outline at ({x:.2f}, {y:.2f}), and is left as it is"
        return RefineResult(RefinePathOutcome.SUCCESS, text, path)

    def _states(self, costmap: Costmap, points: FloatArray) -> NDArray[np.int64]:
        """Worst states (n - 1, 4) on the lines between points: of all cells touched, and of the known ones among them.

        First of the padded outline, which controllers check, then of the plain one.
        """
        in_cells = (points - (costmap.origin_x, costmap.origin_y)) / costmap.resolution
        outlines = (self.costmap.footprint.vertices, self.costmap.unpadded_footprint.vertices)
        corners = [outline if len(outline) > 2 else np.zeros((1, 2)) for outline in outlines]
        return np.hstack([swept_states(costmap.cells, one / costmap.resolution, in_cells) for one in corners])

    def _drivable(
        self, costmap: Costmap, points: FloatArray, fixed: NDArray[np.bool_], token: CancelToken
    ) -> FloatArray | RefineResult:
        """Smoothed points (n, 2) [m] below the largest curvature and off lethal cells, or the reason of a failure."""
        p = self.parameters
        data_weight = p.data_weight
        for _ in range(ATTEMPTS):
            smoothed = self._smooth(costmap, points, fixed, data_weight, token)
            curvature = curvatures(smoothed)
            if token.cancelled or p.max_curvature == 0.0 or curvature.max() <= p.max_curvature:
                break
            data_weight *= SOFTER
        else:
            worst = int(np.argmax(curvature))
            place = f"{curvature[worst]:.2f} 1/m at ({smoothed[worst, 0]:.2f}, {smoothed[worst, 1]:.2f})"
            text = f"curvature {place} stays above the limit {p.max_curvature:.2f}"
            return RefineResult(RefinePathOutcome.FAILURE, text)
        lethal = first_lethal(costmap, smoothed)
        if lethal is None:
            return smoothed
        text = f"the path runs through a lethal cell at ({lethal[0]:.2f}, {lethal[1]:.2f}), smoothed or not"
        return RefineResult(RefinePathOutcome.FAILURE, text)

    def _smooth(
        self,
        costmap: Costmap,
        points: FloatArray,
        fixed: NDArray[np.bool_],
        data_weight: float,
        token: CancelToken,
    ) -> FloatArray:
        p = self.parameters
        origin = (costmap.origin_x, costmap.origin_y)
        in_cells = (points - origin) / costmap.resolution
        cells, _ = relax_path(
            costmap.cells,
            in_cells,
            data_weight,
            p.smooth_weight,
            np.maximum(costs_near(costmap.cells, in_cells, LINES), p.highest_cost),
            fixed,
            p.tolerance / costmap.resolution,
            p.max_sweeps,
            token.flag,
        )
        return np.asarray(cells * costmap.resolution + origin)


def _along(path: Path, points: FloatArray, heights: FloatArray) -> Path:
    """Path through points (n, 2) that looks along them, with exactly the first and the last pose of the given path."""
    flat = Path.from_points(np.column_stack([points, np.zeros(len(points))]))
    assert path.orientations is not None and flat.orientations is not None
    positions, orientations = np.column_stack([points, heights]), flat.orientations.copy()
    positions[[0, -1]], orientations[[0, -1]] = path.positions[[0, -1]], path.orientations[[0, -1]]
    return Path(positions, orientations, path.frame_id, path.stamp)


def highest_near(states: NDArray[np.int64], lengths: FloatArray, near: float) -> NDArray[np.int64]:
    """(n - 1, k) highest states of all lines within ``near`` [m] along the path from each of its lines.

    ``lengths`` (n,) [m] are those up to its points.
    """
    first = np.searchsorted(lengths[1:], lengths[:-1] - near)
    last = np.searchsorted(lengths[:-1], lengths[1:] + near, side="right")
    return np.array([states[i:j].max(axis=0) for i, j in zip(first, last, strict=True)])


def first_lethal(costmap: Costmap, points: FloatArray) -> FloatArray | None:
    """First place (2,) [m] of a polyline on a lethal cell; a corner that a line only touches does not count."""
    fine = resample(points, LETHAL_STEP * costmap.resolution)
    middles = 0.5 * (fine[1:] + fine[:-1])
    cells, inside = costmap.world_to_cells(middles)
    middles, cells = middles[inside], cells[inside]
    hits = np.flatnonzero(costmap.cells[cells[:, 1], cells[:, 0]] == LETHAL)
    return middles[hits[0]] if hits.size else None


def curvatures(points: FloatArray) -> FloatArray:
    """(n,) curvature [1/m] at the inner points of a polyline: turn over the mean length beside it; 0 at the ends."""
    steps = np.diff(points, axis=0)
    headings, lengths = arctan2(steps[:, 1], steps[:, 0]), np.hypot(*steps.T)
    turns = np.abs((np.diff(headings) + np.pi) % (2.0 * np.pi) - np.pi)
    inner = turns / np.maximum(0.5 * (lengths[1:] + lengths[:-1]), 1e-9)
    return np.concatenate([[0.0], inner, [0.0]])
