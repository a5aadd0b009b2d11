"""Relax limits for a time: inflation, margins for errors of the map, tolerances of planner, arrival and controller.

When to use: NO_PATH_FOUND or NO_VALID_CMD in a passage that is wide enough for the robot (inflation), a built map on
which a place may be worse than it looks, and is closed for that (errors), a goal that is occupied (planner tolerance),
a controller that cannot reach its goal or its path exactly (arrival, controller factor).
Two instances with different parameters make the "relax planner" and "relax controller" of the Move Base Flex paper.
When not: obstacles that are no longer there; use ``clear``. The inflation never gets narrower than the robot's
inscribed circle, so nothing becomes passable that the robot would hit. With a smaller margin for errors the ground may
be steeper than the limits of the layers; ``max_tilt`` of the server still stops the robot.

The behaviour returns at once. Its changes end with the map's first update after ``duration`` (layers) or at that
time (tolerances), also if the goal was canceled or the plugin unloaded meanwhile. Running it again while relaxed only
prolongs it. Cost: the layers are computed twice.
"""

from __future__ import annotations

from typing import Any, ClassVar

from mbf_abstract.maps.layers.error_margin import ErrorMargin
from mbf_abstract.maps.layers.inflation import InflationRadii
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.recoveries.chosen_maps import ChosenMapsParameters, ChosenMapsRecovery, described
from mbf_abstract.maps.relaxation import Slack
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult


class RelaxParameters(ChosenMapsParameters):
    """Parameters of ``relax``."""

    layers: tuple[str, ...] = parameter(
        (), "Names of the layers to relax that have an inflation or a margin, on each map that has them; empty = all."
    )
    inflation_factor: float = parameter(
        0.5,
        "What is left of the inflation radius (at least the inscribed one), and what divides its decay; 1 = unchanged.",
        gt=0.0,
        le=1.0,
    )
    error_factor: float = parameter(
        1.0, "What is left of the margin of layers for errors of the map; 1 = unchanged.", ge=0.0, le=1.0
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


class RelaxRecovery(ChosenMapsRecovery):
    """Shrinks radii and margins of layers and grants slack to planning and driving for a time."""

    Parameters: ClassVar[type[PluginParameters]] = RelaxParameters
    parameters: RelaxParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Relax layers and tolerances, or hold them longer if they are relaxed; moves nothing."""
        p = self.parameters
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        if problem := self.unknown_layer(p.layers) or self._layer_without_either():
            return RecoveryResult(RecoveryOutcome.FAILURE, f"nothing to relax: {problem}")
        until = self.clock.now() + p.duration
        relaxed = {name: self._relax(one, until, request) for name, one in self.chosen_maps().items()}
        slack = Slack(p.planner_tolerance, p.dist_tolerance, p.angle_tolerance, p.controller_factor)
        self.relaxation.grant(self.name, slack, until)
        text = (
            f"for {p.duration:g} s: inflation and margins {described(relaxed, 'as usual')}, "
            f"path ends within {p.planner_tolerance:g} m, "
            f"arrival within {p.dist_tolerance:g} m and {p.angle_tolerance:g} rad, "
            f"controller limits x {p.controller_factor:g}"
        )
        return RecoveryResult(RecoveryOutcome.SUCCESS, text)

    def _usual(self, navigation_map: NavigationMap) -> dict[str, Any]:
        """Return the usual parameters of the chosen layers of a map, by name."""
        names = self.parameters.layers or tuple(navigation_map.layers)
        return {name: navigation_map.usual_parameters(name) for name in names if name in navigation_map.layers}

    def _layer_without_either(self) -> str:
        """Say which of the named layers has neither an inflation nor a margin; empty if all have."""
        for navigation_map in self.chosen_maps().values() if self.parameters.layers else ():
            for name, usual in self._usual(navigation_map).items():
                if not isinstance(usual, InflationRadii | ErrorMargin):
                    return f"the layer {name!r} has no inflation radius and no margin for errors"
        return ""

    def _relax(self, navigation_map: NavigationMap, until: float, request: RecoveryRequest) -> list[str]:
        """Relax the layers of a map until a time [s]; return what each of them is relaxed to."""
        p, relaxed = self.parameters, []
        for name, usual in self._usual(navigation_map).items():
            if p.inflation_factor < 1.0 and isinstance(usual, InflationRadii):
                parameters: Any = usual.relaxed(p.inflation_factor, navigation_map.inscribed_radius)
                relaxed.append(f"{name} at {parameters.inflation_radius:.3g} m")
            elif p.error_factor < 1.0 and isinstance(usual, ErrorMargin):
                parameters = usual.with_margin(p.error_factor)
                relaxed.append(f"{name} at {parameters.error_margin:.3g} errors")
            else:
                continue
            navigation_map.set_layer_parameters(name, parameters, until)
        if relaxed:
            self.update(navigation_map, request)
        return relaxed
