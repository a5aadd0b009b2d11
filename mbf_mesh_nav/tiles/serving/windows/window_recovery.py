"""A recovery for one mesh, run on the window around the robot, which stays where it is until the recovery is done."""

from __future__ import annotations

from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest, RecoveryResult
from mbf_mesh_nav.plugins import MeshRecovery
from mbf_mesh_nav.tiles.serving.parts import OnWindow


class WindowRecovery(OnWindow[MeshRecovery], AbstractRecovery):
    """Makes a recovery on the window of now for each run."""

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Run the recovery on the window of now."""
        with self._map.held_window():
            self._inner = self._made()
            return self._inner.run_behavior(request)

    def parameters_changed(self) -> None:
        """Refuse those with which it looks beyond the window; the next run has the others."""
        self._require_room()

    def _made(self) -> MeshRecovery:
        made = super()._made()
        made.navigation_map = self._map  # freshness and moving objects are those of the whole map
        return made
