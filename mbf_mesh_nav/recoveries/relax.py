"""Let the robot pass closer to obstacles for a while: smaller inflation, restored by itself.

For a robot that finds no way although one is there, say a door narrower than the distance it usually keeps. When not:
if the configured inscribed radius has no margin, the body may touch; on stale obstacles ``mesh.clear_layers`` is the
cure. The robot does not move: the behaviour returns at once and planning goes on with the relaxed layer. Cost: the
layer is computed twice, when relaxed and when restored.
"""

from __future__ import annotations

from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.plugins import MeshRecovery

RADII = ("inscribed_radius", "inflation_radius")


class RelaxParameters(PluginParameters):
    """Parameters of ``mesh.relax``."""

    layer: str = parameter("inflation", "The inflation layer to relax.")
    scale: float = parameter(0.8, "Factor on its radii meanwhile.", gt=0.0, le=1.0)
    duration: float = parameter(20.0, "How long the relaxed radii hold.", unit="s", gt=0.0, le=600.0)


class RelaxRecovery(MeshRecovery):
    """Shrinks the radii of an inflation layer for a time."""

    Parameters = RelaxParameters
    parameters: RelaxParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Relax the layer, or hold the relaxed radii longer if they are."""
        p = self.parameters
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        if p.layer not in self.mesh_map.layers:
            known = ", ".join(self.mesh_map.layers) or "none"
            return RecoveryResult(RecoveryOutcome.FAILURE, f"the map has no layer '{p.layer}'; its layers are: {known}")
        usual = self.mesh_map.usual_parameters(p.layer)
        relaxed = {name: p.scale * getattr(usual, name) for name in RADII if hasattr(usual, name)}
        if not relaxed:
            return RecoveryResult(RecoveryOutcome.FAILURE, f"the layer '{p.layer}' has no radius to relax")
        end = self.clock.now() + p.duration
        self.mesh_map.set_layer_parameters(p.layer, usual.model_copy(update=relaxed), until=end)
        values = ", ".join(f"{name} {value:g} m" for name, value in relaxed.items())
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"layer '{p.layer}' has {values} for {p.duration:g} s")
