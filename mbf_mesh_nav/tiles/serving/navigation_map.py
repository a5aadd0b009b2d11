"""A tiled map behind the contract of navigation maps: every question is answered on the surroundings of its place.

Surroundings are squares of a grid with a margin as wide as the question needs. Some are kept, as questions about one
robot or one path are about places near each other. They are cut out of tiles of their own, so no question waits for a
search.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.navigation_map import NavigationMap, PlaceCheck
from mbf_abstract.maps.queries import PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_abstract.maps.view import GridView
from mbf_mesh_nav.arrays import FlagArray
from mbf_mesh_nav.map.layer import CostArray, LethalArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import OUTSIDE
from mbf_mesh_nav.map.places import SURFACE_DISTANCE as OF_PLACES
from mbf_mesh_nav.mesh.ground import ground_heights
from mbf_mesh_nav.mesh.motion_check import SURFACE_DISTANCE as OF_ROBOTS
from mbf_mesh_nav.mesh.motion_check import UNKNOWN_RADIUS
from mbf_mesh_nav.tiles.portals import NOT_CANCELLED
from mbf_mesh_nav.tiles.serving.overview import overview
from mbf_mesh_nav.tiles.serving.recently_used import RecentlyUsed
from mbf_mesh_nav.tiles.serving.surroundings import mesh_within
from mbf_mesh_nav.tiles.tile import Tile, TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap, sound_tile

CELL = 32.0
"""Side of a square of the grid, in distances between vertices."""
LEAST_MARGIN, MOST_MARGIN = 8.0, 512.0
"""Of surroundings around their square, in distances between vertices; the least one doubled as often as needed."""
BEYOND = 2.0
"""How much wider than the question's radius a margin is, in distances between vertices."""
KEPT_VERTICES = 400_000
"""Of surroundings that are kept; one vertex takes some 370 bytes."""
OF_A_SQUARE = 1000
"""Vertices that surroundings count for besides their own, so that there are not too many small or empty ones."""
KEPT_TILES = 4
"""Tiles that surroundings were cut out of and that stay loaded."""
SEARCHED = 128.0
"""A pose where the robot fits is looked for so far away, in distances between vertices."""
CANCEL_PERIOD = 0.05
"""How often [s] a goal that waits for the search of another one looks whether it is cancelled."""


class TiledNavigationMap(NavigationMap):
    """A map of tiles with its stored layers; nothing senses, nothing changes but by ``change_layer``.

    Attributes
    ----------
    tiled : TiledMap
        Takes one thread at a time: see ``turn_to_search``.
    """

    def __init__(
        self, tiled: TiledMap, inscribed_radius: float = 0.0, max_turning_slope: float = MeshMap.max_turning_slope
    ) -> None:
        self.tiled = tiled
        self.frame_id = tiled.index.frame_id
        self._searching = threading.Lock()
        self._radius, self._max_turning_slope = inscribed_radius, max_turning_slope
        self._tiles: RecentlyUsed[TileKey, Tile] = RecentlyUsed(self._read, KEPT_TILES)
        self._squares = RecentlyUsed(self._cut_out, KEPT_VERTICES, _size)
        self._views: RecentlyUsed[str, GridView] = RecentlyUsed(self._picture, len(tiled.index.layers))

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the disc that stands for the robot: the one that was given, else that of the map's layers."""
        return self._radius or self.tiled.index.inscribed_radius

    @property
    def reach(self) -> float:
        """How far [m] around a place a question can look."""
        return (MOST_MARGIN - BEYOND) * self.tiled.index.spacing

    def take_parameters(self, parameters: Any) -> None:
        """Take over ``inscribed_radius``."""
        self._radius = parameters.inscribed_radius
        self._squares.clear()

    @contextmanager
    def turn_to_search(self, cancel_flag: FlagArray = NOT_CANCELLED) -> Iterator[bool]:
        """Have ``tiled`` for one thread; False, and not for it, if the flag was set before others were done with it."""
        while not self._searching.acquire(timeout=CANCEL_PERIOD):
            if cancel_flag[0] != 0:
                yield False
                return
        try:
            yield True
        finally:
            self._searching.release()

    def change_layer(self, key: TileKey, layer: str, costs: CostArray, lethal: LethalArray) -> None:
        """``TiledMap.change_layer``, between two searches; every later question and plan has the new values."""
        with self.turn_to_search():
            self.tiled.change_layer(key, layer, costs, lethal)
        # Tiles first: what is cut out in between has the new ones.
        for made_of_tiles in (self._tiles, self._squares, self._views):
            made_of_tiles.clear()

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
        spacing, margin = self.tiled.index.spacing, LEAST_MARGIN
        while (margin - BEYOND) * spacing < radius:
            margin *= 2.0
        return self._squares.get((math.floor(x / (CELL * spacing)), math.floor(y / (CELL * spacing)), margin))

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Heights of all surfaces at a place, the lowest free one first; see ``ground.ground_heights``."""
        there = self.around(x, y, self.inscribed_radius)
        return () if there is None else ground_heights(there, x, y)

    # -------------------------------------------------------------------------------------------------- places
    def point_check(self) -> PlaceCheck:
        """State and interpolated cost of the surface at points."""

        def check(point: Pose) -> PlaceAnswer:
            there = self.around(point.x, point.y, OF_PLACES + self.inscribed_radius)
            return OUTSIDE if there is None else there.places().check_point(point)

        return check

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and summed cost below the robot's disc; ValueError if that is wider than ``reach``."""
        radius = OF_PLACES + self.inscribed_radius + query.safety_dist

        def check(pose: Pose) -> PlaceAnswer:
            there = self.around(pose.x, pose.y, radius)
            return OUTSIDE if there is None else there.places().check_pose(pose, query)

        if center_only:
            return self.point_check()
        self._check_reach(radius)
        return check

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

    # ---------------------------------------------------------------------------------------------- surroundings
    @property
    def _limit(self) -> str:
        return f"{self.reach:.4g} m"

    def _check_reach(self, radius: float) -> None:
        if radius > self.reach:
            raise ValueError(
                f"the question looks {radius:.4g} m around a place (the robot's radius, safety_dist and tolerances), "
                f"the limit on this map of tiles is {self._limit}"
            )

    def _read(self, key: TileKey) -> Tile:
        return sound_tile(self.tiled.folder, self.tiled.index, key)

    def _cut_out(self, square: tuple[int, int, float]) -> MeshMap | None:
        """Surroundings of a square of the grid: column, row, and margin in distances between vertices."""
        column, row, margin = square
        spacing = self.tiled.index.spacing
        low = (column * CELL - margin) * spacing, (row * CELL - margin) * spacing
        high = ((column + 1) * CELL + margin) * spacing, ((row + 1) * CELL + margin) * spacing
        found = mesh_within(self.tiled, low, high, self._tiles.get)
        if found is not None:
            found.inscribed_radius, found.max_turning_slope = self.inscribed_radius, self._max_turning_slope
        return found

    def _picture(self, layer: str) -> GridView:
        return overview(self.tiled, self.tiled.index.layers.index(layer))


def _size(surroundings: MeshMap | None) -> float:
    return OF_A_SQUARE + (0 if surroundings is None else len(surroundings.vertices))
