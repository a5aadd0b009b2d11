"""Manoeuvres: pieces of a path that the robot's outline can drive, where it does not fit along the path over cells.

When to use: by the planners over cells, so that what they call a path is one that a controller accepts. When not:
round robots on paths away from obstacles, where the check finds nothing and costs a fraction of the search.

Rule: where the outline does not fit, the path is left some lengths of the robot before and joined behind, and a search
for a car that may reverse (``car_search``) goes from pose to pose; longer and longer pieces are tried, at last from
start to goal. Each is tried with an outline half a cell larger first, as no controller keeps to a path exactly, and
with tighter and tighter curves. Where only the outline itself fits, one a fifth of a cell larger is tried after it: a
search that finds nothing takes no longer so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import CellBox, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.map.outline_along import fits_along
from mbf_costmap_nav.kernels.map.path_poses import headed_poses
from mbf_costmap_nav.planning.outline_course import ARM, Course, dense, stretches, turn_step

if TYPE_CHECKING:
    from mbf_costmap_nav.planning.car_search import Driving

FloatArray = NDArray[np.float64]

REACHES = (1.5, 4.0, np.inf)
"""How far from a misfit the path is left and joined again, in circumscribed radii."""
BESIDE = 3.0
"""How far beside the path a manoeuvre may lead, in circumscribed radii."""
CURVES = (1.0, 0.3)
"""Radii of the curves of a robot that turns on the spot, in circumscribed radii."""
FROM_START_TO_GOAL = 5
"""A search of the whole path may make so many times the states of a search of one piece."""
ROOMY, SPARE = 0.5, 0.2
"""How much larger the outline is taken [cells]: at first, and where nothing was found with that."""
REVERSE_PENALTY, CHANGE_PENALTY, TURNING_PENALTY = 1.5, 0.5, 1.05


@dataclass(frozen=True)
class Fitted:
    """A path of a robot with an outline.

    Attributes
    ----------
    points : (n, 2) float64
        [m]
    yaws : (n,) float64, optional
        Headings [rad] on manoeuvres; nan where the robot looks along the path, None where it does so all along.
    """

    points: FloatArray
    yaws: FloatArray | None = None

    @property
    def end_yaw(self) -> float:
        """Heading [rad] at the last point."""
        if self.yaws is not None and not math.isnan(self.yaws[-1]):
            return float(self.yaws[-1])
        (x0, y0), (x1, y1) = self.points[-2:].tolist()
        return math.atan2(y1 - y0, x1 - x0)


@dataclass(frozen=True)
class Misfit:
    """Where (x, y, yaw) [m, m, rad] no manoeuvre was found: at the start of a leg, at its end, or between."""

    pose: tuple[float, float, float]
    at_start: bool
    at_end: bool


@dataclass(frozen=True)
class Manoeuvres:
    """One snapshot and the robot on it.

    Attributes
    ----------
    footprint : Footprint
        Padded, as the controllers check it.
    min_turning_radius : float
        Of the robot [m]; 0 = it turns on the spot.
    cost_factor : float
        Relative extra length of a path through cells of cost 252.
    max_states : int
        The search of a piece gives up after so many; 0 = no manoeuvres.
    """

    costmap: Costmap
    footprint: Footprint
    min_turning_radius: float
    cost_factor: float
    allow_unknown: bool
    max_states: int
    token: CancelToken

    @cached_property
    def _check(self) -> FootprintCheck:
        return FootprintCheck(self.footprint, self.costmap.resolution)

    def fit(
        self, points: FloatArray, start_yaw: float | None, end_yaw: float | None, spare: float = 0.0
    ) -> Fitted | Misfit:
        """Replace what the robot cannot drive of a path of points (k, 2), if there is anything.

        Parameters
        ----------
        start_yaw, end_yaw : float or None
            Headings [rad] at the ends; None = that of the path.
        spare : float
            How much [m] of the path's end may be left out where the robot does not fit at it.
        """
        if self._fits(points, start_yaw, end_yaw):
            return Fitted(points)
        course = self._course(points, start_yaw, end_yaw)
        wrong = course.misfits(self._check, self.costmap)
        if wrong[-1] and spare > 0.0:
            points = course.before_misfit(points, spare, self._check, self.costmap)
            course = self._course(points, start_yaw, end_yaw)
            wrong = course.misfits(self._check, self.costmap)
        if not wrong.any():
            return self._headed(points, np.full(len(points), np.nan), course)
        for reach in REACHES if self.max_states else ():
            pieces: list[tuple[int, int, FloatArray]] = []
            for first, last in stretches(wrong, course.lengths, reach * self.footprint.circumscribed_radius):
                drive = self._drive(course, first, last, everywhere=math.isinf(reach))
                if drive is None:
                    break
                pieces.append((first, last, drive))
            else:
                return self._headed(*_joined(points, course, pieces), course)
            if self.token.cancelled:
                break
        index = int(np.argmax(wrong))
        at_end = index == len(wrong) - 1
        return Misfit(course.colliding_pose(index, self._check, self.costmap), index == 0 and not at_end, at_end)

    def _fits(self, points: FloatArray, start_yaw: float | None, end_yaw: float | None) -> bool:
        """Whether there is nothing to replace, all in one: so it mostly is."""
        grid = self.costmap.cells, self.costmap.resolution, self.costmap.origin_x, self.costmap.origin_y
        turns = (start_yaw, end_yaw) if self.min_turning_radius == 0.0 else (None, None)
        yaws = [math.nan if yaw is None else float(yaw) for yaw in turns]
        step = turn_step(self._check, self.costmap)
        return bool(fits_along(*grid, self._check.samples, np.ascontiguousarray(points), ARM, step, *yaws))

    def _course(self, points: FloatArray, start_yaw: float | None, end_yaw: float | None) -> Course:
        """Course on a path; a car does not turn where it stands."""
        turns = start_yaw, end_yaw
        return Course.along(
            points, self.costmap.resolution, *(turns if self.min_turning_radius == 0.0 else (None, None))
        )

    def _headed(self, points: FloatArray, yaws: FloatArray, course: Course) -> Fitted:
        """Give the headings of the course to the points whose direction to the next one would be too much of a turn.

        A path over cells goes in steps of 45 degrees; the robot looks along it on the average.
        """
        wrong = self._check.collisions(self.costmap, headed_poses(np.ascontiguousarray(points))) & np.isnan(yaws)
        wrong[[0, -1]] = False
        if not wrong.any():
            return Fitted(points, yaws)
        nearest = [int(np.argmin(norm(course.poses[:, :2] - point))) for point in points[wrong]]
        yaws[wrong] = course.poses[nearest, 2]
        return Fitted(points, yaws)

    def _drive(self, course: Course, first: int, last: int, *, everywhere: bool) -> FloatArray | None:
        """Poses (n, 3) between two poses of a course that the outline can drive; None if none were found."""
        ends = course.poses[[first, last]]
        if first == 0 and course.start_yaw is not None:
            ends[0, 2] = course.start_yaw
        if last == len(course.poses) - 1 and course.end_yaw is not None:
            ends[1, 2] = course.end_yaw
        beside = BESIDE * self.footprint.circumscribed_radius
        window = self.costmap if everywhere else self._around(course.poses[first : last + 1, :2], beside)
        asked = window, ends, everywhere
        roomy = self._search(*asked, ROOMY)
        tight = self._search(*asked, 0.0) if roomy is None else None
        spare = self._search(*asked, SPARE) if tight is not None else None
        return next((drive for drive in (roomy, spare, tight) if drive is not None), None)

    def _search(self, window: Costmap, ends: FloatArray, everywhere: bool, margin: float) -> FloatArray | None:
        """Poses (n, 3) from one to the other of ``ends`` (2, 3) that an outline larger by ``margin`` [cells] drives."""
        from mbf_costmap_nav.planning.car_search import search_drive  # with kernels that few paths need
        from mbf_costmap_nav.planning.car_world import CarWorld

        start, goal = (Pose.planar(*end) for end in ends.tolist())
        outline = self.footprint.offset(margin * self.costmap.resolution)
        world = CarWorld.build(
            window, outline, self.token, cost_factor=self.cost_factor, allow_unknown=self.allow_unknown
        )
        if not (world.fits(start) and world.fits(goal)):
            return None
        ground, radius = world.ground(), self.footprint.circumscribed_radius
        for curve in CURVES[:1] if everywhere or self.min_turning_radius > 0.0 else CURVES:
            states = self.max_states * (FROM_START_TO_GOAL if everywhere else 1)
            driving = self._driving(self.min_turning_radius or curve * radius, states)
            leg = search_drive(world, driving, start, goal, ground=ground)
            if len(leg.poses) and self._check.first_collision(self.costmap, dense(leg.poses)) < 0:
                return leg.poses
        return None

    def _driving(self, radius: float, max_states: int) -> Driving:
        from mbf_costmap_nav.planning.car_search import Driving

        return Driving(
            radius=radius,
            reversing=True,
            cost_factor=self.cost_factor,
            reverse_penalty=REVERSE_PENALTY,
            change_penalty=CHANGE_PENALTY,
            turning_penalty=TURNING_PENALTY,
            max_states=max_states,
        )

    def _around(self, places: FloatArray, beside: float) -> Costmap:
        """The part of the map ``beside`` [m] around places (n, 2)."""
        costmap = self.costmap
        low = costmap.world_to_cell_clamped(*(places.min(axis=0) - beside).tolist())
        high = costmap.world_to_cell_clamped(*(places.max(axis=0) + beside).tolist())
        return costmap.part(CellBox(*low, high[0] + 1, high[1] + 1))


def _joined(
    points: FloatArray, course: Course, pieces: list[tuple[int, int, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) and headings (n,) of the path with manoeuvres instead of parts of it."""
    lengths = polyline_lengths(points)
    parts: list[FloatArray] = []
    done = -1.0
    for first, last, drive in pieces:
        kept = points[(lengths > done) & (lengths < course.lengths[first])]
        parts += [np.column_stack([kept, np.full(len(kept), np.nan)]), drive]
        done = course.lengths[last]
    rest = points[lengths > done]
    parts.append(np.column_stack([rest, np.full(len(rest), np.nan)]))
    joined = np.concatenate(parts)
    return joined[:, :2], joined[:, 2]
