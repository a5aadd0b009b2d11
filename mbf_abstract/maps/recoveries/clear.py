"""Remove what the sensors have marked: everything, or around the robot, on one map or on all maps of a server.

When to use: obstacles that have moved on are still in the map. When not: real obstacles; those in view come back with
the next scan, those out of view do not, so clear small areas first (list two instances).

With a radius, what no sensor would bring back stays: floor plan, keep-out areas. A static layer loses the area only if
``layers`` names it; without a radius it is reset to its file. No plan is made and no controller drives until each
sensor with an expected rate has sent a scan, as the obstacles may still be there. A plan waits no longer than a sensor
may be silent; a controller does not drive before.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.recoveries.chosen_maps import ChosenMapsParameters, ChosenMapsRecovery, described
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult


class ClearParameters(ChosenMapsParameters):
    """Parameters of ``clear``."""

    layers: tuple[str, ...] = parameter((), "Names of the layers to clear, on each map that has them; empty = all.")
    radius: float = parameter(0.0, "Half the side of the square to clear; 0 = all.", unit="m", ge=0.0)
    keep_inside: bool = parameter(False, "Clear all but the square, as move_base's clear_costmap_recovery.")


class ClearRecovery(ChosenMapsRecovery):
    """Clears layers and updates the maps; the next plan sees the result, and what the sensors see since."""

    Parameters: ClassVar[type[PluginParameters]] = ClearParameters
    parameters: ClearParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Clear; moves nothing."""
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        if unknown := self.unknown_layer(self.parameters.layers):
            return RecoveryResult(RecoveryOutcome.FAILURE, f"nothing to clear: {unknown}")
        try:
            cleared = {name: self._clear(one, request) for name, one in self.chosen_maps().items()}
        except (RobotStateError, TransformError) as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        for one in self.chosen_maps().values():
            self.update(one, request)
        text = described(cleared, "nothing, as no layer holds what is sensed")
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"cleared {text}")

    def _clear(self, navigation_map: NavigationMap, request: RecoveryRequest) -> list[str]:
        """Clear the chosen layers that the map has, and return their names."""
        p = self.parameters
        names = [name for name in p.layers if name in navigation_map.layers] if p.layers else None
        if p.radius == 0.0:
            return navigation_map.clear(names)
        center = self.on_map(request.motion.pose(), navigation_map)
        return navigation_map.clear_area(center, 2.0 * p.radius, names, inside=not p.keep_inside)
