"""The contract of planners."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult
from mbf_abstract.testing.contract.report import Report
from mbf_abstract.testing.contract.rig import (
    CANCEL_MOMENTS,
    SHORTEST_CANCELED_RUN,
    ContextMaker,
    cancel_latency,
    canceled_token,
    expect_idle_cancel_is_harmless,
    rig,
    same_context,
)
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.time.clock import wall_seconds

Problem = tuple[Pose, Pose]
_SPAN = range(50, 100)


def check_planner(
    planner_class: type[AbstractPlanner],
    problems: Sequence[Problem],
    *,
    make_context: ContextMaker = same_context,
    parameters: PluginParameters | None = None,
    unreachable: Sequence[Problem] = (),
    watched: Sequence[NDArray[Any]] = (),
    end_tolerance: float = 0.5,
    cancel_within: float = 0.1,
) -> None:
    """Check a planner against the contract.

    Parameters
    ----------
    problems : sequence of (start, goal)
        Questions that have an answer; make one of them take a while.
    make_context : callable
        Adds the map to the context that the check makes.
    parameters : PluginParameters, optional
        The class's defaults if not given.
    unreachable : sequence of (start, goal)
        Questions without an answer.
    watched : sequence of arrays
        Arrays of the map, which must not change.
    end_tolerance : float
        How far [m] the ends of a path may lie from start and goal.
    cancel_within : float
        Longest wall time [s] from a cancel to the return.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    """
    check = _PlannerCheck(planner_class, make_context, parameters, Report(planner_class, watched))
    with check.report.no_exception("construction"):
        for start, goal in problems:
            duration = check.reachable(start, goal, end_tolerance)
            check.cancel(start, goal, duration, cancel_within)
        for start, goal in unreachable:
            check.unreachable(start, goal)
        if problems:
            check.start_is_goal(problems[0][0])
            check.there_and_back(*problems[0], end_tolerance)
            check.idle_cancel(*problems[0])
    check.report.finish()


class _PlannerCheck:
    """Runs one planner class; every situation gets a fresh instance."""

    def __init__(
        self,
        planner_class: type[AbstractPlanner],
        make_context: ContextMaker,
        parameters: PluginParameters | None,
        report: Report,
    ) -> None:
        self.planner_class = planner_class
        self.make_context = make_context
        self.parameters = parameters
        self.report = report

    def reachable(self, start: Pose, goal: Pose, end_tolerance: float) -> float:
        """Plan with two instances of one seed; return the wall time [s] of the second, warm call."""
        situation, results, duration = f"from {_short(start)} to {_short(goal)}", [], 0.0
        for _ in range(2):
            with self._fresh(start) as planner:
                before = wall_seconds()
                result = self._plan(planner, situation, start, goal)
                duration = wall_seconds() - before
            if result is not None:
                results.append(result)
                self._expect_good_path(situation, result, start, goal, end_tolerance)
        if len(results) == 2:
            same = _equal(_arrays(results[0]), _arrays(results[1]))
            self.report.expect(same, f"{situation}: two instances with the same seed gave different answers")
        return duration

    def unreachable(self, start: Pose, goal: Pose) -> None:
        """Expect a failure with a message."""
        situation = f"unreachable, from {_short(start)} to {_short(goal)}"
        with self._fresh(start) as planner:
            result = self._plan(planner, situation, start, goal)
        if result is not None:
            self.report.expect(not result.success, f"{situation}: claimed success")

    def start_is_goal(self, pose: Pose) -> None:
        """Expect a legal answer, and a path that stays where it is if it is a success."""
        situation = f"start is goal at {_short(pose)}"
        with self._fresh(pose) as planner:
            result = self._plan(planner, situation, pose, pose)
        if result is not None and result.success and result.path is not None:
            far = result.path.length > 1.0
            self.report.expect(not far, f"{situation}: the path is {result.path.length:.2f} m long")

    def there_and_back(self, start: Pose, goal: Pose, tolerance: float) -> None:
        """Ask for a path back to the start by a via pose: a path that ignores the pose must not be a success."""
        situation = f"from {_short(start)} via {_short(goal)} and back"
        request = PlanRequest(start, start, via=(goal,))
        with self._fresh(start) as planner:
            result = self.report.call(situation, lambda: planner.make_plan(request), PlanResult, GetPathOutcome, _SPAN)
        if result is not None and result.success and result.path is not None:
            gap = float(np.linalg.norm(result.path.positions - np.array(goal.position), axis=1).min())
            self.report.expect(gap <= tolerance, f"{situation}: the path passes the via pose at {gap:.2f} m")

    def cancel(self, start: Pose, goal: Pose, duration: float, within: float) -> None:
        """Cancel before and, if the call is long enough, during the work."""
        situation = f"canceled before, from {_short(start)} to {_short(goal)}"
        with self._fresh(start) as planner:
            result = self._plan(planner, situation, start, goal, canceled_token())
            if result is not None:
                text = f"{situation}: outcome {result.outcome}, expected CANCELED (51)"
                self.report.expect(result.outcome == GetPathOutcome.CANCELED, text)
            for moment in CANCEL_MOMENTS if duration >= SHORTEST_CANCELED_RUN else ():
                latency, _ = cancel_latency(
                    lambda token: self._plan(planner, "canceled while planning", start, goal, token), moment * duration
                )
                text = f"canceled while planning: returned {latency:.3f} s later, limit {within:g} s"
                self.report.expect(latency <= within, text)
            after = self._plan(planner, "after a cancel", start, goal)
            self.report.expect(after is None or after.success, "after a cancel: the next plan failed")

    def idle_cancel(self, start: Pose, goal: Pose) -> None:
        """Expect that ``cancel`` while nothing runs changes nothing."""
        with self._fresh(start) as planner:
            expect_idle_cancel_is_harmless(self.report, planner)
            result = self._plan(planner, "after an idle cancel", start, goal)
            self.report.expect(result is None or result.success, "after an idle cancel: the next plan failed")

    @contextmanager
    def _fresh(self, start: Pose) -> Iterator[AbstractPlanner]:
        with rig(self.planner_class, self.make_context, self.parameters, start) as made:
            yield made.plugin

    def _plan(
        self, planner: AbstractPlanner, situation: str, start: Pose, goal: Pose, token: CancelToken | None = None
    ) -> PlanResult | None:
        request = PlanRequest(start, goal, cancel_token=token or CancelToken())
        return self.report.call(situation, lambda: planner.make_plan(request), PlanResult, GetPathOutcome, _SPAN)

    def _expect_good_path(self, situation: str, result: PlanResult, start: Pose, goal: Pose, tolerance: float) -> None:
        if not result.success or result.path is None or len(result.path) == 0:
            text = f"{situation}: no path ({result.outcome}: {result.message})"
            self.report.expect(False, text)
            return
        path = result.path
        self.report.expect(path.frame_id == start.frame_id, f"{situation}: path in frame {path.frame_id!r}")
        for name, gap in (("start", path[0].distance_to(start)), ("goal", path[-1].distance_to(goal))):
            self.report.expect(gap <= tolerance, f"{situation}: the path is {gap:.2f} m from the {name}")
        good_cost = math.isfinite(result.cost) and result.cost >= 0.0
        self.report.expect(good_cost, f"{situation}: cost {result.cost}")


def _arrays(result: PlanResult) -> tuple[NDArray[np.float64], ...]:
    if result.path is None:
        return (np.array([float(result.outcome)]),)
    return (result.path.positions, np.asarray(result.path.orientations), np.array([result.cost]))


def _equal(a: tuple[NDArray[np.float64], ...], b: tuple[NDArray[np.float64], ...]) -> bool:
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def _short(pose: Pose) -> str:
    return f"({pose.x:g}, {pose.y:g}, {pose.z:g})"
