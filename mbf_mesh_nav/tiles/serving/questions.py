"""Questions about places on a map of tiles, each answered on what lies around its place, see ``Moment``."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.queries import PlaceAnswer, PlaceCheck, PlaceQuery, PoseAnswer
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.map.ground import ground_heights
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import OUTSIDE
from mbf_mesh_nav.map.places import SURFACE_DISTANCE as OF_PLACES
from mbf_mesh_nav.map.robot_outline import OutlinedMap
from mbf_mesh_nav.mesh.motion_check import SURFACE_DISTANCE as OF_ROBOTS
from mbf_mesh_nav.tiles.serving.moment import Moment

SEARCHED = 128.0
"""A pose where the robot fits is looked for so far away, in distances between vertices."""


class TileQuestions(OutlinedMap):
    """What every map of tiles answers."""

    @property
    @abstractmethod
    def spacing(self) -> float:
        """About how far [m] vertices lie from each other."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """How far [m] around a place a question can look."""

    @abstractmethod
    def moment(self) -> Moment:
        """The map as it is now."""

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
        found = self.moment().around(x, y, radius)
        return None if found is None else found[0]

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
        radius = OF_PLACES + self.inscribed_radius
        self._check_reach(radius)
        now = self.moment()

        def check(point: Pose) -> PlaceAnswer:
            there = now.places(point.x, point.y, radius)
            return OUTSIDE if there is None else there.check_point(point)

        return check

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and summed cost below the robot's disc, on the map as it is now.

        ValueError if the disc is wider than ``reach``.
        """
        if center_only:
            return self.point_check()
        radius = OF_PLACES + 2.0 * self.inscribed_radius + query.safety_dist
        self._check_reach(radius)
        now = self.moment()

        def check(pose: Pose) -> PlaceAnswer:
            there = now.places(pose.x, pose.y, radius)
            return OUTSIDE if there is None else there.check_pose(pose, query)

        return check

    def path_check(self, query: PlaceQuery) -> PlaceCheck:
        """State of the ground below the robot's centre as planners look at it: LETHAL where it costs too much."""
        now, room = self.moment(), query.safety_dist

        def check(pose: Pose) -> PlaceAnswer:
            there = now.places(pose.x, pose.y, OF_PLACES + room)
            return OUTSIDE if there is None else there.check_on_path(pose, room)

        return check

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Nearest pose where the disc fits; a disc has no heading, so the angle does not matter.

        Looked for at most ``SEARCHED`` distances between vertices away, however large the tolerance is. ValueError if
        the disc is wider than what is left of ``reach``.
        """
        within = min(dist_tolerance, SEARCHED * self.spacing)
        there = self.around(pose.x, pose.y, within + OF_PLACES + 2.0 * self.inscribed_radius + query.safety_dist)
        if there is None:
            return PoseAnswer(OUTSIDE.state, OUTSIDE.cost, None)
        return there.places().find_valid_pose(pose, within, query)

    # -------------------------------------------------------------------------------------------------- motion
    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where the robot would come onto forbidden ground or past a border, or that it is too steep to turn.

        A motion that leads farther than ``reach`` is an obstacle.
        """
        there = self._around_motion(pose, command, duration)
        return there if isinstance(there, str) else there.obstacle_ahead(pose, command, duration)

    def obstacle_on_track(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``, where only lethal ground is forbidden."""
        there = self._around_motion(pose, command, duration)
        return there if isinstance(there, str) else there.obstacle_on_track(pose, command, duration)

    def obstacle_on_path(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``, where the robot may reach over a border."""
        there = self._around_motion(pose, command, duration)
        return there if isinstance(there, str) else there.obstacle_on_path(pose, command, duration)

    def _around_motion(self, pose: Pose, command: Twist, duration: float) -> MeshMap | str:
        """The part of the map a motion needs, or why there is none."""
        radius = OF_ROBOTS + command.speed * duration + self.robot_reach
        if radius > self.reach:
            return f"the motion needs {radius:.4g} m of the map of tiles around the robot, the limit is {self._limit}"
        there = self.around(pose.x, pose.y, radius)
        if there is None:
            return f"the robot is more than {OF_ROBOTS:g} m from the surface"
        return there

    def contact_depth(self, pose: Pose) -> float:
        """How deep [m] the robot's disc lies in lethal ground; 0 where its centre may stand."""
        there = self.around(pose.x, pose.y, OF_ROBOTS + 2.0 * self.robot_reach)
        return 0.0 if there is None else there.contact_depth(pose)

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest lethal vertex of the robot's storey; None if none is ``within`` [m].

        ValueError if that is farther than ``reach``.
        """
        there = self.around(pose.x, pose.y, within + OF_ROBOTS)
        return None if there is None else there.nearest_obstacle(pose, within)

    @property
    def _limit(self) -> str:
        return f"{self.reach:.4g} m"

    def _check_reach(self, radius: float) -> None:
        if radius > self.reach:
            raise ValueError(
                f"the question looks {radius:.4g} m around a place (the robot's radius, safety_dist and tolerances), "
                f"the limit on this map of tiles is {self._limit}"
            )
