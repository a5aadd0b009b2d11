"""Smooth a path: round its corners, keep clear of obstacles, and tell whether the robot can drive the curves.

When to use: behind a grid planner (A*, Theta*), before a controller that follows exactly. When not: paths of
``costmap.hybrid_astar``, which are drivable already - smoothing ignores headings and would break their curvature.

The end poses stay. A path that drives backward somewhere is handed back unchanged. With ``max_curvature`` the pull to
the original path is lowered until the largest curvature of the path is below it; if that fails the outcome is FAILURE
and the message names the place.

Formula: the gradient smoother of Dolgov et al. 2010 without its Voronoi term, with a hard limit of the cost instead.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RefineResult
from mbf_costmap_nav.costmap import Costmap
from mbf_costmap_nav.kernels.smoothing import relax_path
from mbf_costmap_nav.path_geometry import resample
from mbf_costmap_nav.path_handling import PathTracker
from mbf_costmap_nav.plugins import CostmapRefiner

FloatArray = NDArray[np.float64]

SOFTER = 0.25
"""Each further attempt for the curvature multiplies the pull to the original path by this."""
ATTEMPTS = 6


class SmootherParameters(PluginParameters):
    """Parameters of ``costmap.smoother``."""

    data_weight: float = parameter(0.1, "Pull of each point to where it was.", gt=0.0, lt=1.0)
    smooth_weight: float = parameter(0.35, "Pull of each point between its neighbours.", gt=0.0, lt=0.5)
    spacing: float = parameter(0.1, "Largest distance of two poses.", unit="m", gt=0.0, le=5.0)
    highest_cost: int = parameter(
        200, "Points are not moved to cells of more than this, unless it is better.", ge=0, le=252
    )
    max_curvature: float = parameter(0.0, "Limit of the curvature; 0 = none.", unit="1/m", ge=0.0, le=100.0)
    tolerance: float = parameter(0.001, "Stop when no point moves further in a sweep.", unit="m", gt=0.0, le=1.0)
    max_sweeps: int = parameter(1000, "Stop after this many sweeps.", ge=1, le=100000)


class SmootherRefiner(CostmapRefiner):
    """Cost-aware path smoother."""

    Parameters: ClassVar[type[PluginParameters]] = SmootherParameters
    parameters: SmootherParameters

    def apply_refinement(self, path: Path, cancel_token: CancelToken) -> RefineResult:
        """Smooth between the ends of the path."""
        p = self.parameters
        costmap = self.costmap.snapshot()
        if len(path) < 2:
            return RefineResult(RefinePathOutcome.SUCCESS, "nothing to smooth", path)
        if not costmap.world_to_cells(path.positions)[1].all():
            return RefineResult(RefinePathOutcome.MAP_ERROR, f"the path leaves {costmap}")
        if PathTracker(path).reverse.any():
            return RefineResult(
                RefinePathOutcome.SUCCESS, "the path drives backward somewhere and is left as it is", path
            )
        points = resample(path.positions[:, :2], p.spacing)
        data_weight = p.data_weight
        for _ in range(ATTEMPTS):
            smoothed = self._smooth(costmap, points, data_weight, cancel_token)
            if cancel_token.cancelled:
                return RefineResult(RefinePathOutcome.CANCELED, cancel_token.reason)
            curvature = curvatures(smoothed)
            if p.max_curvature == 0.0 or curvature.max() <= p.max_curvature:
                return RefineResult(RefinePathOutcome.SUCCESS, "", self._path(path, smoothed))
            data_weight *= SOFTER
        worst = int(np.argmax(curvature))
        x, y = smoothed[worst]
        text = f"curvature {curvature[worst]:.2f} 1/m at ({x:.2f}, {y:.2f}) stays above the limit {p.max_curvature:.2f}"
        return RefineResult(RefinePathOutcome.FAILURE, text)

    def _smooth(self, costmap: Costmap, points: FloatArray, data_weight: float, token: CancelToken) -> FloatArray:
        p = self.parameters
        origin = (costmap.origin_x, costmap.origin_y)
        cells, _ = relax_path(
            costmap.cells,
            (points - origin) / costmap.resolution,
            data_weight,
            p.smooth_weight,
            p.highest_cost,
            p.tolerance / costmap.resolution,
            p.max_sweeps,
            token.flag,
        )
        return np.asarray(cells * costmap.resolution + origin)

    def _path(self, path: Path, smoothed: FloatArray) -> Path:
        """Poses along the smoothed points; the first and last orientation of the given path stay."""
        assert path.orientations is not None
        flat = Path.from_points(np.column_stack([smoothed, np.zeros(len(smoothed))]))
        assert flat.orientations is not None
        orientations = flat.orientations.copy()
        orientations[0], orientations[-1] = path.orientations[0], path.orientations[-1]
        return Path(flat.positions, orientations, path.frame_id, path.stamp)


def curvatures(points: FloatArray) -> FloatArray:
    """(n,) curvature [1/m] at the inner points of a polyline: turn over the mean length beside it; 0 at the ends."""
    steps = np.diff(points, axis=0)
    headings, lengths = np.arctan2(steps[:, 1], steps[:, 0]), np.hypot(*steps.T)
    turns = np.abs((np.diff(headings) + np.pi) % (2.0 * np.pi) - np.pi)
    inner = turns / np.maximum(0.5 * (lengths[1:] + lengths[:-1]), 1e-9)
    return np.concatenate([[0.0], inner, [0.0]])
