"""Forget what the sensors have marked: all of it, or around the robot, on one costmap or both.

When to use: ghosts of moved obstacles block the way. When not: real obstacles; they come back with the next scan, but
until then a planner may plan through them, so clear small areas first (a list with two instances does that).

With a radius, what no sensor would bring back stays: floor plan, keep-out areas. A static layer loses the area only if
``layers`` names it. Without a radius it returns to its map.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapRecovery


class ClearParameters(PluginParameters):
    """Parameters of ``costmap.clear``."""

    costmaps: Literal["local", "global", "both"] = parameter("both", "Which maps to clear.")
    layers: tuple[str, ...] = parameter((), "Names of the layers to clear, on each map that has them; empty = all.")
    radius: float = parameter(0.0, "Half the side of the square to clear; 0 = all.", unit="m", ge=0.0)
    keep_inside: bool = parameter(False, "Clear all but the square, as move_base's clear_costmap_recovery.")


class ClearRecovery(CostmapRecovery):
    """Clears costmap layers and updates the maps, so that the next plan sees the result."""

    Parameters: ClassVar[type[PluginParameters]] = ClearParameters
    parameters: ClearParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Clear; moves nothing."""
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        maps = self._chosen_maps()
        if missing := [name for name in self.parameters.layers if all(name not in one.layers for one in maps.values())]:
            known = {name: list(costmap.layers) for name, costmap in maps.items()}
            return RecoveryResult(
                RecoveryOutcome.FAILURE, f"nothing to clear: there is no layer {missing[0]!r}, only {known}"
            )
        try:
            poses = {name: self.on_map(request.motion.pose(), costmap) for name, costmap in maps.items()}
        except (RobotStateError, TransformError) as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        cleared = {name: self._clear(costmap, poses[name]) for name, costmap in maps.items()}
        told = "; ".join(f"{name}: {', '.join(layers)}" for name, layers in cleared.items() if layers)
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"cleared {told or 'nothing, as no layer holds what is sensed'}")

    def _chosen_maps(self) -> dict[str, LayeredCostmap]:
        both = {"local": self.local_costmap, "global": self.global_costmap}
        return {name: costmap for name, costmap in both.items() if self.parameters.costmaps in (name, "both")}

    def _clear(self, costmap: LayeredCostmap, pose: Pose) -> list[str]:
        """Clear what there is of the chosen layers, and return their names."""
        p = self.parameters
        names = [name for name in p.layers if name in costmap.layers] if p.layers else None
        if p.radius > 0.0:
            cleared = costmap.clear_area(pose.x, pose.y, 2.0 * p.radius, layer_names=names, inside=not p.keep_inside)
        else:
            cleared = costmap.clear(names)
        costmap.update(pose, self.clock.now())
        return cleared
