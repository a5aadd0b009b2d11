"""A map as a server runs it: fed with scans, updated at its own rate, stopped while idle, and changed at run time.

Like MBF's costmap wrapper it counts its users. With ``shutdown_costmaps`` it is updated no more once it has had none
for ``shutdown_costmaps_delay``, so that a get_path followed by an exe_path does not restart it. Every start brings an
update: no user sees the map of the last stop.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Generic, TypeVar

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.sensing import TRANSFORM_TOLERANCE
from mbf_abstract.maps.tracking.objects import MotionChanges, TrackedObject
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_abstract.parameters import ParameterModel, with_changes
from mbf_abstract.time.ticker import Ticker

Map = TypeVar("Map", bound=NavigationMap)


class ServedMap(Generic[Map]):
    """Keeps one map up to date while it is in use, and changes its parameters.

    Parameters
    ----------
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
        self.transform_tolerance = transform_tolerance
        self._motions = MotionChanges()
        self._warnings: list[str] = []  # those that have been reported and still hold
        self._floors = navigation_map.floors_taken  # that have been reported
        self._lock = threading.Lock()
        self._users, self._running, self._idle_since = 0, False, runtime.clock.now()
        if not runtime.parameters.shutdown_costmaps:
            self._start_first()
        self._ticker = Ticker(runtime.clock, runtime.events, self._tick, 1.0 / update_frequency, name)

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Keep the map updated for the time of a ``with`` block; raises what its first update raises."""
        with self._lock:
            self._start()
            self._users += 1
        try:
            yield
        finally:
            with self._lock:
                self._users -= 1
                self._idle_since = self._runtime.clock.now()

    def update(self) -> None:
        """Bring the map up to date now; a map that follows the robot keeps its place while the pose is unknown."""
        pose: Pose | None = None
        if self.map.follows_robot:
            try:
                pose = self._runtime.transforms.transform_pose(self._runtime.robot.pose(), self.map.frame_id)
            except (RobotStateError, TransformError):
                pose = None
        self.map.update(pose, self._runtime.clock.now())
        if (taken := self.map.floors_taken) != self._floors:  # once, of several updates that have waited for each other
            self._floors = taken
            self._report_floor()
        for event in self._motions.changes(self.tracked_objects()):
            self._runtime.events.emit(EventKind.OBJECT, self.name, **event)

    def forget(self, places: Sequence[tuple[Pose, float]]) -> None:
        """Free squares around places, of a side [m] each, of what sensors have seen there, until they see it again."""
        for place, size in places:
            with suppress(TransformError):
                self.map.clear_area(self._runtime.transforms.transform_pose(place, self.map.frame_id), size)
        with suppress(Exception):  # a layer that raises makes the map stale, which it says itself
            self.update()

    def awaits_scan(self) -> bool:
        """Whether the map waits for what its sensors see since it was cleared; scans that have come are taken in."""
        if self.map.awaits_scan(self._runtime.clock.now()):
            with suppress(Exception):  # a layer that raises makes the map stale, which it says itself
                self.update()
        return self.map.awaits_scan(self._runtime.clock.now())

    def _report_floor(self) -> None:
        """Note a new floor, and what is suspicious on it."""
        self._runtime.events.emit(EventKind.MAP, self.name, message=f"{self.name}: a new floor has come")
        self.report_configuration_warnings()

    def tracked_objects(self) -> tuple[TrackedObject, ...]:
        """What the map tracks, now."""
        objects: tuple[TrackedObject, ...] = self.map.tracked_objects(self._runtime.clock.now())
        return objects

    def _start(self) -> None:
        if not self._running:
            self.update()
            self._running = True

    def _start_first(self) -> None:
        """Start, and name the layer that raises, also a ``sys.exit()``; there is no goal yet that could say so."""
        try:
            self._start()
        except (Exception, SystemExit) as error:
            if not (problem := getattr(self.map.layers, "problem", "")):
                raise
            raise LayerListError(f"{self.name}: {problem}") from error

    def _tick(self) -> None:
        parameters, now = self._runtime.parameters, self._runtime.clock.now()
        with self._lock:
            if self._users or not parameters.shutdown_costmaps:
                self._idle_since, self._running = now, True
            elif self._running and now - self._idle_since >= parameters.shutdown_costmaps_delay:
                if parameters.clear_on_shutdown:
                    self.map.clear()
                self._running = False
        if self._running:
            self.update()

    def set_parameters(self, changes: Mapping[str, Any]) -> None:
        """Change parameters of the map, all or none; raises ValueError where a value is not legal or cannot change."""
        old, new = self.parameters, with_changes(self.parameters, changes, where=(self.name,))
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
        new = with_changes(self.map.usual_parameters(layer), changes, where=(self.name, layer))
        self.map.set_layer_parameters(layer, new)
        self._report(f"{self.name}.{layer}", changes)

    def _report(self, what: str, changes: Mapping[str, Any]) -> None:
        self._runtime.events.emit(EventKind.PARAMETER_CHANGED, what, **changes)
        self.report_configuration_warnings()

    def refusal(self, topic: str, floor: FloorMap | FloorWindow) -> str:
        """Hand a floor to the map; why it refuses it, empty if it has taken it."""
        try:
            self.map.take_floor(topic, floor)
        except ValueError as error:
            return f"{self.name}: {error}"
        return ""

    def report_configuration_warnings(self, *, anew: bool = False) -> None:
        """Report legal but suspicious parameters in the event log and as notes of the server, each once.

        What was reported before and holds no longer is withdrawn; with ``anew`` nothing was reported of this map.
        """
        before = [] if anew else self._warnings
        self._warnings = [f"{self.name}: {warning}" for warning in self.map.configuration_warnings()]
        for text in (text for text in before if text not in self._warnings):
            self._runtime.events.emit(EventKind.MAP, self.name, message=f"no longer: {text}", withdrawn=text)
        for text in (text for text in self._warnings if text not in before):
            self._runtime.events.emit(EventKind.MAP, self.name, message=text)

    def close(self) -> None:
        """End the updates."""
        self._ticker.stop()
