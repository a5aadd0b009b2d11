"""The contract of a navigation map with the core, so that behaviours are written once for all maps.

``rotate``, ``back_up``, ``drive_on_heading``, ``move_away``, ``clear`` and ``relax`` know their map by this contract
only. A map of a backend derives ``NavigationMap``; a server hands it to its plugins, see ``map_plugin``. A map without
sensors or layers answers for motions and places and inherits the rest.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.maps.queries import CellState, PlaceCheck, PlaceQuery, PlaneCheck, PoseAnswer, each_pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.contact import SAME_STOREY
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_abstract.maps.view import FloorMap, FloorWindow


class NavigationMap(ABC):
    """A map. All poses are in its frame; its methods may be called from any thread; layers have ``parameters``."""

    frame_id: str
    layers: Mapping[str, Any] = MappingProxyType({})
    follows_robot: bool = False
    """Whether an update needs the robot's pose."""
    knows_outline: bool = False
    """Whether the robot's outline is checked in its heading, instead of its inscribed circle."""
    same_storey: float = SAME_STOREY
    """Moving objects farther above or below the robot [m] are on another storey; infinite where heights are unknown."""
    floors_taken: int = 0
    """How often an update has taken up a floor that came at run time, see ``take_floor``."""

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the largest disc inside the robot's outline; 0 = unknown."""
        return 0.0

    # ----------------------------------------------------------------------------------------------- freshness
    def stale_reason(self, now: float) -> str:
        """Why no command may be computed on the map at ``now`` [s]; empty if it is fresh."""
        return ""

    def awaits_scan(self, now: float) -> bool:
        """Whether a plan should wait, as a sensor has sent nothing since a clearing and may still do so in time."""
        return False

    def update(self, robot_pose: Pose | None, now: float) -> object:
        """Bring the map up to ``now`` [s], end overrides that are over; ``robot_pose`` is None while it is unknown."""
        return None

    # ------------------------------------------------------------------------------------------------- sensors
    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of all observation sources that it asks for, sorted."""
        return ()

    def listens_to(self, source: str) -> bool:
        """Whether it takes scans of a source."""
        return source in self.source_names

    def insert_scan(self, scan: RangeScan) -> None:
        """Keep a scan in the frame of the map for the next update; never waits for an update."""
        raise ValueError(f"the map listens to no source, got a scan of {scan.source!r}")

    def tracked_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """What moves, or has stopped, among what its sensors see, at ``now`` [s]; empty if no layer tracks objects."""
        return ()

    # -------------------------------------------------------------------------------------------------- floors
    @property
    def map_topics(self) -> tuple[str, ...]:
        """Names of the topics on which layers expect the map of the floor, sorted; empty if it is all in files."""
        return ()

    def take_floor(self, topic: str, floor: FloorMap | FloorWindow) -> None:
        """Keep the map of a floor, or a change of its last one, for the next update; never waits for an update.

        Raises
        ------
        ValueError
            The map has no use for it: no layer expects it, it is too large, or a change of a map that is not there.
        """
        raise ValueError(f"no layer of the map takes a floor from {topic}")

    def missing_floor(self) -> str:
        """Which floor has not come yet, or cannot be placed, so that nothing can be planned; empty if all are there."""
        return ""

    # -------------------------------------------------------------------------------------------------- places
    @abstractmethod
    def point_check(self) -> PlaceCheck:
        """A function: state and cost of points, on the present map."""

    def first_outside(self, positions: FloatArray) -> int:
        """Index of the first of the positions (n, 3) [m] of a path that is not on the map; -1 if all are, or may be.

        How far the two ends are above or below the ground does not matter: they are what the path was asked for.
        """
        check, there = self.point_check(), (Pose(tuple(xyz), frame_id=self.frame_id) for xyz in positions.tolist())
        return next((index for index, pose in enumerate(there) if check(pose).state is CellState.OUTSIDE), -1)

    def first_line_outside(self, positions: FloatArray) -> int:
        """Index of the first of positions (n, 3) [m] whose line to the next leads off the map; -1 on a rectangle."""
        return -1

    @abstractmethod
    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """A function: state and summed cost of the robot's outline, or of its centre alone, on the present map."""

    def path_check(self, query: PlaceQuery) -> PlaceCheck:
        """As ``pose_check``, of a robot on its path: LETHAL where ``obstacle_on_path`` would not let it come.

        Maps that plan by something else than what an outline touches say here what they plan by.
        """
        return self.pose_check(query)

    def plane_check(self, query: PlaceQuery, frame: Transform) -> PlaneCheck:
        """A function: the ``Fit`` at many poses in the plane of a frame, by ``pose_check`` and ``path_check``."""
        return each_pose(self.pose_check(query), self.path_check(query), frame)

    @abstractmethod
    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Return the nearest pose within the tolerances [m, rad] where the robot fits; both are 0 or more."""

    # -------------------------------------------------------------------------------------------------- motion
    @abstractmethod
    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """What the robot would touch, and where, if it kept ``command`` for ``duration`` [s]; empty = nothing.

        The end of the map counts as an obstacle. A robot in a collision may leave it: what it touches already is no
        obstacle unless the motion leads deeper into it.
        """

    def obstacle_on_track(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``, for a robot that drives back along its own track.

        Ground that only costs too much is no obstacle there: the robot has just driven over it. What is lethal is one.
        """
        return self.obstacle_ahead(pose, command, duration)

    def obstacle_on_path(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``, for a robot that follows a path which stays on the map.

        It asks for no more than planners do: an outline may reach over a free end of the map, and where a map knows no
        outline only the robot's centre has to keep off ground that costs too much.
        """
        return self.obstacle_ahead(pose, command, duration)

    @abstractmethod
    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest obstacle of the storey, along the map's axes; None if none is ``within`` [m]."""

    def contact_depth(self, pose: Pose) -> float:
        """How deep [m], to half a cell or edge, the robot lies in what it touches at ``pose``; 0 = touches nothing."""
        offset = self.nearest_obstacle(pose, self.inscribed_radius)
        return 0.0 if offset is None else max(self.inscribed_radius - math.hypot(*offset), 0.0)

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:  # noqa: B027 - for maps that can close places
        """Close discs on the ground, and no others: lethal for plans, refiners and controllers from now on.

        They stay closed whatever sensors see or ``clear`` removes, until the next call. A map that cannot ignores it.
        """

    def heights_below(self, points: FloatArray) -> FloatArray | None:
        """Return the height (n,) [m] of the first ground straight below each point (n, 3) [m], nan where there is none.

        None for a map that knows no heights.
        """
        return None

    @property
    def robot_box(self) -> RobotBox:
        """The robot's outline for contacts with moving objects."""
        return RobotBox.disc(self.inscribed_radius)

    @property
    def robot_outline(self) -> FloatArray:
        """Corners (n, 2) [m] of the robot in its own frame, for pictures; of a polygon around a round robot."""
        return self.robot_box.outline()

    def safe_share(self, pose: Pose, velocity: Twist, command: Twist, now: float) -> tuple[float, str, float]:
        """How much of a command the robot may follow and still stop before it touches anything that moves.

        Parameters
        ----------
        pose, velocity, command, now : Pose, Twist, Twist, float
            Of the robot, what it is about to follow, and the time [s].

        Returns
        -------
        share : float
            1 where nothing is touched, 0 where it must stop at once.
        reason : str
            What it would touch with the whole command; empty where the share is 1.
        max_wait : float
            How long [s] to wait for that before the path counts as blocked.
        """
        return 1.0, "", 0.0

    @property
    def max_wait(self) -> float:
        """How long [s] a robot may wait for what moves before its path counts as blocked."""
        return math.inf

    def speed_limit_at(self, pose: Pose, full_speed: float) -> float:
        """Lowest speed [m/s] that layers allow at ``pose``, at most ``full_speed``; see ``layers.obeyed_limits``."""
        return full_speed

    # -------------------------------------------------------------------------------------------------- layers
    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Remove what sensors have marked in layers, in all by default; return the names of those cleared.

        Visible after the next ``update``. Raises KeyError where a name is no layer.
        """
        return []

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Clear layers, by default those that sensors fill, in a square of ``size`` [m] around a pose, or out of it."""
        return []

    def usual_parameters(self, name: str) -> Any:
        """Parameters of a layer apart from an override; raises KeyError if there is none of that name."""
        return self.layers[name].parameters

    def configuration_warnings(self) -> list[str]:
        """Legal but suspicious parameters of the map and its layers, a text each."""
        return []

    def take_parameters(self, parameters: Any) -> None:  # noqa: B027 - for maps with parameters that can change
        """Take over parameters of the map itself that can change at run time; raises ValueError for illegal ones."""

    def set_layer_parameters(self, name: str, parameters: Any, until: float = math.inf) -> None:
        """Replace the parameters of one layer, up to a time ``until`` [s] if it is given; see ``LayeredMap``."""
        raise KeyError(f"the map has no layer {name!r} whose parameters could be changed")
