"""Cheapest path along edges on a map larger than memory: coarse over the portals of its tiles, then exact near it.

Use it on the backend ``tiles``, it is the planner there. Costs are those of ``mesh.astar`` on the whole mesh, or above
them by at most ``cost_tolerance`` where that can be proven; the message states which, see ``tiles.corridor_search``.
Blocked is what the map's cost profile calls so, or what sensors have seen. A path over via points is planned on the
map as it is at one moment, so its legs agree. Paths follow edges: see ``mesh.dijkstra``.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import ClassVar

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.goals.arrival_tolerance import ends_beside, not_even_beside
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.maps.map_plugin import MapContext, MapPlugin
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult
from mbf_mesh_nav.arrays import FlagArray
from mbf_mesh_nav.map.ground import heights_text
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.mesh.surface_point import describe_blockage, nearest_corner
from mbf_mesh_nav.mesh.topology import group_of_each
from mbf_mesh_nav.search.leg_search import Leg, path_of_legs
from mbf_mesh_nav.search.surface_planner import failure_of_leg, named_poses
from mbf_mesh_nav.tiles.places import TilePlace
from mbf_mesh_nav.tiles.planning import SURFACE_DISTANCE, TOLERANCE, place_on_tiles, plan_between
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED
from mbf_mesh_nav.tiles.serving.corridor_field import CorridorField
from mbf_mesh_nav.tiles.serving.moment import Moment
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.questions import SEARCHED
from mbf_mesh_nav.tiles.tiled_plan import TiledPlan

AT_VERTEX = 1e-6
"""How far [m] a vertex may be from itself on the surface: rounding."""

STAYING = (GetPathOutcome.NO_PATH_FOUND, GetPathOutcome.BLOCKED_START, GetPathOutcome.BLOCKED_GOAL)
"""Outcomes that planning again cannot change where no sensor has a part in them."""
STORED = "so it is without what sensors see"


class HierarchicalParameters(PluginParameters):
    """Parameters of ``tiles.hierarchical``."""

    cost_tolerance: float = parameter(
        TOLERANCE, "Share by which the cost may be above the cheapest; 0 = exact, if the memory allows it.", ge=0.0
    )
    max_surface_distance: float = parameter(
        SURFACE_DISTANCE,
        "A start, via point or goal farther than this above or below the surface, or past a border, is out of the map.",
        unit="m",
        gt=0.0,
    )
    repair: bool = parameter(
        False,
        "Keep the distances to the last goal and repair them where sensed costs have changed: for plans at a rate to "
        "one goal without via points. The first plan takes longer; of the memory a loaded vertex takes 8 bytes more.",
    )


class HierarchicalPlanner(MapPlugin, AbstractPlanner):
    """Plans over portals, then along edges."""

    Parameters: ClassVar[type[PluginParameters]] = HierarchicalParameters
    map_type = TiledNavigationMap
    parameters: HierarchicalParameters

    def __init__(self, context: MapContext[TiledNavigationMap]) -> None:
        super().__init__(context)
        self._map = context.navigation_map
        self._tiled = context.navigation_map.tiled
        self._last: CorridorField | None = None
        if self.parameters.repair:
            with self._map.turn_to_search():
                self._last = CorridorField(self._tiled)

    def parameters_changed(self) -> None:
        """Without ``repair`` no distances are kept; their share of the memory stays reserved."""
        if self._last is not None and not self.parameters.repair:
            self._last.forget()

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan from start over the via points to the goal; see ``AbstractPlanner``. A damaged tile is a MAP_ERROR."""
        try:
            with self._map.turn_to_search(request.cancel_token.flag) as moment:
                if moment is None:
                    return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
                result = self._planned(request, moment, self.parameters.repair)
                return self._judged(result, request, moment)
        except MeshError as error:
            return PlanResult(GetPathOutcome.MAP_ERROR, str(error))

    def _judged(self, result: PlanResult, request: PlanRequest, moment: Moment) -> PlanResult:
        """A result; a failure that the stored map alone gives, too, is permanent: no sensor opens what is stored."""
        stays = result.outcome in STAYING and not result.permanent
        if not stays or not self._map.senses or request.cancel_token.cancelled:
            return result
        self._tiled.lay_over(NOTHING_SENSED)
        try:
            stored = self._planned(request, self._map.moment(sensed=False), keeps=False)
        finally:
            self._tiled.lay_over(moment.sensed)
        if stored.outcome not in STAYING:
            return result
        return replace(result, message=f"{result.message}; {STORED}", permanent=True)

    def _planned(self, request: PlanRequest, moment: Moment, keeps: bool) -> PlanResult:
        # 1. Where on the surface is everything? A tolerance helps with a problem of the goal only.
        places, problem = self._locate(request, moment)
        if problem is not None and (len(places) <= len(request.via) or request.dist_tolerance <= 0.0):
            return problem

        # 2. Plan leg by leg; the last one may end near the goal instead of at it.
        plans: list[TiledPlan] = []
        flag = request.cancel_token.flag
        is_kept = keeps and len(places) == 2
        for first, last in itertools.pairwise(places):
            plan = self._plan(first, last, flag, is_kept)
            if plan.outcome != GetPathOutcome.SUCCESS:
                problem = failure_of_leg(self._failed(plan), len(plans), request)
                break
            plans.append(plan)
        near_goal = problem is not None and len(plans) == len(request.via) and request.dist_tolerance > 0.0
        if near_goal and not request.cancel_token.cancelled:
            near = self._near_goal(places[len(plans)], request, moment)
            plans, problem = ([*plans, near], None) if near is not None else (plans, self._limited(problem, request))

        # 3. One path of all legs, ending with the requested pose.
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        if problem is not None:
            within = min(request.dist_tolerance, self._searched)
            return not_even_beside(problem, within) if near_goal else problem
        legs = [Leg(plan.positions, plan.normals, plan.cost) for plan in plans]
        path = path_of_legs(legs, request.goal, not near_goal, self._map.frame_id, self.clock.now())
        notes = [plan.message for plan in plans]
        if near_goal:
            notes.append(ends_beside(path[-1].distance_to(request.goal), request.dist_tolerance))
        return PlanResult(GetPathOutcome.SUCCESS, "; ".join(notes), path, sum(leg.cost for leg in legs))

    @property
    def _searched(self) -> float:
        """How far [m] from a goal a place with a path is looked for at most."""
        return SEARCHED * self._tiled.index.spacing

    def _locate(self, request: PlanRequest, moment: Moment) -> tuple[list[TilePlace], PlanResult | None]:
        """Places of start, via points and goal, in order, up to the first that has a problem; the problem."""
        places: list[TilePlace] = []
        for name, pose in named_poses(request):
            place = place_on_tiles(self._tiled, name, pose.position, self.parameters.max_surface_distance)
            if isinstance(place, TiledPlan):
                problem = PlanResult(place.outcome, self._explained(place, name, pose, moment))
                return places, self._as_permanent(problem)
            places.append(place)
        return places, None

    def _explained(self, problem: TiledPlan, name: str, pose: Pose, moment: Moment) -> str:
        """The message of a pose that is blocked or not on the surface, with its layers or the heights there."""
        if problem.outcome == GetPathOutcome.OUT_OF_MAP:
            return f"{problem.message}; {heights_text(self._map.ground_heights(pose.x, pose.y))}"
        reach, limit = self.parameters.max_surface_distance, self._tiled.profile.cost_limit
        found = moment.around(pose.x, pose.y, min(reach, self._map.reach))
        if found is None:
            return problem.message
        there, snapshot = found
        point = on_surface(there.topology, there.locator, pose.position, reach)
        if point is None:
            return problem.message
        reason = describe_blockage(there, snapshot, nearest_corner(there, point), limit)
        text = f"the {name} {position_text(pose.position)} is blocked: {reason}"
        return f"{text}; {getting_free(self._map, pose)}" if name == "start" else text

    def _plan(self, first: TilePlace, last: TilePlace, flag: FlagArray, is_kept: bool = False) -> TiledPlan:
        """Plan a leg, by repair of the last plan if that is kept."""
        tolerance = self.parameters.cost_tolerance
        if is_kept:
            self._last = self._last or CorridorField(self._tiled)
            return self._last.plan(first, last, tolerance, flag)
        return plan_between(self._tiled, first, last, tolerance=tolerance, cancel_flag=flag)

    def _failed(self, plan: TiledPlan) -> PlanResult:
        """Of a plan that failed; on a map that no sensor changes, planning again does not help."""
        return self._as_permanent(PlanResult(plan.outcome, plan.message))

    def _as_permanent(self, problem: PlanResult) -> PlanResult:
        """A failure that stays on a map that no sensor changes: no way, or a goal that is blocked."""
        stays = problem.outcome in STAYING and not self._map.senses
        return replace(problem, permanent=problem.permanent or stays)

    def _limited(self, problem: PlanResult | None, request: PlanRequest) -> PlanResult | None:
        """A problem for which no place near the goal helps, with the limit of the tolerance if that was the cause."""
        if problem is None or request.dist_tolerance <= self._searched:
            return problem
        limit = f"a goal's tolerance counts up to {self._searched:.4g} m on this map of tiles"
        return replace(problem, message=f"{problem.message}; {limit}")

    def _near_goal(self, start: TilePlace, request: PlanRequest, moment: Moment) -> TiledPlan | None:
        """Plan to the vertex with a path that is nearest to the goal, if one lies within the request's tolerance.

        It is looked for at most ``SEARCHED`` distances between vertices away.
        """
        goal, flag = request.goal, request.cancel_token.flag
        within = min(request.dist_tolerance, self._searched)
        found = moment.around(goal.x, goal.y, within)
        if found is None:
            return None
        there, snapshot = found
        # Free vertices that are connected have a path all or none: one of each group is tried.
        free = ~snapshot.blocked(self._tiled.profile.cost_limit)
        group = group_of_each(there.edges[free[there.edges].all(axis=1)], len(free))
        offsets = norm(there.vertices - np.asarray(goal.position))
        near = np.flatnonzero(free & (offsets <= within))
        without_path: set[int] = set()
        for vertex in near[np.argsort(offsets[near], kind="stable")].tolist():
            if group[vertex] in without_path:
                continue
            place = self._tiled.find_place(there.vertices[vertex], AT_VERTEX)
            plan = self._plan(start, place, flag) if place is not None else None
            if plan is not None and plan.outcome == GetPathOutcome.SUCCESS:
                return plan
            if flag[0] != 0:
                return None
            without_path.add(int(group[vertex]))
        return None
