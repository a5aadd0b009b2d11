"""The ``get_path`` action: from a start and a target pose to a path in the global frame.

Steps of one goal: check names and frames - start pose - map kept alive, and seen again where it was cleared - plugin
under patience and retries, and the ``fallback_planner`` where that finds no path - the path is checked and
transformed - result. The robot never moves.

A robot that finds no path, and hears of others that may leave, plans once more on the map without them. It announces
that path as its wish (``mbf_abstract.traffic``), so that they can meet; the result has none. Retries end with half of
the patience then. The wish has what is left of it, at least the other half, so both take one and a half at most.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from mbf_abstract.actions.action import GoalJob
from mbf_abstract.actions.meetings import those_that_leave
from mbf_abstract.actions.plugin_action import PluginAction
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.plan_check import area_in_global_frame, in_global_frame, path_result
from mbf_abstract.execution.planner import FALLBACK_OUTCOMES, PlannerExecution
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.arrival_tolerance import plan_tolerance_problem
from mbf_abstract.goals.feedback_types import NoFeedback
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PluginKind
from mbf_abstract.traffic.announcement import Announcement

BESIDE_BODY = 0.1
"""The sensed body of another robot lies at most this far [m] outside of the one that it announces."""

WISH_SHARE = 0.5
"""Of the patience, for the plan of a wish, at least."""

SCAN_CHECK = 0.05  # s; how often a plan that waits for a scan looks for it

Handle = GoalHandle[GetPathGoal, GetPathResult, NoFeedback]
Job = GoalJob[GetPathGoal, GetPathResult, NoFeedback]


class GetPathAction(PluginAction[GetPathGoal, GetPathResult, NoFeedback, AbstractPlanner]):
    """Plans paths."""

    name = "get_path"
    kind = PluginKind.PLANNER
    canceled_outcome = GetPathOutcome.CANCELED
    patience_outcome = GetPathOutcome.PAT_EXCEEDED
    invalid_plugin_outcome = GetPathOutcome.INVALID_PLUGIN
    internal_error_outcome = GetPathOutcome.INTERNAL_ERROR

    @property
    def patience(self) -> float:
        """Time [s] for all calls of the planner together."""
        return self.runtime.parameters.planner_patience

    def _plugin_name(self, goal: GetPathGoal) -> str:
        return goal.planner

    def _problem(self, goal: GetPathGoal) -> tuple[int, str] | None:
        """1. Accept only what can be answered: sane tolerances."""
        problem = plan_tolerance_problem(*self._tolerances(goal))
        return (GetPathOutcome.INVALID_GOAL, problem) if problem else None

    def execute(self, job: Job) -> GetPathResult:
        """2. to 4.: from the accepted goal to its result, on the slot's thread."""
        handle, plugin = job.handle, self._plugin(job)
        # 2. Everything the planner sees is in the global frame.
        try:
            request = self._request(handle)
            area = area_in_global_frame(handle.goal.goal_area, self.runtime)
        except (TransformError, RobotStateError) as error:
            return GetPathResult(GetPathOutcome.TF_ERROR, str(error), planner=plugin.name)
        job.report_started(plugin=plugin.name)
        began = self.runtime.clock.now()
        result = self._best_plan(job, plugin, request, area)
        # 5. A robot that finds no path from where it is asks others to leave it one.
        if handle.goal.start_pose is None:
            self._announce_wish(job, result, request, area, self.runtime.clock.now() - began)
        return result

    def _best_plan(
        self, job: Job, plugin: LoadedPlugin[AbstractPlanner], request: PlanRequest, area: GoalArea | None
    ) -> GetPathResult:
        """3. Plan; where there is no path for this planner there may be one for the other."""
        fallback = self._fallback_of(plugin)
        first = self._plan(job, plugin, request, area, 0.0 if fallback else self._retry_time(job))
        if not fallback or first.is_final or first.outcome not in FALLBACK_OUTCOMES or job.handle.cancel_requested:
            return first
        if problem := self._plugins.problem(self.kind, fallback):
            return replace(first, message=f"{first.message}; fallback_planner: {problem}")
        second = self._plan(job, self._plugins.get(self.kind, fallback), request, area, self._retry_time(job))
        return replace(second, message=f"{fallback}: {second.message}; before, {plugin.name}: {first.message}")

    def _fallback_of(self, plugin: LoadedPlugin[AbstractPlanner]) -> str:
        """Name of the planner that stands in for this one where that finds no path; empty = none."""
        name = self.runtime.parameters.fallback_planner
        return "" if name == plugin.name else name

    def _retry_time(self, job: Job) -> float:
        """Part of the patience [s] for retries: all of it, unless a wish may follow."""
        shares = self.patience > 0.0 and job.handle.goal.start_pose is None and those_that_leave(self.runtime)
        return (1.0 - WISH_SHARE) * self.patience if shares else math.inf

    def _plan(
        self,
        job: Job,
        plugin: LoadedPlugin[AbstractPlanner],
        request: PlanRequest,
        area: GoalArea | None,
        retry_time: float,
    ) -> GetPathResult:
        """Plan with the map kept alive, under patience and retries, and judge how it ended."""
        handle, run = job.handle, self._supervise(job, plugin)
        with run, run.map_in_use():
            if missing := run.call_beside("the map's missing_floor()", self.runtime.map_hooks.missing_floor):
                # permanent: no recovery brings a map
                return GetPathResult(GetPathOutcome.MAP_ERROR, missing, planner=plugin.name, permanent=True)
            self._await_scans(run)
            execution = PlannerExecution(run, request, area, retry_time, handle.goal.max_retries)
            end = execution.execute()
            # 4. Check the path of a plugin that reports success.
            judge = partial(path_result, end, execution.last_result, request, self.runtime, plugin.name, area)
            result = run.call_beside("the map's path_problem()", judge)
        if result.path is not None:
            numbers = {"cost": result.cost, "length": result.path.length, "poses": len(result.path)}
            self.runtime.events.emit(EventKind.PLAN, self.name, goal_id=handle.id, plugin=plugin.name, **numbers)
        return result

    def _await_scans(self, run: PluginRun[AbstractPlanner]) -> None:
        """Wait until a cleared map has seen again what stands there; not on a cancel, nor for a silent sensor."""
        while not run.canceled and run.call_beside("the map's awaits_scan()", self.runtime.map_hooks.awaits_scan):
            self.runtime.clock.sleep(SCAN_CHECK)
            run.patience_watch.restart()  # patience is with the planner

    def _announce_wish(
        self, job: Job, result: GetPathResult, request: PlanRequest, area: GoalArea | None, planned_for: float
    ) -> None:
        """Announce the path that there would be without the robots that may leave; none, if this is of no use.

        ``planned_for``: how long [s] the planner has taken with the robots.
        """
        runtime = self.runtime
        if runtime.gate.holder:  # one that drives announces the path that it follows
            return
        others = those_that_leave(runtime) if result.plugin_outcome in FALLBACK_OUTCOMES and not result.is_final else ()
        wish = self._plan_without(others, job, result.planner, request, area, planned_for) if others else None
        if wish is not None:
            text = f"there would be a path of {wish.length:.2f} m without {', '.join(one.name for one in others)}"
            runtime.events.emit(EventKind.CUSTOM, self.name, goal_id=job.handle.id, message=text)
        runtime.traffic.wish(wish)

    def _plan_without(
        self,
        others: Sequence[Announcement],
        job: Job,
        planner: str,
        request: PlanRequest,
        area: GoalArea | None,
        planned_for: float,
    ) -> Path | None:
        """The path that a planner finds while the map does not know of some robots; None if there is none."""
        frame, hooks = self.runtime.parameters.global_frame, self.runtime.map_hooks
        places = [
            (Pose.planar(x, y, z=z, frame_id=frame), 2.0 * (one.radius + BESIDE_BODY))
            for one in others
            for x, y, z in [one.path[0].tolist()]
        ]

        def patience_left() -> float:
            return max(self.patience - planned_for, WISH_SHARE * self.patience)

        run = self._supervise(job, self._plugins.get(self.kind, planner), patience=patience_left)
        with run, run.map_in_use():
            run.call_beside("the map's forget()", partial(hooks.forget, places))
            execution = PlannerExecution(run, request, area, max_retries=0)
            judge = partial(path_result, execution.execute(), None, request, self.runtime, planner, area)
            return run.call_beside("the map's path_problem()", judge).path

    def _request(self, handle: Handle) -> PlanRequest:
        def to_global(pose: Pose) -> Pose:
            return in_global_frame(pose, self.runtime)

        goal = handle.goal
        relaxed = self.runtime.relaxation.slack(self.runtime.clock.now()).plan_distance
        distance, angle = self._tolerances(goal)
        return PlanRequest(
            start=to_global(goal.start_pose) if goal.start_pose else self.runtime.robot.pose(),
            goal=to_global(goal.target_pose),
            dist_tolerance=max(distance, relaxed),
            angle_tolerance=angle,
            via=tuple(to_global(pose) for pose in goal.via),
            cancel_token=handle.cancel_token,
        )

    def _tolerances(self, goal: GetPathGoal) -> tuple[float, float]:
        """Distance [m] and angle [rad] from the target at which the path may end: the goal's, else the server's."""
        parameters = self.runtime.parameters
        usual = (parameters.dist_tolerance, parameters.angle_tolerance) if goal.goal_area is None else (0.0, 0.0)
        distance = usual[0] if goal.dist_tolerance is None else goal.dist_tolerance
        return distance, usual[1] if goal.angle_tolerance is None else goal.angle_tolerance

    def make_result(self, handle: Handle, outcome: int, message: str) -> GetPathResult:
        """Result without a path."""
        return GetPathResult(int(outcome), message)

    def _goal_data(self, goal: GetPathGoal) -> dict[str, Any]:
        return {"target": list(goal.target_pose.position), "planner": goal.planner}
