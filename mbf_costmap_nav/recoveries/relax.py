"""Shrink the inflation for a while, so that planners and controllers dare to pass a narrow place.

When to use: NO_PATH_FOUND or NO_VALID_CMD in a passage that the robot really fits through. When not: the inscribed
radius itself is too wide for the passage; it is never touched, so nothing becomes passable that the robot would hit.

The behaviour returns at once, and the old inflation comes back by itself: each costmap gets a small layer of its own
that puts the parameters back in the first update after ``duration``. Running it again while relaxed only prolongs it.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.robot import RobotStateError
from mbf_costmap_nav.costmap import CellArray, CellBox
from mbf_costmap_nav.layer import CostmapLayer, LayerContext, LayerParameters
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.layers.inflation import InflationLayer, InflationLayerParameters
from mbf_costmap_nav.plugins import CostmapContext, CostmapRecovery


class RelaxParameters(PluginParameters):
    """Parameters of ``costmap.relax``."""

    factor: float = parameter(
        0.5, "What is left of the inflation radius, and what its decay is divided by.", gt=0.0, le=1.0
    )
    duration: float = parameter(20.0, "How long.", unit="s", gt=0.0, le=3600.0)


class RelaxRecovery(CostmapRecovery):
    """Shrinks the inflation of both costmaps for a time."""

    Parameters: ClassVar[type[PluginParameters]] = RelaxParameters
    parameters: RelaxParameters

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        maps = {
            id(costmap): costmap for costmap in (self.local_costmap, self.global_costmap)
        }  # may be one and the same
        self._keepers = [_RelaxedInflation(self.name, costmap) for costmap in maps.values()]

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Relax both maps and update them; moves nothing."""
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        relaxed = [keeper.relax(self.parameters.factor) for keeper in self._keepers]
        if not any(relaxed):
            return RecoveryResult(RecoveryOutcome.FAILURE, "no costmap has an inflation layer")
        try:
            for keeper in self._keepers:
                keeper.until = self.clock.now() + self.parameters.duration
                keeper.costmap.update(request.motion.pose(), self.clock.now())
        except RobotStateError as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        text = f"inflation at {self.parameters.factor:g} of its radius for {self.parameters.duration:g} s"
        return RecoveryResult(RecoveryOutcome.SUCCESS, text)


class _RelaxedInflation(CostmapLayer):
    """Remembers the inflation parameters of one costmap and puts them back when their time has come."""

    def __init__(self, owner: str, costmap: LayeredCostmap) -> None:
        super().__init__(LayerContext(f"{owner}.restore", LayerParameters(), costmap.frame_id, costmap.rolling_window))
        self.costmap = costmap
        self.until = 0.0
        self._saved: dict[str, InflationLayerParameters] = {}
        self.match_geometry(costmap.geometry)
        costmap.layers.setdefault(self.name, self)

    def relax(self, factor: float) -> bool:
        """Shrink every inflation layer that is not shrunk yet; return whether there is one."""
        inflation = self._inflation_layers()
        for layer in inflation:
            if layer.name not in self._saved:
                old = self._saved[layer.name] = layer.parameters
                shrunk = {"inflation_radius": old.inflation_radius * factor}
                shrunk["cost_scaling_factor"] = old.cost_scaling_factor / factor
                layer.parameters = old.model_copy(update=shrunk)
        self.costmap.set_footprint(self.costmap.unpadded_footprint)  # makes all layers and cells new
        return bool(inflation)

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Restore after the time; then every cell changes."""
        if not self._saved or now < self.until:
            return box
        for layer in self._inflation_layers():
            layer.parameters = self._saved.pop(layer.name)
            layer.set_footprint(self.costmap.footprint)
        return self.geometry.box

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Write nothing."""

    def _inflation_layers(self) -> list[InflationLayer]:
        return [layer for layer in self.costmap.layers.values() if isinstance(layer, InflationLayer)]
