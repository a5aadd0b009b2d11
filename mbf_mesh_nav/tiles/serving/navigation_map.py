"""A tiled map behind the contract of navigation maps: every question is answered on the surroundings of its place.

These are the window around the robot where it holds all that the question looks at, and ``squares`` elsewhere. What
sensors have seen in the window counts for squares and for plans, too.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.layered_map import LayeredMap
from mbf_abstract.maps.navigation_map import PlaceCheck
from mbf_abstract.maps.queries import PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_abstract.maps.view import GridView
from mbf_mesh_nav.arrays import FlagArray, FloatArray
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import OUTSIDE, MeshPlaces
from mbf_mesh_nav.map.places import SURFACE_DISTANCE as OF_PLACES
from mbf_mesh_nav.mesh.ground import ground_heights
from mbf_mesh_nav.mesh.motion_check import SURFACE_DISTANCE as OF_ROBOTS
from mbf_mesh_nav.mesh.motion_check import UNKNOWN_RADIUS
from mbf_mesh_nav.tiles.portals import NOT_CANCELLED
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED
from mbf_mesh_nav.tiles.serving.overview import overview
from mbf_mesh_nav.tiles.serving.recently_used import RecentlyUsed
from mbf_mesh_nav.tiles.serving.squares import Squares
from mbf_mesh_nav.tiles.serving.window import FollowingWindow
from mbf_mesh_nav.tiles.serving.window_settings import WindowSettings
from mbf_mesh_nav.tiles.tile import TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap

SEARCHED = 128.0
"""A pose where the robot fits is looked for so far away, in distances between vertices."""
CANCEL_PERIOD = 0.05
"""How often [s] a goal that waits for the search of another one looks whether it is cancelled."""


class TiledNavigationMap(LayeredMap):
    """A map of tiles.

    Parameters
    ----------
    window : WindowSettings, optional
        Of the part around the robot that changes. Without it nothing senses, and nothing changes but by
        ``change_layer``.

    Attributes
    ----------
    tiled : TiledMap
        Takes one thread at a time: see ``turn_to_search``.

    Raises
    ------
    MeshError
        A tile is damaged.
    """

    def __init__(
        self,
        tiled: TiledMap,
        inscribed_radius: float = 0.0,
        max_turning_slope: float = MeshMap.max_turning_slope,
        window: WindowSettings | None = None,
    ) -> None:
        super().__init__()
        self.tiled = tiled
        self.frame_id = tiled.index.frame_id
        self.follows_robot = window is not None
        self._searching = threading.Lock()
        self._radius, self._max_turning_slope = inscribed_radius, max_turning_slope
        self._squares = Squares(tiled)
        self._window = None if window is None else FollowingWindow(tiled, self._squares, window)
        self._no_layers = LayerGraph()
        self._views: RecentlyUsed[str, GridView] = RecentlyUsed(self._picture, len(tiled.index.layers))

    @property
    def layers(self) -> LayerGraph:  # type: ignore[override]
        """Those of the window, other ones when it has moved."""
        return self._no_layers if self._window is None else self._window.now.map.layers

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the disc that stands for the robot: the one that was given, else that of the map's layers."""
        return self._radius or self.tiled.index.inscribed_radius

    @property
    def senses(self) -> bool:
        """Whether sensors change the map."""
        return self._window is not None and self._window.senses

    @property
    def reach(self) -> float:
        """How far [m] around a place a question can look."""
        return self._squares.reach

    @property
    def window_map(self) -> MeshMap:
        """The window around the robot, another one when it has moved; ValueError on a map without."""
        if self._window is None:
            raise ValueError("the map of tiles has no window around the robot")
        return self._for_robot(self._window.now.map)

    def take_parameters(self, parameters: Any) -> None:
        """Take over ``inscribed_radius``."""
        self._radius = parameters.inscribed_radius

    @contextmanager
    def turn_to_search(self, cancel_flag: FlagArray = NOT_CANCELLED) -> Iterator[bool]:
        """Have ``tiled`` for one thread; False, and not for it, if the flag was set before others were done with it."""
        while not self._searching.acquire(timeout=CANCEL_PERIOD):
            if cancel_flag[0] != 0:
                yield False
                return
        try:
            if self._window is not None:
                window = self._window.now
                self.tiled.lay_over(window.sensed(window.map.snapshot()))
            yield True
        finally:
            self._searching.release()

    def change_layer(self, key: TileKey, layer: str, costs: CostArray, lethal: LethalArray) -> None:
        """``TiledMap.change_layer``, between two searches; every later question and plan has the new values."""
        with self.turn_to_search():
            self.tiled.change_layer(key, layer, costs, lethal)
        self._squares.clear()
        self._views.clear()
        if self._window is not None:
            self._window.renew()

    def view(self, layer: str) -> GridView:
        """The costs of a layer from above; the first time, and after a change, all tiles are read for it.

        Raises
        ------
        MeshError
            A tile is damaged.
        """
        return self._views.get(layer)

    def around(self, x: float, y: float, radius: float) -> MeshMap | None:
        """The map as far as ``radius`` [m] around a place, and farther; None where there is no surface.

        Raises
        ------
        ValueError
            The radius is larger than ``reach``.
        MeshError
            A tile is damaged.
        """
        self._check_reach(radius)
        window = None if self._window is None else self._window.now
        if window is not None and window.holds(x, y, radius):
            return self._for_robot(window.map)
        sensed = NOTHING_SENSED if window is None else window.sensed(window.map.snapshot())
        found = self._squares.around(x, y, radius, sensed)
        return None if found is None else self._for_robot(found)

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Heights of all surfaces at a place, the lowest free one first; see ``ground.ground_heights``."""
        there = self.around(x, y, self.inscribed_radius)
        return () if there is None else ground_heights(there, x, y)

    def heights_below(self, points: FloatArray) -> FloatArray:
        """Height (n,) [m] of the first surface straight below each point (n, 3) [m], nan where there is none.

        Points that are too far apart for one part of the map are answered in halves.
        """
        if len(points) == 0:
            return np.zeros(0)
        lowest, highest = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        (x, y), (width, depth) = (0.5 * (lowest + highest)).tolist(), (highest - lowest).tolist()
        radius = 0.5 * math.hypot(width, depth)
        if radius <= self.reach:
            there = self.around(x, y, radius)
            return np.full(len(points), np.nan) if there is None else there.heights_below(points)
        near = points[:, 0] <= x if width >= depth else points[:, 1] <= y
        heights = np.empty(len(points))
        heights[near], heights[~near] = self.heights_below(points[near]), self.heights_below(points[~near])
        return heights

    # -------------------------------------------------------------------------------------------------- places
    def point_check(self) -> PlaceCheck:
        """State and interpolated cost of the surface at points, on the map as it is now."""
        places = self._places(OF_PLACES + self.inscribed_radius)

        def check(point: Pose) -> PlaceAnswer:
            there = places(point.x, point.y)
            return OUTSIDE if there is None else there.check_point(point)

        return check

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and summed cost below the robot's disc, on the map as it is now.

        ValueError if the disc is wider than ``reach``.
        """
        if center_only:
            return self.point_check()
        places = self._places(OF_PLACES + self.inscribed_radius + query.safety_dist)

        def check(pose: Pose) -> PlaceAnswer:
            there = places(pose.x, pose.y)
            return OUTSIDE if there is None else there.check_pose(pose, query)

        return check

    def _places(self, radius: float) -> Callable[[float, float], MeshPlaces | None]:
        """What can be asked of the surroundings of places, all of them on the map as it is now; see ``around``."""
        self._check_reach(radius)
        window = None if self._window is None else self._window.now
        near = None if window is None else self._for_robot(window.map).places()
        sensed = NOTHING_SENSED if window is None or near is None else window.sensed(near.snapshot)

        def places(x: float, y: float) -> MeshPlaces | None:
            if window is not None and window.holds(x, y, radius):
                return near
            found = self._squares.around(x, y, radius, sensed)
            return None if found is None else self._for_robot(found).places()

        return places

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Nearest pose where the disc fits; a disc has no heading, so the angle does not matter.

        Looked for at most ``SEARCHED`` distances between vertices away, however large the tolerance is. ValueError if
        the disc is wider than what is left of ``reach``.
        """
        within = min(dist_tolerance, SEARCHED * self.tiled.index.spacing)
        there = self.around(pose.x, pose.y, within + OF_PLACES + self.inscribed_radius + query.safety_dist)
        if there is None:
            return PoseAnswer(OUTSIDE.state, OUTSIDE.cost, None)
        return there.places().find_valid_pose(pose, within, query)

    # -------------------------------------------------------------------------------------------------- motion
    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where the robot would come onto forbidden ground or past a border, or that it is too steep to turn.

        A motion that leads farther than ``reach`` is an obstacle.
        """
        radius = OF_ROBOTS + command.speed * duration + (self.inscribed_radius or UNKNOWN_RADIUS)
        if radius > self.reach:
            return f"the motion needs {radius:.4g} m of the map of tiles around the robot, the limit is {self._limit}"
        there = self.around(pose.x, pose.y, radius)
        if there is None:
            return f"the robot is more than {OF_ROBOTS:g} m from the surface"
        return there.obstacle_ahead(pose, command, duration)

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest lethal vertex of the robot's storey; None if none is ``within`` [m].

        ValueError if that is farther than ``reach``.
        """
        there = self.around(pose.x, pose.y, within + OF_ROBOTS)
        return None if there is None else there.nearest_obstacle(pose, within)

    # -------------------------------------------------------------------------------------------------- layers
    def update(self, robot_pose: Pose | None, now: float) -> None:
        """Take in what sensors have seen, see ``FollowingWindow.update``; overrides of parameters that are over end."""
        self.end_overrides(now)
        if self._window is not None:
            self._window.update(robot_pose, now)

    def stale_reason(self, now: float) -> str:
        """Why the map is not current at ``now`` [s]; without a window it is."""
        return "" if self._window is None else self._window.stale_reason(now)

    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Forget all sensed obstacles, or those in some layers, at once; return the names of the layers."""
        return [] if self._window is None else self._window.cleared(lambda one: one.clear(layer_names))

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Forget obstacles sensed inside, or outside, a square of side ``size`` [m] around a pose, as ``clear``."""
        if self._window is None:
            return []
        return self._window.cleared(lambda one: one.clear_area(center, size, layer_names, inside=inside))

    def _replace_parameters(self, name: str, parameters: LayerParameters) -> None:
        if self._window is not None:  # else there is no layer of that name
            self._window.set_layer_parameters(name, parameters)

    # ---------------------------------------------------------------------------------------------- surroundings
    def _for_robot(self, mesh_map: MeshMap) -> MeshMap:
        """A part of the map with the robot's figures of now."""
        mesh_map.inscribed_radius, mesh_map.max_turning_slope = self.inscribed_radius, self._max_turning_slope
        return mesh_map

    @property
    def _limit(self) -> str:
        return f"{self.reach:.4g} m"

    def _check_reach(self, radius: float) -> None:
        if radius > self.reach:
            raise ValueError(
                f"the question looks {radius:.4g} m around a place (the robot's radius, safety_dist and tolerances), "
                f"the limit on this map of tiles is {self._limit}"
            )

    def _picture(self, layer: str) -> GridView:
        return overview(self.tiled, self.tiled.index.layers.index(layer))
