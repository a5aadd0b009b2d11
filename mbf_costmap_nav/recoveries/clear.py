"""Forget what the sensors have marked: all of it, or around the robot, on one costmap or both.

When to use: ghosts of moved obstacles block the way. When not: real obstacles; they come back with the next scan, but
until then a planner may plan through them, so clear small areas first (a list with two instances does that).
"""

from __future__ import annotations

from typing import ClassVar, Literal

from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.robot import RobotStateError
from mbf_abstract.transforms import TransformError
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapRecovery


class ClearParameters(PluginParameters):
    """Parameters of ``costmap.clear``."""

    costmaps: Literal["local", "global", "both"] = parameter("both", "Which maps to clear.")
    layers: tuple[str, ...] = parameter((), "Names of the layers to clear; empty = all.")
    radius: float = parameter(0.0, "Half the side of the square to clear; 0 = all.", unit="m", ge=0.0)
    keep_inside: bool = parameter(False, "Clear all but the square, as move_base's clear_costmap_recovery.")


class ClearRecovery(CostmapRecovery):
    """Clears costmap layers and updates the maps, so that the next plan sees the result."""

    Parameters: ClassVar[type[PluginParameters]] = ClearParameters
    parameters: ClearParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Clear; moves nothing."""
        p = self.parameters
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        chosen = {"local": [self.local_costmap], "global": [self.global_costmap]}.get(
            p.costmaps, [self.local_costmap, self.global_costmap]
        )
        cleared: list[str] = []
        try:
            for costmap in chosen:
                cleared += self._clear(costmap, request)
        except (RobotStateError, TransformError) as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        except KeyError as error:
            return RecoveryResult(RecoveryOutcome.FAILURE, f"nothing to clear: {error}")
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"cleared {', '.join(cleared)} ({p.costmaps})")

    def _clear(self, costmap: LayeredCostmap, request: RecoveryRequest) -> list[str]:
        p, pose = self.parameters, self.on_map(request.motion.pose(), costmap)
        names = p.layers or None
        if p.radius > 0.0:
            cleared = costmap.clear_area(pose.x, pose.y, 2.0 * p.radius, layer_names=names, inside=not p.keep_inside)
        else:
            cleared = costmap.clear(names)
        costmap.update(pose, self.clock.now())
        return cleared
