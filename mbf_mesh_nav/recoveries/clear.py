"""Forget all sensed obstacles; the static layers stay. Helps when a passing person left marks, costs nothing.

No controller drives before every sensor has seen again: what was forgotten may still be there.
"""

from __future__ import annotations

from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.plugins import MeshRecovery


class ClearRecovery(MeshRecovery):
    """Clears the obstacle layers of the map."""

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Clear at once; the robot does not move."""
        before = self.mesh_map.snapshot()
        self.mesh_map.clear()
        freed = int((before.lethal & ~self.mesh_map.snapshot().lethal).sum())
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"{freed} vertices are free again")
