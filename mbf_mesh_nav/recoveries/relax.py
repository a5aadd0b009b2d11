"""Be less strict for a while: smaller inflation, wider tolerances of planner and arrival, restored by the clock.

For a robot that finds no way although one is there, say a door narrower than the distance it usually keeps, for a goal
that is just occupied, or one that cannot be reached exactly. It opens no way narrower than the robot: a layer's
inscribed radius shrinks to that of the map at most. When not: on stale obstacles, for which ``mesh.clear`` is
the cure. The robot does not move: the behaviour returns at once and planning goes on with what is relaxed. Running it
again meanwhile only prolongs it. Cost: the layer is computed twice, when relaxed and when restored.
"""

from __future__ import annotations

from mbf_abstract.maps.relaxation import Slack
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.layers.inflation import InflationParameters
from mbf_mesh_nav.plugins import MeshRecovery


class RelaxParameters(PluginParameters):
    """Parameters of ``mesh.relax``."""

    layer: str = parameter("inflation", "The inflation layer to relax; empty = none.")
    inflation_factor: float = parameter(0.8, "Factor on its radii meanwhile.", gt=0.0, le=1.0)
    planner_tolerance: float = parameter(
        0.2, "Paths may end at least this far from the goal; 0 = unchanged.", unit="m", ge=0.0, le=100.0
    )
    dist_tolerance: float = parameter(
        0.2, "This near to the goal counts as arrived; 0 = unchanged.", unit="m", ge=0.0, le=100.0
    )
    angle_tolerance: float = parameter(0.35, "The same for the heading; 0 = unchanged.", unit="rad", ge=0.0, le=3.2)
    duration: float = parameter(20.0, "How long it all holds.", unit="s", gt=0.0, le=600.0)


class RelaxRecovery(MeshRecovery):
    """Shrinks the radii of an inflation layer and grants slack to planning and arrival for a time."""

    Parameters = RelaxParameters
    parameters: RelaxParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Relax the layer, then the tolerances, or hold both longer if they are relaxed."""
        p = self.parameters
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        until = self.clock.now() + p.duration
        inflation = self._relax_layer(until) if p.layer else "inflation as usual"
        if isinstance(inflation, RecoveryResult):
            return inflation
        self.relaxation.grant(self.name, Slack(p.planner_tolerance, p.dist_tolerance, p.angle_tolerance), until)
        tolerances = (
            f"path ends within {p.planner_tolerance:g} m, "
            f"arrival within {p.dist_tolerance:g} m and {p.angle_tolerance:g} rad"
        )
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"for {p.duration:g} s: {inflation}, {tolerances}")

    def _relax_layer(self, until: float) -> str | RecoveryResult:
        """Scale the radii of the layer until a time [s]; say to what, or why that fails."""
        p = self.parameters
        if p.layer not in self.mesh_map.layers:
            known = ", ".join(self.mesh_map.layers) or "none"
            return RecoveryResult(RecoveryOutcome.FAILURE, f"the map has no layer '{p.layer}'; its layers are: {known}")
        usual = self.mesh_map.usual_parameters(p.layer)
        if not isinstance(usual, InflationParameters):
            return RecoveryResult(RecoveryOutcome.FAILURE, f"the layer '{p.layer}' has no radius to relax")
        robot = self.mesh_map.inscribed_radius or usual.inscribed_radius
        inscribed = min(usual.inscribed_radius, max(p.inflation_factor * usual.inscribed_radius, robot))
        inflation = max(p.inflation_factor * usual.inflation_radius, inscribed)
        relaxed = {"inscribed_radius": inscribed, "inflation_radius": inflation}
        self.mesh_map.set_layer_parameters(p.layer, usual.model_copy(update=relaxed), until=until)
        return f"layer '{p.layer}' with " + ", ".join(f"{name} {value:g} m" for name, value in relaxed.items())
