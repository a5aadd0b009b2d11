"""What a server asks of its map: hooks that the server of a map overrides, with answers for a server that has none.

A backend on layered maps derives ``server.map_server.MapServer``, which answers most of them once for every backend.
When to read this: writing a server for a map of another kind. When not: writing planners, controllers, layers; they
see the map that ``make_context`` hands them.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path as FilePath
from typing import ClassVar

from mbf_abstract.config.configuration import Config
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.survey import Survey
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import FieldView, FloorMap, FloorWindow, GridView, MapView, MeshView
from mbf_abstract.parameters import ParameterModel
from mbf_abstract.plugins import ControlResult, PluginKind
from mbf_abstract.server.plugin_host import PluginHost


class MapInterface(PluginHost):
    """The questions about the map, for a server to answer.

    Attributes
    ----------
    config : Config
        The validated configuration.
    """

    config: Config
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {}
    """Top-level blocks of a configuration that describe this server's map."""
    map_names: ClassVar[Sequence[str]] = ()
    """Names of the maps that a plugin can choose from, as in ``MapContext.maps``, of a server with several."""

    @abstractmethod
    def load_map(self, config: Config) -> None:
        """Make the map from the configuration's sections; raises where its files are bad."""

    @property
    @abstractmethod
    def queries(self) -> MapQueries:
        """The map-independent questions, answered by this server's map."""

    @abstractmethod
    def take_scan(self, scan: RangeScan) -> None:
        """Feed what a sensor saw into the map; in any known frame, raises TransformError where it is not known."""

    def listens_to(self, source: str) -> bool:
        """Whether scans of a source change the map; True of a server that does not know."""
        return True

    @property
    def map_topics(self) -> tuple[str, ...]:
        """Names of the topics on which maps of floors are expected, sorted; empty if all is in files."""
        return ()

    def take_floor(self, topic: str, floor: FloorMap | FloorWindow) -> None:
        """Feed the map of a floor that has come on a topic, or a change of its last one, into the map.

        Raises ValueError where the map has no use for it; it stays as it is.
        """
        raise ValueError(f"the {self.config.backend} server takes no floor from {topic}")

    def missing_floor(self) -> str:
        """Which floor has not come yet, or cannot be placed, so that nothing can be planned; empty if all are there."""
        return ""

    def floors_taken(self) -> int:
        """How many floors the map that plans are made on has taken up at run time."""
        return 0

    @classmethod
    def config_for_map(cls, file: FilePath, unknown_is_free: bool = True) -> str | None:
        """YAML text of a sane configuration for a bare map file; None if this server does not read such files.

        ``unknown_is_free``: whether plans may lead over cells that the map does not know, where it has such.
        """
        return None

    @classmethod
    def read_floor(cls, file: FilePath) -> FloorMap | None:
        """The floor that a map file describes; None if this server does not read such files, or maps have no cells.

        Raises
        ------
        ConfigError
            The file is damaged, or too large.
        """
        return None

    @property
    def survey(self) -> Survey | None:
        """Where the map lies in the coordinates of its survey; None if its file does not state it."""
        return None

    ground_is_level: ClassVar[bool] = False
    """Whether all ground is at height 0, so that a place needs no z."""

    @property
    def robot_radius(self) -> float:
        """Radius [m] of a circle around the base that holds all of the robot; 0 of a server that does not know."""
        return 0.0

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Heights [m] of the ground at a place of the global frame, the best to stand on first; () without any."""
        return (0.0,)

    def ground_pose(self, x: float, y: float, yaw: float = 0.0) -> Pose:
        """Pose in the global frame at (x, y) [m] and yaw [rad], on the lowest free storey; height 0 without ground."""
        heights = self.ground_heights(x, y)
        return Pose.planar(x, y, yaw, heights[0] if heights else 0.0, frame_id=self.config.parameters.global_frame)

    car_controllers: ClassVar[Sequence[str]] = ()
    """The controllers of this map that suit a car, each as a note on one that does not names it."""
    map_view_type: ClassVar[type[GridView] | type[MeshView] | None] = None
    """What all of ``map_views`` look like; None if this server has nothing to show."""

    @property
    def map_views(self) -> tuple[str, ...]:
        """Names of what ``map_view`` can show: maps or layers, the one planners see first."""
        return ()

    local_view: ClassVar[str] = ""
    """Which of ``map_views`` shows the map around the robot only, and lies over the others; empty = none does."""

    def layer_costs(self, view: str, x: float, y: float) -> Mapping[str, float]:
        """Costs at a place [m] of one of ``map_views`` after each of its layers, in their order; for viewers.

        0 free to 1 and above forbidden, nan unknown. Empty off the map, and where the layers are views themselves.
        """
        return {}

    def map_view(self, name: str = "") -> MapView | None:
        """What the map, or one of ``map_views``, looks like; None if this server has nothing to show."""
        return None

    def field_view(self, path: Path) -> FieldView | None:
        """Directions that a planner has found together with a path; None where it has only found the path."""
        return None

    def map_problem(self) -> str:
        """Why the map must not be driven on right now; empty = it is current."""
        return ""

    def awaits_scan(self) -> bool:
        """Whether a plan should wait for the next scan, as its map was cleared; scans that have come are taken in."""
        return False

    def path_problem(self, path: Path) -> str:
        """Why the path of a planner, in the global frame, leads off the map; empty if it does not, or nobody knows."""
        return ""

    def obstacle_along(self, path: Path) -> str:
        """Where the robot would touch something on a path in the global frame; empty if nowhere, or nobody knows."""
        return ""

    def avoid_contact(self, pose: Pose, velocity: Twist, answer: ControlResult) -> ControlResult:
        """The answer of a controller with a command by which the robot touches nothing that moves; as it is here."""
        return answer

    def within_speed_limit(self, pose: Pose, answer: ControlResult, full_speed: float) -> ControlResult:
        """The answer of a controller with a command within the speed limits of the map's layers; as it is here."""
        return answer

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """What the robot would touch, and where, if it kept ``command`` for ``duration`` [s]; empty = nothing."""
        return ""

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:
        """Close these places for plans and controllers, and open those that were closed before; nothing here."""

    def forget(self, places: Sequence[tuple[Pose, float]]) -> None:
        """Free squares around places, of a side [m] each, on the map of plans until sensors see anew; nothing here."""

    def using_map(self, kind: PluginKind) -> AbstractContextManager[None]:
        """Keep the map alive while a goal of this kind runs."""
        return nullcontext()

    def close_map(self) -> None:
        """Give back what the map holds; called once, after all goals were canceled."""
