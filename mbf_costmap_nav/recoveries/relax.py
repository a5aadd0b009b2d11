"""Be less strict for a while: smaller inflation, wider tolerances of planner and arrival, wider controller limits.

When to use: NO_PATH_FOUND or NO_VALID_CMD in a passage that the robot really fits through (inflation), a goal that is
just occupied (planner tolerance), a controller that cannot reach its goal or its path exactly (arrival, controller
factor). Two instances with different parameters make the "relax planner" and "relax controller" of the Move Base Flex
paper. When not: the inscribed radius itself is too wide for the passage; the inflation never gets narrower than it, so
nothing becomes passable that the robot would hit.

The behaviour returns at once. What it changes ends by the clock, not by this plugin: the inflation with the map's first
update after ``duration``, the tolerances at that very time, also if the goal was canceled or the plugin unloaded
meanwhile. Running it again while relaxed only prolongs it.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.maps.relaxation import Slack
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.layers.inflation import InflationLayer
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapRecovery


class RelaxParameters(PluginParameters):
    """Parameters of ``costmap.relax``."""

    inflation_factor: float = parameter(
        0.5,
        "What is left of the inflation radius (at least the inscribed one), and what divides its decay; 1 = unchanged.",
        gt=0.0,
        le=1.0,
    )
    planner_tolerance: float = parameter(
        0.2, "Paths may end at least this far from the goal; 0 = unchanged.", unit="m", ge=0.0, le=100.0
    )
    dist_tolerance: float = parameter(
        0.2, "This near to the goal counts as arrived; 0 = unchanged.", unit="m", ge=0.0, le=100.0
    )
    angle_tolerance: float = parameter(0.35, "The same for the heading; 0 = unchanged.", unit="rad", ge=0.0, le=3.2)
    controller_factor: float = parameter(
        2.0,
        "Factor on the allowed distance from the path, divisor of the time ahead that must be free; 1 = unchanged.",
        ge=1.0,
        le=100.0,
    )
    duration: float = parameter(20.0, "How long.", unit="s", gt=0.0, le=3600.0)


class RelaxRecovery(CostmapRecovery):
    """Grants slack to planning and driving for a time."""

    Parameters: ClassVar[type[PluginParameters]] = RelaxParameters
    parameters: RelaxParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Relax the tolerances, then the inflation of both maps, and update these; moves nothing."""
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        p = self.parameters
        until = self.clock.now() + p.duration
        slack = Slack(p.planner_tolerance, p.dist_tolerance, p.angle_tolerance, p.controller_factor)
        self.relaxation.grant(self.name, slack, until)
        try:
            for costmap in {id(costmap): costmap for costmap in (self.local_costmap, self.global_costmap)}.values():
                self._relax_inflation(costmap, request, until)
        except (RobotStateError, TransformError) as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"for {p.duration:g} s: {self._says()}")

    def _relax_inflation(self, costmap: LayeredCostmap, request: RecoveryRequest, until: float) -> None:
        layers = [layer for layer in costmap.layers.values() if isinstance(layer, InflationLayer)]
        if not layers or self.parameters.inflation_factor == 1.0:
            return
        for layer in layers:
            layer.relax(self.parameters.inflation_factor, until)
        costmap.update(self.on_map(request.motion.pose(), costmap), self.clock.now())

    def _says(self) -> str:
        p = self.parameters
        return (
            f"inflation at {p.inflation_factor:g} of its radius, path ends within {p.planner_tolerance:g} m, "
            f"arrival within {p.dist_tolerance:g} m and {p.angle_tolerance:g} rad, "
            f"controller limits x {p.controller_factor:g}"
        )
