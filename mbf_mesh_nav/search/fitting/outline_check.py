"""Looks once more at paths of planners that know a disc only, for places where the robot's outline does not fit.

When to use: by every planner on a map with ``check_footprint``. The outline is put down along the path with the
headings a follower has there, and turned on the spot at its ends, as the map's check of motions does it. Where it
touches something, the ground nearer to that than the robot's origin was is closed and the leg planned again, a bounded
number of times; so a path is pushed away from what it touches. Where that closes a passage, the robot drives straight
through it and turns before and behind; where it has no room to, the passage is given up. Where there is no room to turn
at an end, the robot drives on a little first, straight or on an arc, or comes to its goal so.
Where no plan fits there is none, and the answer names the place: the controllers would refuse such a path.

When not: for manoeuvres. A robot that has to reverse to get anywhere finds no path here; its recoveries back it up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.outline_on_ground import OutlineOnGround
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.search.fitting.misfits import CHORD, Misfits, misfits_of, nearer_to_what_is_touched
from mbf_mesh_nav.search.fitting.runs import Run, run_through_passage, runs_at
from mbf_mesh_nav.search.leg_search import Leg, LegQuery, joined, points_at

PADDING = 0.01
"""A path fits the outline grown by so much [m], so that it fits between the poses that are looked at, too."""
TRIES, PASSAGES = 12, 3
"""So often a leg is planned again, and so many passages are driven through one after the other, at most."""
SLIGHT_TURN, STEERED_TURN = 0.05, 0.6
"""Smaller turns [rad] to the goal's heading, and to the begin of the path, which is steered into, are not looked at."""

PlanAgain = Callable[[LegQuery], Leg | None]
"""Plans a leg with other ends, and with more vertices blocked; None if there is no path."""


