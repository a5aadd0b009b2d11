"""Hybrid A*: paths a car-like robot can drive, with its turning radius, its heading at the goal, and reversing.

When to use: Ackermann robots, and long robots that do not fit everywhere at every heading. When not: robots that turn
in place; ``costmap.astar`` or ``costmap.theta_star`` are 10 to 100 times faster and give shorter paths.
Known failure: like every search with bins it can miss a passage hardly wider than the robot; ``max_states`` bounds the
time until it reports failure.

Formula: Dolgov et al. 2010, curves after Dubins and after Reeds and Shepp; see ``kernels.car.hybrid_astar`` and
``kernels.car.curves``. The footprint is checked all along the path, whose poses are at most a cell apart. The goal
tolerance applies where the robot does not fit at the goal or cannot get there: the path then ends at the nearest place
within it that can be reached at the goal's heading (exactly, or within half a bin of the search).
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.arrival_tolerance import ends_beside, not_even_beside
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_costmap_nav.kernels.car.hybrid_astar import GAVE_UP
from mbf_costmap_nav.kernels.car.joints import HEADINGS
from mbf_costmap_nav.kernels.map.path_poses import yaw_quaternions
from mbf_costmap_nav.kernels.search.grid_search import FOUND
from mbf_costmap_nav.planning.car_search import LEAST_STATES, STATES_PER_CELL, CarLeg, Driving, search_plan
from mbf_costmap_nav.planning.car_world import CarWorkspace, CarWorld
from mbf_costmap_nav.planning.grid_planning import check_tolerance, marked_if_never_fits, marked_if_permanent, off_map
from mbf_costmap_nav.planning.path_assembly import heights_along
from mbf_costmap_nav.planning.permanent_walls import is_in_walls, is_permanently_too_narrow, touches_walls
from mbf_costmap_nav.plugins import CostmapContext, CostmapPlanner

FloatArray = NDArray[np.float64]

DEFAULT_RADIUS = 0.5
"""Radius [m] of the tightest curve where neither the parameters nor the robot give one."""

OVER_BORDER = "part of its outline would be off the map"


class HybridAStarParameters(PluginParameters):
    """Parameters of ``costmap.hybrid_astar``."""

    min_turning_radius: float | None = parameter(
        None,
        "Radius of the tightest curve; absent = the robot's, or 0.5 m where that turns on the spot.",
        unit="m",
        gt=0.0,
        le=100.0,
    )
    allow_reversing: bool = parameter(True, "Reeds-Shepp curves; otherwise Dubins curves, forward only.")
    allow_unknown: bool = parameter(True, "Plan through unknown cells, counted like cost 252.")
    cost_factor: float = parameter(2.0, "Relative extra length of a path through cells of cost 252.", ge=0.0, le=1000.0)
    reverse_penalty: float = parameter(2.0, "Factor on the length driven backward.", ge=1.0, le=100.0)
    change_penalty: float = parameter(0.3, "Cost of a change of direction.", unit="m", ge=0.0, le=100.0)
    turning_penalty: float = parameter(1.05, "Factor on the length of curves.", ge=1.0, le=100.0)
    max_states: int | None = parameter(
        None,
        "Give up after so many states, of some 100 bytes and 3 microseconds each; absent = 600,000, or 800 for each "
        "cell of a long way.",
        ge=100,
        le=100_000_000,
    )


class HybridAStarPlanner(CostmapPlanner):
    """Kinematic planner for car-like robots."""

    Parameters: ClassVar[type[PluginParameters]] = HybridAStarParameters
    parameters: HybridAStarParameters

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._workspace = CarWorkspace()

    @property
    def turning_radius(self) -> float:
        """Radius [m] of the tightest curve: as configured, or the robot's."""
        given = self.parameters.min_turning_radius
        return (self.min_turning_radius or DEFAULT_RADIUS) if given is None else given

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan from the start over the via poses to the goal, each with its heading."""
        check_tolerance(request.dist_tolerance)
        world = self._world(request)
        legs: list[CarLeg] = []
        failure = self._misfit(world, "start", request.start)
        if failure is not None and failure.outcome == GetPathOutcome.BLOCKED_START:
            failure = self._blocked_start(failure, world, request.start)
        for number, (start, goal) in enumerate(pairwise((request.start, *request.via, request.goal))):
            is_last = number == len(request.via)
            tolerance = request.dist_tolerance if is_last else 0.0
            name = "goal" if is_last else f"via pose {number + 1}"
            failure = failure or self._misfit(world, name, goal, tolerance)
            leg = None if failure or request.cancel_token.cancelled else self._search(world, start, goal, tolerance)
            if request.cancel_token.cancelled:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            if leg is None or len(leg.poses) == 0:
                failure = failure or not_even_beside(self._no_path(world, start, goal, leg, name, tolerance), tolerance)
                failure = self._marked_at_border(failure, world, goal, tolerance)
                if not failure.permanent:
                    failure = marked_if_permanent(failure, self.costmap, start, goal, tolerance)
                return marked_if_never_fits(failure, self.costmap, goal, tolerance, math.pi / HEADINGS)
            legs.append(leg)
        poses = np.concatenate([legs[0].poses, *(leg.poses[1:] for leg in legs[1:])])
        path = to_path(poses, heights_along(poses[:, :2], request), world.costmap.frame_id, self.clock.now())
        message = f"{len(path)} poses, {path.length:.2f} m"
        off = math.dist(poses[-1, :2], (request.goal.x, request.goal.y))
        if legs[-1].status != FOUND or off > 1e-6:
            message += f", {ends_beside(off, request.dist_tolerance)}"
        return PlanResult(GetPathOutcome.SUCCESS, message, path, sum(leg.cost for leg in legs))

    def _world(self, request: PlanRequest) -> CarWorld:
        costmap, p = self.costmap.snapshot(), self.parameters
        return CarWorld.build(
            costmap,
            self.costmap.footprint,
            request.cancel_token,
            cost_factor=p.cost_factor,
            allow_unknown=p.allow_unknown,
            workspace=self._workspace,
        )

    def _search(self, world: CarWorld, start: Pose, goal: Pose, tolerance: float) -> CarLeg | None:
        """Search to the goal or, if it is unreachable, to a reachable place within the tolerance; None without one."""
        grid, wanted = world.grid, goal
        reached, from_start = world.reached(start, goal) if world.fits(goal) else (False, world.field(start))
        if not reached:
            end = None if grid.token.cancelled else grid.nearest_reached(from_start, goal, tolerance, world.samples)
            if end is None:
                return None
            goal = Pose((*world.costmap.cell_to_world(*end), goal.z), goal.orientation, goal.frame_id, goal.stamp)
        driving = self._driving(world.cost_of_way(from_start, goal))
        return search_plan(world, driving, start, goal, wanted=wanted, tolerance=tolerance)

    def _driving(self, cost_of_way: float) -> Driving:
        """How the car drives; the cost [cells] is that of the centre's way."""
        p = self.parameters
        return Driving(
            radius=self.turning_radius,
            reversing=p.allow_reversing,
            cost_factor=p.cost_factor,
            reverse_penalty=p.reverse_penalty,
            change_penalty=p.change_penalty,
            turning_penalty=p.turning_penalty,
            max_states=p.max_states or max(LEAST_STATES, math.ceil(STATES_PER_CELL * cost_of_way)),
        )

    def _no_path(
        self, world: CarWorld, start: Pose, goal: Pose, leg: CarLeg | None, name: str, tolerance: float
    ) -> PlanResult:
        """Failure with its cause: walled off, too narrow, not to be driven by the car, or the search gave up."""
        ends = f"from ({start.x:.2f}, {start.y:.2f}) to the {name} ({goal.x:.2f}, {goal.y:.2f})"
        if leg is None and not world.fits(goal):
            text = f"the robot does not fit at the goal ({goal.x:.2f}, {goal.y:.2f}, {goal.yaw:.2f} rad)"
            return PlanResult(GetPathOutcome.BLOCKED_GOAL, text + self._closed_by(goal))
        if leg is None:
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, f"no path {ends}, not even for a point robot")
        if leg.narrow is not None:
            is_permanent = is_permanently_too_narrow(self.costmap, start, goal, tolerance)
            text = f"no path {ends}: {leg.narrow.text}"
            text += " between the walls of the static map" if is_permanent else ""
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, text, permanent=is_permanent)
        stuck = f"got no farther than ({leg.stuck[0]:.2f}, {leg.stuck[1]:.2f})"
        if leg.status == GAVE_UP:
            text = f"no path {ends} within {leg.states} states, see max_states: the robot {stuck}"
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, text)
        text = f"no drivable path {ends}, all {leg.states} states were tried: the robot {stuck}"
        return PlanResult(GetPathOutcome.NO_PATH_FOUND, text)

    def _marked_at_border(self, failure: PlanResult, world: CarWorld, goal: Pose, tolerance: float) -> PlanResult:
        """A failure; permanent where, wherever the path may end, the outline would hang over a border that stays."""
        slack = tolerance + world.costmap.resolution if tolerance > 0.0 else 0.0  # the search rounds headings
        over = world.leaves_map(goal) and world.off_map_by(goal) >= slack
        if failure.outcome != GetPathOutcome.BLOCKED_GOAL or self.costmap.rolling_window or not over:
            return failure
        text = "" if OVER_BORDER in failure.message else f"; {OVER_BORDER}"
        return replace(failure, message=failure.message + text, permanent=True)

    def _blocked_start(self, failure: PlanResult, world: CarWorld, start: Pose) -> PlanResult:
        """The failure of a start with how the robot gets away; permanent where a border or a wall that stays is met."""
        over_border = world.leaves_map(start) and not self.costmap.rolling_window
        stays = over_border or is_in_walls(self.costmap, start) or touches_walls(self.costmap, start)
        return replace(failure, message=f"{failure.message}; {getting_free(self.costmap, start)}", permanent=stays)

    def _misfit(self, world: CarWorld, name: str, pose: Pose, tolerance: float = 0.0) -> PlanResult | None:
        """Why nothing can be planned to or from a pose, if that is known without a search."""
        problem = off_map(world.costmap, pose, name, tolerance)
        if problem or tolerance > 0.0 or world.fits(pose):
            return problem
        outcome = GetPathOutcome.BLOCKED_START if name == "start" else GetPathOutcome.BLOCKED_GOAL
        text = f"the robot does not fit at the {name} ({pose.x:.2f}, {pose.y:.2f}, {pose.yaw:.2f} rad)"
        if world.leaves_map(pose):
            return PlanResult(outcome, f"{text}: {OVER_BORDER}")
        return PlanResult(
            outcome, f"{text}, centre cost {world.costmap.cost_at(pose.x, pose.y)}{self._closed_by(pose)}"
        )

    def _closed_by(self, pose: Pose) -> str:
        """The layer that makes the centre's cell lethal; empty if none does."""
        layer = self.costmap.lethal_reason(pose.x, pose.y)
        return f", lethal in layer {layer}" if layer else ""


def to_path(poses: FloatArray, heights: FloatArray, frame_id: str, stamp: float) -> Path:
    """Path of poses (n, 3: x, y, yaw) at heights (n,); in reverse, headings point against the motion."""
    orientations = yaw_quaternions(np.ascontiguousarray(poses[:, 2]))
    return Path(np.column_stack([poses[:, :2], heights]), orientations, frame_id, stamp)
