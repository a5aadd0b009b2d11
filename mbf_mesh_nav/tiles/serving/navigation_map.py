"""A tiled map behind the contract of navigation maps: every question is answered on the surroundings of its place.

Surroundings are squares of a grid with a margin as wide as the question needs. Some are kept, as questions about one
robot or one path are about places near each other.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from typing import Any

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.navigation_map import NavigationMap, PlaceCheck
from mbf_abstract.maps.queries import PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import OUTSIDE, SURFACE_DISTANCE
from mbf_mesh_nav.mesh.ground import ground_heights
from mbf_mesh_nav.mesh.motion_check import UNKNOWN_RADIUS
from mbf_mesh_nav.tiles.serving.surroundings import mesh_within
from mbf_mesh_nav.tiles.tiled_map import TiledMap

CELL = 32.0
"""Side of a square of the grid, in distances between vertices."""
LEAST_MARGIN = 8.0
"""Of surroundings around their square, in distances between vertices; more of them doubled as often as needed."""
KEPT = 4
"""Surroundings that are kept."""
SEARCHED = 128.0
"""A pose where the robot fits is looked for so far away, in distances between vertices."""


class TiledNavigationMap(NavigationMap):
    """A map of tiles with its stored layers; nothing senses, nothing changes but by ``TiledMap.change_layer``.

    Attributes
    ----------
    tiled : TiledMap
    searching : threading.Lock
        Held by whoever uses ``tiled``, which takes one thread at a time.
    """

    def __init__(self, tiled: TiledMap, inscribed_radius: float = 0.0) -> None:
        self.tiled = tiled
        self.frame_id = tiled.index.frame_id
        self.searching = threading.Lock()
        self._radius = inscribed_radius
        self._kept: OrderedDict[tuple[int, int, float], MeshMap | None] = OrderedDict()

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the disc that stands for the robot: the one that was given, else that of the map's layers."""
        return self._radius or self.tiled.index.inscribed_radius

    def take_parameters(self, parameters: Any) -> None:
        """Take over ``inscribed_radius``."""
        with self.searching:
            self._radius = parameters.inscribed_radius
            self._kept.clear()

    def around(self, x: float, y: float, radius: float) -> MeshMap | None:
        """The map as far as ``radius`` [m] around a place, and farther; None where there is no surface.

        Raises
        ------
        MeshError
            A tile is damaged.
        """
        spacing = self.tiled.index.spacing
        margin, cell = LEAST_MARGIN * spacing, CELL * spacing
        while margin < radius + 2.0 * spacing:
            margin *= 2.0
        column, row = math.floor(x / cell), math.floor(y / cell)
        key = column, row, margin
        with self.searching:
            if key not in self._kept:
                low = column * cell - margin, row * cell - margin
                high = (column + 1) * cell + margin, (row + 1) * cell + margin
                found = mesh_within(self.tiled, low, high)
                if found is not None:
                    found.inscribed_radius = self.inscribed_radius
                self._kept[key] = found
                if len(self._kept) > KEPT:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Heights of all surfaces at a place, the lowest free one first; see ``ground.ground_heights``."""
        there = self.around(x, y, self.inscribed_radius)
        return () if there is None else ground_heights(there, x, y)

    # -------------------------------------------------------------------------------------------------- places
    def point_check(self) -> PlaceCheck:
        """State and interpolated cost of the surface at points."""

        def check(point: Pose) -> PlaceAnswer:
            there = self.around(point.x, point.y, SURFACE_DISTANCE + self.inscribed_radius)
            return OUTSIDE if there is None else there.places().check_point(point)

        return check

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and summed cost below the robot's disc."""

        def check(pose: Pose) -> PlaceAnswer:
            there = self.around(pose.x, pose.y, SURFACE_DISTANCE + self.inscribed_radius + query.safety_dist)
            return OUTSIDE if there is None else there.places().check_pose(pose, query)

        return self.point_check() if center_only else check

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Nearest pose where the disc fits; a disc has no heading, so the angle does not matter.

        Looked for at most ``SEARCHED`` distances between vertices away, however large the tolerance is.
        """
        within = min(dist_tolerance, SEARCHED * self.tiled.index.spacing)
        there = self.around(pose.x, pose.y, within + SURFACE_DISTANCE + self.inscribed_radius + query.safety_dist)
        if there is None:
            return PoseAnswer(OUTSIDE.state, OUTSIDE.cost, None)
        return there.places().find_valid_pose(pose, within, query)

    # -------------------------------------------------------------------------------------------------- motion
    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where the robot would come onto forbidden ground or past a border, or that it is too steep to turn."""
        radius = self.inscribed_radius or UNKNOWN_RADIUS
        there = self.around(pose.x, pose.y, command.speed * duration + SURFACE_DISTANCE + radius)
        if there is None:
            return f"the robot is more than {SURFACE_DISTANCE:g} m from the surface"
        return there.obstacle_ahead(pose, command, duration)

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest lethal vertex of the robot's storey; None if none is ``within`` [m]."""
        there = self.around(pose.x, pose.y, within + SURFACE_DISTANCE)
        return None if there is None else there.nearest_obstacle(pose, within)
