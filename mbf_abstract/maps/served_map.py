"""A map as a server runs it: fed with scans, updated at its own rate, and changed at run time."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Generic, TypeVar

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.scan_intake import ScanTarget
from mbf_abstract.maps.sensing import TRANSFORM_TOLERANCE
from mbf_abstract.parameters import ParameterModel, with_changes
from mbf_abstract.time.ticker import Ticker

Map = TypeVar("Map", bound=NavigationMap)


class ServedMap(Generic[Map]):
    """Keeps one map up to date, and changes its parameters.

    Parameters
    ----------
    navigation_map : NavigationMap
    runtime : Runtime
        Of the server.
    name : str
        The map's section in the configuration.
    parameters : ParameterModel
        Those the map was built with.
    update_frequency : float
        How often the map is updated [Hz].
    transform_tolerance : float
        How much newer [s] than the newest transform a scan may be.

    Attributes
    ----------
    map : NavigationMap
        The map of the moment; a server may replace it.
    parameters : ParameterModel
        The present ones.
    """

    def __init__(
        self,
        navigation_map: Map,
        runtime: Runtime,
        name: str,
        parameters: ParameterModel,
        update_frequency: float,
        transform_tolerance: float = TRANSFORM_TOLERANCE,
    ) -> None:
        self.map = navigation_map
        self.name = name
        self.parameters = parameters
        self._runtime = runtime
        self._transform_tolerance = transform_tolerance
        self._ticker = Ticker(runtime.clock, runtime.events, self._tick, 1.0 / update_frequency, name)

    @property
    def scan_target(self) -> ScanTarget:
        """The map as something that takes scans."""
        return ScanTarget(
            self.map.frame_id,
            lambda: self.map.source_names,
            lambda source: self.map.listens_to(source),
            lambda scan: self.map.insert_scan(scan),
            self._transform_tolerance,
        )

    def in_use(self) -> AbstractContextManager[None]:
        """Keep the map updated for the time of a ``with`` block."""
        return nullcontext()

    def update(self) -> None:
        """Bring the map up to date now; a map that follows the robot keeps its place while the pose is unknown."""
        pose: Pose | None = None
        if self.map.follows_robot:
            try:
                pose = self._runtime.transforms.transform_pose(self._runtime.robot.pose(), self.map.frame_id)
            except (RobotStateError, TransformError):
                pose = None
        self.map.update(pose, self._runtime.clock.now())

    def _tick(self) -> None:
        self.update()

    def set_parameters(self, changes: Mapping[str, Any]) -> None:
        """Change parameters of the map, all or none; raises ValueError where a value is not legal or cannot change."""
        old, new = self.parameters, with_changes(self.parameters, changes)
        try:
            self.map.take_parameters(new)
        except BaseException:
            self.map.take_parameters(old)
            raise
        self.parameters = new
        self._report(self.name, changes)

    def set_layer_parameters(self, layer: str, changes: Mapping[str, Any]) -> None:
        """Change parameters of a layer, all or none.

        Raises
        ------
        KeyError
            The map has no such layer.
        ValueError
            A value is not legal or cannot change, or the layer does not take it.
        """
        self.map.set_layer_parameters(layer, with_changes(self.map.usual_parameters(layer), changes))
        self._report(f"{self.name}.{layer}", changes)

    def _report(self, what: str, changes: Mapping[str, Any]) -> None:
        self._runtime.events.emit(EventKind.PARAMETER_CHANGED, what, **changes)
        self.report_configuration_warnings()

    def report_configuration_warnings(self) -> None:
        """Report what is legal but hardly meant: in the event log, and to the user as a note of the server."""
        for warning in self.map.configuration_warnings():
            self._runtime.events.emit(EventKind.MAP, self.name, message=f"{self.name}: {warning}")

    def close(self) -> None:
        """End the updates."""
        self._ticker.stop()