class OutlineCheck:
    """Checks the legs of one planner on one map."""

    def __init__(self, mesh_map: MeshMap) -> None:
        self._mesh_map = mesh_map

    def leg_that_fits(
        self, query: LegQuery, outline: OutlineOnGround, leg: Leg, plan_again: PlanAgain
    ) -> Leg | PlanResult:
        """The leg if the outline fits all along it, else another one of which that is true, else why there is none."""
        passages = 0 if leg.guidance is not None else PASSAGES  # a field to follow leads to the goal of its own search
        first = found = self._without_misfits(query, outline, leg, plan_again, passages)
        if query.start_pose is None or query.goal_pose is None or leg.guidance is not None:
            return found
        begins = runs_at(self._mesh_map, query, outline, query.start_pose, 1.0)
        ends = runs_at(self._mesh_map, query, outline, query.goal_pose, -1.0)
        begin: Run | None = None
        end: Run | None = None
        while isinstance(found, PlanResult) and found.outcome != GetPathOutcome.NO_PATH_FOUND:
            at_start = found.outcome == GetPathOutcome.BLOCKED_START
            other = next(begins if at_start else ends, None)
            if other is None or query.cancel_flag[0]:
                return first
            begin, end = (other, end) if at_start else (begin, other)
            inner = _from_end_of(begin, _to_begin_of(end, query))
            between = plan_again(inner)
            if between is None:
                return first
            found = self._without_misfits(inner, outline, between, plan_again, passages)
            if isinstance(found, Leg):
                whole = found if begin is None else joined(begin.leg, found)
                whole = whole if end is None else joined(whole, end.leg)
                found = self._problem_of_whole(query, outline, whole) or whole
        return found

    def _problem_of_whole(self, query: LegQuery, outline: OutlineOnGround, leg: Leg) -> PlanResult | None:
        """Why joined pieces, each of which fits, do not where they are joined; None if they do."""
        misfits = misfits_of(self._mesh_map, query, outline, leg)
        if not len(misfits.touched):
            return None
        at_start = misfits.near_start(0.5 * misfits.length)[0]
        outcome = GetPathOutcome.BLOCKED_START if at_start else GetPathOutcome.BLOCKED_GOAL
        return PlanResult(outcome, misfits.text(self._mesh_map, misfits.lengths >= 0.0))

    def _without_misfits(
        self, query: LegQuery, outline: OutlineOnGround, leg: Leg, plan_again: PlanAgain, passages: int
    ) -> Leg | PlanResult:
        """The leg, or one farther from what the outline touches on it; why it cannot be begun or ended, or is none."""
        closed, other, place = query.blocked, leg, ""
        ends = self._mesh_map.faces[[query.start.face, query.goal.face]]
        for _ in range(TRIES):
            misfits = misfits_of(self._mesh_map, query, outline, other)
            if (problem := self._problem_at_end(query, outline, other, misfits)) is not None:
                return problem
            if not len(misfits.touched):
                return other
            place = place or position_text(misfits.spots.points[0])
            wider, given_up = closed.copy(), closed.copy()
            wider[nearer_to_what_is_touched(self._mesh_map, misfits, outline.reach)] = True
            given_up[misfits.below] = True
            wider[ends] = given_up[ends] = False
            if query.cancel_flag[0] or (given_up == closed).all():
                break
            further, closed = plan_again(replace(query, blocked=wider)), wider
            if further is None:
                through = self._through_passage(query, outline, misfits, plan_again, passages)
                if through is not None:
                    return through
                further, closed = plan_again(replace(query, blocked=given_up)), given_up
            if further is None:
                break
            other = further
        text = f"the footprint fits on no path that was tried, first not at {place}"
        return PlanResult(GetPathOutcome.NO_PATH_FOUND, text)

    def _through_passage(
        self, query: LegQuery, outline: OutlineOnGround, misfits: Misfits, plan_again: PlanAgain, passages: int
    ) -> Leg | None:
        """The leg that leads straight through the narrowest place of one that does not fit; None without."""
        passage = run_through_passage(self._mesh_map, query, outline, misfits) if passages else None
        if passage is None:
            return None
        to_passage, from_passage = _to_begin_of(passage, query), _from_end_of(passage, query)
        parts = []
        for part in (to_passage, from_passage):
            leg = plan_again(part)
            found = None if leg is None else self._without_misfits(part, outline, leg, plan_again, passages - 1)
            if not isinstance(found, Leg):
                return None
            parts.append(found)
        whole = joined(joined(parts[0], passage.leg), parts[1])
        return None if len(misfits_of(self._mesh_map, query, outline, whole).touched) else whole

    def _problem_at_end(
        self, query: LegQuery, outline: OutlineOnGround, leg: Leg, misfits: Misfits
    ) -> PlanResult | None:
        """Why a leg that fits in between cannot be begun or ended; None if it can."""
        at_start, at_goal = misfits.near_start(outline.reach), misfits.near_goal(outline.reach)
        if not (at_start | at_goal).all():
            return None
        lengths = polyline_lengths(leg.positions)
        places = points_at(leg.positions, lengths, np.array([0.0, CHORD, lengths[-1] - CHORD, lengths[-1]]))
        begin, end = (math.atan2(y, x) for x, y, _ in (places[1::2] - places[::2]).tolist())
        pose, goal = query.start_pose, query.goal_pose
        if pose is not None:
            obstacle = misfits.text(self._mesh_map, at_start)
            obstacle = obstacle or _turn(outline, query.start, pose, begin, STEERED_TURN)
            if obstacle:
                text = f"the robot cannot turn to its path: {obstacle}; {getting_free(self._mesh_map, pose)}"
                return PlanResult(GetPathOutcome.BLOCKED_START, text)
        if goal is not None:
            obstacle = misfits.text(self._mesh_map, at_goal)
            if not obstacle and abs(_between(end, goal.yaw)) > query.angle_tolerance:
                obstacle = _turn(outline, query.goal, Pose.planar(goal.x, goal.y, end, goal.z), goal.yaw)
            if obstacle:
                text = f"the robot cannot turn to its heading there: {obstacle}"
                return PlanResult(GetPathOutcome.BLOCKED_GOAL, text)
        return None


def _from_end_of(run: Run | None, query: LegQuery) -> LegQuery:
    """The query that begins at the end of a run."""
    return query if run is None else replace(query, start=run.end, start_pose=run.end_pose)


def _to_begin_of(run: Run | None, query: LegQuery) -> LegQuery:
    """The query that ends at the begin of a run, with its heading."""
    if run is None:
        return query
    return replace(query, goal=run.begin, goal_pose=run.begin_pose, angle_tolerance=SLIGHT_TURN)


def _turn(outline: OutlineOnGround, spot: SurfacePoint, pose: Pose, yaw: float, least: float = SLIGHT_TURN) -> str:
    """What a turn on the spot to a heading touches, the shorter way round."""
    angle = _between(pose.yaw, yaw)
    return "" if abs(angle) <= least else outline.swept(spot, pose, Twist.planar(wz=angle), 1.0)


def _between(from_yaw: float, to_yaw: float) -> float:
    return math.remainder(to_yaw - from_yaw, 2.0 * math.pi)
