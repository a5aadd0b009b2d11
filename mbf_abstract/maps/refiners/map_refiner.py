"""The base of refiners on any map: which paths stay as they are, the frame of the map, cancels and failures."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.map_plugin import MapPlugin
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import AbstractRefiner, RefineResult
from mbf_abstract.time.cancel import CancelToken


class MapRefiner(MapPlugin, AbstractRefiner):
    """A refiner that works in the frame of its map: write ``refine``.

    Attributes
    ----------
    forward_only : bool
        Whether a path that drives backward somewhere is left as it is.
    """

    forward_only = True

    @abstractmethod
    def refine(self, path: Path, cancel_token: CancelToken) -> Path | RefineResult:
        """Return a better path of at least two poses, also as a result with notes, or why there is none.

        Parameters
        ----------
        path : Path
            At least two poses in the frame of the map.
        cancel_token : CancelToken
            Once it is set, any answer will do.
        """

    def apply_refinement(self, path: Path, cancel_token: CancelToken) -> RefineResult:
        """Refine the path in the frame of the map; without success the result has the path as it was given."""
        if len(path) < 2:
            return RefineResult(RefinePathOutcome.SUCCESS, "nothing to refine", path)
        if self.forward_only and PathTracker(path).reverse.any():
            text = "the path drives backward somewhere and is left as it is"
            return RefineResult(RefinePathOutcome.SUCCESS, text, path)
        frame = self.navigation_map.frame_id
        try:
            T_map_path = self.transforms.lookup(frame, path.frame_id)
        except TransformError as error:
            text = f"the path cannot be transformed to the frame of the map: {error}"
            return RefineResult(RefinePathOutcome.MAP_ERROR, text, path)
        refined = self.refine(path if path.frame_id == frame else T_map_path.apply_to_path(path), cancel_token)
        if cancel_token.cancelled:
            return RefineResult(RefinePathOutcome.CANCELED, cancel_token.reason, path)
        result = refined if isinstance(refined, RefineResult) else RefineResult(RefinePathOutcome.SUCCESS, "", refined)
        if not result.success or result.path is None:
            return replace(result, path=path)
        return (
            result if path.frame_id == frame else replace(result, path=T_map_path.inverse().apply_to_path(result.path))
        )
