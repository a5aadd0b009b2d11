"""A server on maps: scans, questions, freshness, changes at run time, written once for every backend.

A backend's server derives ``MapServer``, builds its maps in ``serve_maps``, hands them to plugins in ``make_context``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from mbf_abstract.config.configuration import Config
from mbf_abstract.config.named_files import refuse_missing_files
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.maps.layers.obeyed_limits import within_speed_limit
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.scan_intake import ScanIntake
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.maps.tracking.contact_guard import ContactGuard
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.server.path_on_map import obstacle_along, path_problem
from mbf_abstract.server.plugin_host import ServerError


class MapServer(AbstractNavigationServer):
    """Navigation on maps."""

    served: dict[str, ServedMap[Any]]
    """The maps by the names of their sections."""

    @abstractmethod
    def serve_maps(self, config: Config) -> Iterator[ServedMap[Any]]:
        """Build the maps one after the other; raises where their files are bad."""

    @abstractmethod
    def footprint_changes(self, footprint: str | Sequence[Sequence[float]] | float) -> Mapping[str, Any]:
        """Parameters of a map that stand for an outline of the robot, see ``set_footprint``; raises ValueError."""

    def load_map(self, config: Config) -> None:
        """Build the maps and begin to update them; ConfigError names all files that are missing."""
        self.served, self._contact_guard = {}, ContactGuard()
        refuse_missing_files(config)
        for served in self.serve_maps(config):
            self.served[served.name] = served  # at once: what is there is closed if the next one fails
        self._scans = ScanIntake(self.runtime, self.served)
        for served in self.served.values():
            served.report_configuration_warnings()

    @property
    def global_map(self) -> ServedMap[Any]:
        """The map that plans are made on: the first one."""
        return next(iter(self.served.values()))

    @property
    def local_map(self) -> ServedMap[Any]:
        """The map that the robot drives on: the last one, which may be the only one."""
        return next(reversed(self.served.values()))

    @property
    def queries(self) -> MapQueries:
        """The map-independent questions."""
        return MapQueries(self.global_map, self.local_map, self.runtime.robot, self.runtime.transforms)

    @property
    def scans(self) -> Mapping[str, RangeScan]:
        """The newest scan of each sensor, see ``ScanIntake.newest``."""
        return MappingProxyType(self._scans.newest)

    def take_scan(self, scan: RangeScan) -> None:
        """Hand a scan to every map with a layer that listens to its source, as ``ScanIntake.take``."""
        for listener in self.scan_listeners:
            listener(scan)
        self._scans.take(scan)

    def listens_to(self, source: str) -> bool:
        """Whether a layer of any map takes the scans of a source."""
        return any(served.map.listens_to(source) for served in self.served.values())

    @property
    def map_topics(self) -> tuple[str, ...]:
        """Those of all maps."""
        return tuple(sorted({topic for served in self.served.values() for topic in served.map.map_topics}))

    def take_floor(self, topic: str, floor: FloorMap | FloorWindow) -> None:
        """Hand a floor to every map that expects it; each shows it from its next update on.

        Raises ValueError where no map expects it, or one refuses it, which does not keep it from the others.
        """
        if not isinstance(floor, FloorMap | FloorWindow):
            raise TypeError(f"take_floor: expected a FloorMap or a FloorWindow, got {type(floor).__name__}")
        expecting = [served for served in self.served.values() if topic in served.map.map_topics]
        if not expecting:
            super().take_floor(topic, floor)
        if refusals := [refusal for served in expecting if (refusal := served.refusal(topic, floor))]:
            raise ValueError("; ".join(refusals))

    def missing_floor(self) -> str:
        """That of the map that plans are made on; one that has come is taken up at once."""
        if self.global_map.map.missing_floor():
            self.global_map.update()
        return str(self.global_map.map.missing_floor())

    def floors_taken(self) -> int:
        """Those of the map that plans are made on."""
        return int(self.global_map.map.floors_taken)

    def map_problem(self, name: str = "") -> str:
        """Why a map, by default the one driven on, is stale; plans are made on it, too. ServerError: no such map."""
        served = self._served(name) if name else self.local_map
        return str(served.map.stale_reason(self.runtime.clock.now()))

    def awaits_scan(self) -> bool:
        """Whether the map that plans are made on does, see ``ServedMap.awaits_scan``."""
        return self.global_map.awaits_scan()

    def path_problem(self, path: Path) -> str:
        """Where a path leaves the map that plans are made on; empty if it does not, or that is not known."""
        navigation_map = self.global_map.map  # once, as a server may replace it
        with suppress(TransformError):
            there = self.runtime.transforms.transform_path(path, navigation_map.frame_id)
            return path_problem(navigation_map, path, there.positions)
        return ""

    def obstacle_along(self, path: Path) -> str:
        """Where the robot would touch something on a path, on any map; empty if nowhere."""
        return obstacle_along([served.map for served in self.served.values()], self.runtime.transforms, path)

    @property
    def robot_radius(self) -> float:
        """That of the outline on the map that the robot drives on."""
        return float(norm(self.local_map.map.robot_outline).max())

    def avoid_contact(self, pose: Pose, velocity: Twist, answer: ControlResult) -> ControlResult:
        """Slow down, or stop, in time before what moves on the map that the robot drives on."""
        navigation_map = self.local_map.map
        try:
            there = self.runtime.transforms.transform_pose(pose, navigation_map.frame_id)
        except TransformError as error:
            return ControlResult(ExePathOutcome.TF_ERROR, str(error))
        return self._contact_guard.judge(navigation_map, there, velocity, answer, self.runtime.clock.now())

    def within_speed_limit(self, pose: Pose, answer: ControlResult, full_speed: float) -> ControlResult:
        """Slow down to the lowest limit that layers of any map state for the place."""
        maps = [served.map for served in self.served.values()]
        return within_speed_limit(maps, self.runtime.transforms, pose, answer, full_speed)

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """What the robot would touch on the map that it drives on; TransformError where the pose is not known on it."""
        navigation_map = self.local_map.map
        there = self.runtime.transforms.transform_pose(pose, navigation_map.frame_id)
        return str(navigation_map.obstacle_ahead(there, command, duration))

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:
        """Close these places on all maps, and no others; a map whose frame is not known to them stays as it is."""
        transform = self.runtime.transforms.transform_pose
        for served in self.served.values():
            with suppress(TransformError):
                there = [replace(one, centre=transform(one.centre, served.map.frame_id)) for one in places]
                served.map.avoid(there)
                with suppress(Exception):  # a layer that raises makes the map stale, which it says itself
                    served.update()

    def forget(self, places: Sequence[tuple[Pose, float]]) -> None:
        """Free squares around places, of a side [m] each, on the map that plans are made on, until sensors see anew."""
        self.global_map.forget(places)

    @contextmanager
    def using_map(self, kind: PluginKind) -> Iterator[None]:
        """Keep all maps updated: a plugin of any kind may be bound to any of them."""
        with ExitStack() as stack:
            for served in self.served.values():
                stack.enter_context(served.in_use())
            yield

    def close_map(self) -> None:
        """End the updates."""
        for served in getattr(self, "served", {}).values():
            served.close()

    # --------------------------------------------------------------------------------------- changes at run time
    def set_layer_parameters(self, layer: str, /, **changes: Any) -> None:
        """Change parameters of a layer, all or none; the next update of the map shows it.

        Parameters
        ----------
        layer : str
            ``map.layer``, e.g. ``"global_costmap.inflation"``; the layer's name alone where one map only has it.

        Raises
        ------
        ServerError
            There is no such layer, or several maps have it.
        ValueError
            A value is not legal, the parameter is read once only (a ParameterError), or the layer does not take it.
        """
        served, name = self._layer(layer)
        served.set_layer_parameters(name, changes)

    def set_map_parameters(self, name: str, /, **changes: Any) -> None:
        """Change parameters of one map itself, by the name of its section; raises as for a layer."""
        self._served(name).set_parameters(changes)

    def set_footprint(self, footprint: str | Sequence[Sequence[float]] | float) -> None:
        """Replace the robot's outline on all maps, e.g. when it lifts a load.

        Parameters
        ----------
        footprint : text, list of (x, y) or number
            Corners [m] without padding, as in the configuration, or the radius [m] of a round robot.

        Raises
        ------
        ValueError
            It is no polygon, no radius, or the backend takes round robots only; nothing is changed.
        """
        changes = self.footprint_changes(footprint)
        old = [{name: getattr(one.parameters, name) for name in changes} for one in self.served.values()]
        changed: list[ServedMap[Any]] = []
        try:
            for served in self.served.values():
                served.set_parameters(changes)
                changed.append(served)
        except BaseException:
            for served, before in zip(changed, old, strict=False):
                served.set_parameters(before)
            raise

    def _served(self, name: str) -> ServedMap[Any]:
        if name not in self.served:
            raise ServerError(f"there is no map {name!r}, only {', '.join(self.served)}")
        return self.served[name]

    def _layer(self, layer: str) -> tuple[ServedMap[Any], str]:
        places = {f"{name}.{one}": (served, one) for name, served in self.served.items() for one in served.map.layers}
        found = [place for place in places if layer in (place, places[place][1])]
        if len(found) != 1:
            problem = f"there is no layer {layer!r}" if not found else f"several maps have a layer {layer!r}"
            raise ServerError(f"{problem}; known: {', '.join(places) or 'none'}")
        return places[found[0]]
