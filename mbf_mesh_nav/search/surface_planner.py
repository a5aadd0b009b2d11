"""What every planner on a mesh has in common: the questions around the search.

``SurfacePlanner.make_plan`` reads as numbered steps: locate start, via points and goal on the surface, refuse what is
off the map or blocked, refuse what lies in another component, plan leg by leg, fall back to a nearby goal within the
tolerance, assemble the path. A planner derives it and implements ``find_leg`` only.

A point counts as blocked when the vertex nearest to it in its face is lethal or its cost reaches ``cost_limit``.
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.goals.arrival_tolerance import ends_beside, not_even_beside
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.arrays import BoolArray, Float32Array
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.map.ground import ground_heights, heights_text
from mbf_mesh_nav.map.places import FORBIDDEN_COST
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.mesh.surface_point import describe_blockage, nearest_corner, surface_point_at_vertex
from mbf_mesh_nav.plugins import MeshContext, MeshPlanner
from mbf_mesh_nav.search.blocked_vertices import BlockedVertices
from mbf_mesh_nav.search.fitting.outline_check import PADDING, OutlineCheck
from mbf_mesh_nav.search.heading_check import HeadingCheck
from mbf_mesh_nav.search.leg_search import Leg, LegQuery, path_of_legs, propagate_from
from mbf_mesh_nav.search.permanent_walls import as_permanent


class SurfacePlannerParameters(PluginParameters):
    """Parameters every planner on a mesh has."""

    cost_limit: float = parameter(1.0, "Vertices whose cost reaches this are impassable.", gt=0.0, allow_inf=True)
    max_surface_distance: float = parameter(
        0.4,
        "A start, via point or goal farther than this above or below the surface, or past a border, is out of the map.",
        unit="m",
        gt=0.0,
    )
    tilt_layer: str = parameter(
        "tilt", "Layer of type tilt, if the map has it, whose headings paths keep to; empty = they may have any."
    )


class SurfacePlanner(MeshPlanner):
    """Template of the planners on meshes; see the module's text."""

    Parameters = SurfacePlannerParameters
    parameters: SurfacePlannerParameters

    knows_headings: ClassVar[bool] = False
    """Whether the search itself keeps to the headings a tilt layer allows."""

    @property
    def avoided_share(self) -> float:
        """Its ``cost_limit`` over the cost of an obstacle."""
        return self.parameters.cost_limit / FORBIDDEN_COST

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._blocked_vertices = BlockedVertices(context.navigation_map)
        self._heading_check = HeadingCheck(context.navigation_map)
        self._outline_check = OutlineCheck(context.navigation_map)

    @abstractmethod
    def find_leg(self, query: LegQuery) -> Leg | None:
        """Return the best leg, None if there is none (or the search was cancelled)."""

    def reach(self, query: LegQuery) -> Float32Array | None:
        """Distances (V,) [m] from the query's start to every vertex with a path, inf elsewhere; None: cancelled.

        Here: along the edges of free vertices. What is finite here and no leg leads to must be inf the next time.
        """
        distances, _, finished = propagate_from(
            self.mesh_map, query.snapshot, query.blocked, query.start, query.cancel_flag
        )
        return distances if finished else None

    def find_other_leg(self, query: LegQuery) -> Leg | None:
        """As ``find_leg``, with vertices blocked that are free on the map: nothing may be remembered of it."""
        return self.find_leg(query)

    def _driveable_leg(self, query: LegQuery, is_first: bool, is_last: bool) -> Leg | PlanResult | None:
        """The best leg whose headings the tilt allows, and along which the outline fits, if it has to; or why none.

        Via points are passed with any heading.
        """
        leg, outline = self._held_leg(query), self.mesh_map.outline(PADDING)
        if leg is None or outline is None:
            return leg
        start_pose, goal_pose = query.start_pose if is_first else None, query.goal_pose if is_last else None
        asked = replace(query, start_pose=start_pose, goal_pose=goal_pose)
        return self._outline_check.leg_that_fits(asked, outline, leg, self.find_other_leg)

    def _held_leg(self, query: LegQuery) -> Leg | None:
        """The best leg whose headings the tilt allows, see ``heading_check``."""
        leg, layer = self.find_leg(query), self.mesh_map.layers.get(self.parameters.tilt_layer)
        if leg is None or self.knows_headings or not isinstance(layer, TiltLayer):
            return leg
        return self._heading_check.leg_that_holds(query, layer, leg, self.find_other_leg)

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan from start over the via points to the goal; see ``AbstractPlanner``."""
        # 1. Which vertices are free?
        snapshot = self.mesh_map.snapshot()
        blocked = self._blocked_vertices.at(snapshot, self.parameters.cost_limit)

        # 2. Where on the surface is everything? A tolerance helps with a problem of the goal only.
        stops, problem = self._locate_stops(request, snapshot, blocked)
        if problem is not None and (len(stops) <= len(request.via) or request.dist_tolerance <= 0.0):
            return as_permanent(problem, self.mesh_map, request, len(stops))

        # 3. Plan leg by leg; the last one may end near the goal instead of at it.
        legs: list[Leg] = []
        poses = (request.start, *request.via, request.goal)
        for index, (start, goal) in enumerate(itertools.pairwise(stops)):
            ends = poses[index], poses[index + 1]
            tolerance = request.angle_tolerance if index == len(request.via) else 0.0
            query = LegQuery(start, goal, snapshot, blocked, request.cancel_token.flag, *ends, tolerance)
            leg = self._driveable_leg(query, index == 0, index == len(request.via))
            if not isinstance(leg, Leg):
                problem = failure_of_leg(leg or self._no_path(start, goal, blocked), index, request)
                break
            legs.append(leg)
        near_goal = problem is not None and len(legs) == len(request.via) and request.dist_tolerance > 0.0
        if near_goal and not request.cancel_token.cancelled:
            near = self._leg_near_goal(stops[len(legs)], request, snapshot, blocked)
            legs, problem = ([*legs, near], None) if near is not None else (legs, problem)

        # 4. One path of all legs, ending with the requested pose.
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        if problem is not None:
            judged = as_permanent(problem, self.mesh_map, request, len(legs) + 1)
            return not_even_beside(judged, request.dist_tolerance) if near_goal else judged
        path = path_of_legs(legs, request.goal, not near_goal, self.mesh_map.frame_id, self.clock.now())
        notes = [leg.note for leg in legs if leg.note]
        if near_goal:
            notes.append(ends_beside(path[-1].distance_to(request.goal), request.dist_tolerance))
        return PlanResult(GetPathOutcome.SUCCESS, "; ".join(notes), path, sum(leg.cost for leg in legs))

    def _locate_stops(
        self, request: PlanRequest, snapshot: MeshSnapshot, blocked: BoolArray
    ) -> tuple[list[SurfacePoint], PlanResult | None]:
        """Start, via points and goal on the surface, in order, up to the first that has a problem; the problem."""
        stops: list[SurfacePoint] = []
        for name, pose in named_poses(request):
            point = self._locate(name, pose, snapshot, blocked)
            if isinstance(point, PlanResult):
                return stops, point
            problem = self._different_components(stops[0], point, name) if stops else None
            if problem is not None:
                return stops, problem
            stops.append(point)
        return stops, None

    def _locate(self, name: str, pose: Pose, snapshot: MeshSnapshot, blocked: BoolArray) -> SurfacePoint | PlanResult:
        """Put a pose on the surface, or return why that fails."""
        reach = self.parameters.max_surface_distance
        point = on_surface(self.mesh_map.topology, self.mesh_map.locator, pose.position, reach)
        if point is None:
            distance = self.mesh_map.locate([pose.position]).distances[0]
            where = f"the {name} {position_text(pose.position)} is {distance:.2f} m from the surface"
            if distance <= reach:
                return PlanResult(GetPathOutcome.OUT_OF_MAP, f"{where}, past its border")
            hint = heights_text(ground_heights(self.mesh_map, pose.x, pose.y))
            return PlanResult(GetPathOutcome.OUT_OF_MAP, f"{where}, allowed are {reach:g} m; {hint}")
        vertex = nearest_corner(self.mesh_map, point)
        if blocked[vertex]:
            reason = describe_blockage(self.mesh_map, snapshot, vertex, self.parameters.cost_limit)
            text = f"the {name} {position_text(pose.position)} is blocked: {reason}"
            if name != "start":
                return PlanResult(GetPathOutcome.BLOCKED_GOAL, text)
            return PlanResult(GetPathOutcome.BLOCKED_START, f"{text}; {getting_free(self.mesh_map, pose)}")
        return point

    def _different_components(self, start: SurfacePoint, stop: SurfacePoint, name: str) -> PlanResult | None:
        """NO_PATH_FOUND if two points lie on surfaces that do not touch; known without a search."""
        components = self.mesh_map.components
        home, other = (components[self.mesh_map.faces[point.face, 0]] for point in (start, stop))
        if home == other:
            return None
        sizes = [int(np.count_nonzero(components == label)) for label in (home, other)]
        message = (
            f"the start is on component {home} ({sizes[0]} vertices), the {name} {position_text(stop.point)} on "
            f"component {other} ({sizes[1]} vertices); they do not touch"
        )
        return PlanResult(GetPathOutcome.NO_PATH_FOUND, message, permanent=True)

    def _no_path(self, start: SurfacePoint, goal: SurfacePoint, blocked: BoolArray) -> PlanResult:
        component = self.mesh_map.components == self.mesh_map.components[nearest_corner(self.mesh_map, start)]
        share = float(np.mean(blocked[component]))
        message = (
            f"no free path from {position_text(start.point)} to {position_text(goal.point)}: {share:.1%} of "
            f"the surface between them is lethal or has cost >= {self.parameters.cost_limit:g}"
        )
        return PlanResult(GetPathOutcome.NO_PATH_FOUND, message)

    def _leg_near_goal(
        self, start: SurfacePoint, request: PlanRequest, snapshot: MeshSnapshot, blocked: BoolArray
    ) -> Leg | None:
        """Leg to the reachable vertex nearest to the goal, if one lies within ``dist_tolerance``."""
        mesh_map = self.mesh_map
        last_pose = (request.start, *request.via)[-1]
        ends = last_pose, request.goal, request.angle_tolerance
        query = LegQuery(start, start, snapshot, blocked, request.cancel_token.flag, *ends)
        tried = -1
        while (distances := self.reach(query)) is not None:
            offsets = norm(mesh_map.vertices - np.asarray(request.goal.position))
            offsets[~np.isfinite(distances)] = np.inf
            vertex = int(np.argmin(offsets))
            if offsets[vertex] > request.dist_tolerance or vertex == tried:
                return None
            asked = replace(query, goal=surface_point_at_vertex(mesh_map, vertex))
            leg = self._driveable_leg(asked, not request.via, True)
            if isinstance(leg, Leg):
                return leg
            tried = vertex  # a search may find out what ``reach`` did not know
        return None


def named_poses(request: PlanRequest) -> list[tuple[str, Pose]]:
    """All poses of a request with what they are called in messages."""
    via = [(f"via pose {number}", pose) for number, pose in enumerate(request.via, 1)]
    return [("start", request.start), *via, ("goal", request.goal)]


def failure_of_leg(problem: PlanResult, index: int, request: PlanRequest) -> PlanResult:
    """Return the failure of one leg of a request; that of a leg to a via pose names the pose."""
    if index == len(request.via):
        return problem
    return replace(problem, message=f"via pose {index + 1}: {problem.message}")
