"""A costmap as the server runs it: updated at its own rate, but only while somebody needs it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.maps.scan_intake import ScanTarget
from mbf_abstract.parameters import with_changes
from mbf_abstract.time.ticker import Ticker
from mbf_costmap_nav.map.costmap_config import CostmapParameters
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.map_lifecycle import MapLifecycle, MapLifecycleParameters


def _nothing() -> None:
    """Stopping needs no more than the flag the tick looks at."""


class ServedCostmap:
    """Keeps one costmap up to date, and changes its parameters.

    Parameters
    ----------
    parameters : CostmapParameters
        Those the costmap was built with.
    name : str
        Its section in the configuration.

    Attributes
    ----------
    parameters : CostmapParameters
        The present ones.
    """

    def __init__(self, costmap: LayeredCostmap, runtime: Runtime, parameters: CostmapParameters, name: str) -> None:
        self.costmap = costmap
        self.parameters = parameters
        self.name = name
        self._runtime = runtime
        self._lifecycle_limits = self._lifecycle_parameters()
        self._lifecycle = MapLifecycle(runtime.clock, self._lifecycle_limits, self._update, _nothing, self._clear)
        self._ticker = Ticker(runtime.clock, runtime.events, self._tick, 1.0 / parameters.update_frequency, name)

    @property
    def scan_target(self) -> ScanTarget:
        """The costmap as something that takes scans."""
        costmap = self.costmap
        return ScanTarget(
            costmap.frame_id,
            lambda: costmap.layers.source_names,
            costmap.layers.listens_to,
            costmap.insert_scan,
            self.parameters.transform_tolerance,
        )

    def in_use(self) -> AbstractContextManager[None]:
        """Keep the map updated for the time of a ``with`` block."""
        return self._lifecycle.in_use()

    def set_parameters(self, changes: Mapping[str, Any]) -> None:
        """Change parameters of the map, all or none; raises ValueError where a value is not legal or cannot change."""
        old, new = self.parameters, with_changes(self.parameters, changes)
        try:
            self._apply(new)
        except BaseException:
            self._apply(old)
            raise
        self._tell(self.name, changes)

    def _apply(self, parameters: CostmapParameters) -> None:
        self.costmap.set_footprint(parameters.robot_footprint(), parameters.footprint_padding)
        self.costmap.max_age = parameters.max_age
        self.parameters = parameters

    def set_layer_parameters(self, layer: str, changes: Mapping[str, Any]) -> None:
        """Change parameters of a layer, all or none.

        Raises
        ------
        KeyError
            The map has no such layer.
        ValueError
            A value is not legal or cannot change, or the layer does not take it.
        """
        new = with_changes(self.costmap.usual_parameters(layer), changes)
        self.costmap.set_layer_parameters(layer, new)
        self._tell(f"{self.name}.{layer}", changes)

    def _tell(self, what: str, changes: Mapping[str, Any]) -> None:
        self._runtime.events.emit(EventKind.PARAMETER_CHANGED, what, **changes)
        self.report_configuration_warnings()

    def report_configuration_warnings(self) -> None:
        """Tell what is legal but hardly meant: in the event log, and to the user as a note of the server."""
        for warning in self.costmap.configuration_warnings():
            self._runtime.events.emit(EventKind.MAP, self.name, message=f"{self.name}: {warning}")

    def close(self) -> None:
        """End the updates."""
        self._ticker.stop()

    def _tick(self) -> None:
        wanted = self._lifecycle_parameters()
        if wanted != self._lifecycle_limits:
            self._lifecycle_limits = wanted
            self._lifecycle.configure(wanted)
        self._lifecycle.poll()
        if self._lifecycle.running:
            self._update()

    def _update(self) -> None:
        """One update, also at every start, as nobody may see the map of the last stop.

        A rolling map keeps its place while the robot's pose is unknown.
        """
        try:
            pose: Pose | None = self._in_map_frame(self._runtime.robot.pose())
        except (RobotStateError, TransformError):
            pose = None
        self.costmap.update(pose, self._runtime.clock.now())

    def _in_map_frame(self, pose: Pose) -> Pose:
        if pose.frame_id == self.costmap.frame_id:
            return pose
        return self._runtime.transforms.transform_pose(pose, self.costmap.frame_id)

    def _clear(self) -> None:
        self.costmap.clear()

    def _lifecycle_parameters(self) -> MapLifecycleParameters:
        parameters = self._runtime.parameters
        return MapLifecycleParameters(
            shutdown_costmaps=parameters.shutdown_costmaps,
            shutdown_costmaps_delay=parameters.shutdown_costmaps_delay,
            clear_on_shutdown=parameters.clear_on_shutdown,
        )
