"""A refiner for one mesh, run along a path over any number of tiles, one piece after another on the map around it.

Of each refined piece the first part is kept, and the rest is refined again with what follows, so no seam stays where
pieces meet. All pieces see the map as it was when the first one was refined.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.refiners.map_refiner import MapRefiner
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import RefineResult
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.plugins import MeshRefiner
from mbf_mesh_nav.tiles.serving.moment import Moment
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.parts import on_part

PIECE = 128.0
"""Length of a piece, in distances between vertices; longer bends are straightened in part."""
KEPT = 0.5
"""Share of a refined piece that is not refined again."""
MARGIN = 8.0
"""Of the map around a piece, in distances between vertices; without costs the shortest path lies within its box."""


class PathRefiner(MapRefiner):
    """Makes a refiner on the part around each piece.

    A path that drives backward somewhere is left as a whole, as on one mesh: its pieces that drive forward are not
    looked at for themselves.

    Parameters
    ----------
    context : MapContext
        With a map of tiles.
    """

    def __init__(self, refiner_class: type[MeshRefiner], context: MapContext[TiledNavigationMap]) -> None:
        super().__init__(context)
        self._class, self._context, self._map = refiner_class, context, context.navigation_map
        self.forward_only = issubclass(refiner_class, MapRefiner) and refiner_class.forward_only

    def refine(self, path: Path, cancel_token: CancelToken) -> RefineResult:
        """Refine piece by piece; a damaged tile and poses too far apart are a MAP_ERROR."""
        try:
            return self._by_pieces(path, cancel_token)
        except MeshError as error:
            return RefineResult(RefinePathOutcome.MAP_ERROR, str(error))

    def _by_pieces(self, rest: Path, cancel_token: CancelToken) -> RefineResult:
        moment, done, notes = self._map.moment(), rest[:0], dict[str, None]()
        while True:
            lengths = polyline_lengths(rest.positions)
            count = max(int(np.searchsorted(lengths, PIECE * self._map.spacing, side="right")), 2)
            result = self._piece(rest[:count], moment, cancel_token)
            if cancel_token.cancelled:
                return RefineResult(RefinePathOutcome.CANCELED, cancel_token.reason)
            if not result.success or result.path is None:
                place = position_text(rest.positions[0]) if len(rest) else "its begin"
                return replace(result, message=f"in the piece from {place}: {result.message}")
            if result.message:
                notes[result.message] = None
            if count >= len(rest):
                return RefineResult(RefinePathOutcome.SUCCESS, "; ".join(notes), _joined(done, result.path))
            lengths = polyline_lengths(result.path.positions)
            kept = max(int(np.searchsorted(lengths, KEPT * lengths[-1])), 1)
            done = _joined(done, result.path[:kept])
            rest = _joined(result.path[kept:], rest[count:])

    def _piece(self, piece: Path, moment: Moment, cancel_token: CancelToken) -> RefineResult:
        if not len(piece):
            return RefineResult(RefinePathOutcome.SUCCESS, "nothing to refine", piece)
        margin = MARGIN * self._map.spacing
        low, high = piece.positions[:, :2].min(axis=0) - margin, piece.positions[:, :2].max(axis=0) + margin
        if (longest := float((high - low).max())) > self._map.reach:
            text = f"its poses are so far apart that {longest:.4g} m of the map lie around two of them"
            return RefineResult(RefinePathOutcome.MAP_ERROR, f"{text}, the limit is {self._map.reach:.4g} m")
        part = moment.within((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))
        if part is None:
            return RefineResult(RefinePathOutcome.MAP_ERROR, "there is no surface around it")
        return on_part(self._class, self._context, self.parameters, part).apply_refinement(piece, cancel_token)


def _joined(first: Path, then: Path) -> Path:
    """One path of two, without a pose that both have."""
    assert first.orientations is not None and then.orientations is not None
    if len(first) and len(then) and (first.positions[-1] == then.positions[0]).all():
        first = first[:-1]
    return replace(
        then,
        positions=np.concatenate([first.positions, then.positions]),
        orientations=np.concatenate([first.orientations, then.orientations]),
    )
