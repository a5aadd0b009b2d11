"""A recovery for one mesh, run on the window around the robot, which stays where it is until the recovery is done."""

from __future__ import annotations

from mbf_abstract.maps.navigation_map import MapContext
from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest, RecoveryResult
from mbf_mesh_nav.plugins import MeshRecovery
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.parts import on_part


class WindowRecovery(AbstractRecovery):
    """Makes a recovery on the window of now for each run.

    Parameters
    ----------
    recovery_class : type
    context : MapContext
        With a map of tiles that has a window.

    Raises
    ------
    ValueError
        The window is too small for it.
    """

    def __init__(self, recovery_class: type[MeshRecovery], context: MapContext[TiledNavigationMap]) -> None:
        super().__init__(context)
        self._class, self._context, self._map = recovery_class, context, context.navigation_map
        self._map.require_room(recovery_class.reach(self.parameters))
        self._inner = self._made()
        self.modelled_compute_time = self._inner.modelled_compute_time

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Run the recovery on the window of now."""
        with self._map.held_window():
            self._inner = self._made()
            return self._inner.run_behavior(request)

    def cancel(self) -> bool:
        """As the recovery."""
        return self._inner.cancel()

    def parameters_changed(self) -> None:
        """Refuse those with which it looks beyond the window; the next run has the others."""
        self._map.require_room(self._class.reach(self.parameters))

    def _made(self) -> MeshRecovery:
        made = on_part(self._class, self._context, self.parameters, self._map.window_map)
        made.navigation_map = self._map  # freshness and moving objects are those of the whole map
        return made
