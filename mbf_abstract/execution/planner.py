"""Runs a planner under patience and retries (reference: ``mbf.md`` 4.2 and 4.3).

=========  ==========  ==============================================================================
retries    patience    behaviour
=========  ==========  ==============================================================================
0          any         one call; the plugin's own code, or PAT_EXCEEDED if that call outlasted patience
n > 0      0           n + 1 calls; the plugin's code of the last one
n > 0      > 0         whichever comes first, retries tested first
-1         > 0         until patience, then PAT_EXCEEDED; the plugin's last code stays in the result
-1         0           forever, until canceled
=========  ==========  ==============================================================================

A permanent failure (OUT_OF_MAP, INVALID_START, INVALID_GOAL, or any that the planner marks as such) ends the goal at
once, with the planner's own code. A success that comes after the patience but before the grace is over still counts.
Between two calls there is a pause of ``planner_retry_delay``, so that a planner that fails at once does not keep a core
busy.

A goal whose planner has a *fallback* does not call it again after one of ``FALLBACK_OUTCOMES``: the retries are the
fallback's then. After other failures, which the fallback is not called for, the retries are its own. Where others may
leave (``actions.get_path``), none of these outcomes is followed by a call in the second half of the patience.
"""

from __future__ import annotations

import math
from enum import Enum
from functools import partial

from mbf_abstract.execution.plugin_answer import PluginFault
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.goals.goal_area import GoalArea, plan_to_area
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult

FALLBACK_OUTCOMES = (GetPathOutcome.NO_PATH_FOUND, GetPathOutcome.BLOCKED_START, GetPathOutcome.BLOCKED_GOAL)
"""What another planner may know better; one with other limits, or one that can do more."""


class PlannerState(Enum):
    """Where a planner execution is; the last six are its ends."""

    INITIALIZED = "initialized"
    STARTED = "started"
    PLANNING = "planning"
    FOUND_PLAN = "found_plan"
    MAX_RETRIES = "max_retries"
    PAT_EXCEEDED = "pat_exceeded"
    NO_PLAN_FOUND = "no_plan_found"
    CANCELED = "canceled"
    INTERNAL_ERROR = "internal_error"


class PlannerExecution:
    """One get_path goal's calls of its planner.

    Parameters
    ----------
    retry_time : float
        Part of the patience [s] after which the planner is not called again when it has found no path: something else
        is tried then. 0 = it is called once.

    Attributes
    ----------
    state : PlannerState
    last_result : PlanResult, optional
        The planner's last answer; None if it was never asked.
    """

    def __init__(
        self,
        run: PluginRun[AbstractPlanner],
        request: PlanRequest,
        area: GoalArea | None = None,
        retry_time: float = math.inf,
        max_retries: int | None = None,
    ) -> None:
        self._run = run
        self._max_retries = max_retries
        self._retry_time = retry_time
        self._runtime = run.runtime
        self._request = request
        self._area = area
        self.state = PlannerState.INITIALIZED
        self.last_result: PlanResult | None = None

    def execute(self) -> PlanResult:
        """Call the planner until it succeeds or the rules end it; its own last answer, or CANCELED, PAT_EXCEEDED."""
        self._enter(PlannerState.STARTED)
        if not self._run.acquire_plugin():
            return self._canceled() if self._run.canceled else self._patience_end(self._run.waited)
        calls = 0
        while True:
            if self._run.canceled:
                return self._canceled()
            if calls and self._run.is_patience_over():
                return self._patience_end()
            self._enter(PlannerState.PLANNING)
            try:
                self.last_result = result = self._call()
            except PluginFault as fault:
                self.last_result = result = PlanResult(GetPathOutcome.INTERNAL_ERROR, str(fault))
                return self._end(PlannerState.INTERNAL_ERROR, result)
            calls += 1
            end = self._judge(result, calls)
            if end is not None:
                return end
            self._runtime.clock.sleep(self._runtime.parameters.planner_retry_delay)

    def _judge(self, result: PlanResult, calls: int) -> PlanResult | None:
        """What this answer ends the execution with, in upstream's order; None = call again."""
        falls_back = self._run.patience_watch.elapsed >= self._retry_time and result.outcome in FALLBACK_OUTCOMES
        usual = self._runtime.parameters.planner_max_retries
        max_retries = 0 if falls_back else usual if self._max_retries is None else self._max_retries
        if self._run.canceled and not self._run.patience_exceeded:
            return self._canceled()
        if result.success:
            return self._end(PlannerState.FOUND_PLAN, result)
        if result.permanent:
            return self._end(PlannerState.NO_PLAN_FOUND, result)
        if 0 < max_retries < calls:
            return self._end(PlannerState.MAX_RETRIES, result)
        if self._run.is_patience_over():
            return self._patience_end()
        return self._end(PlannerState.NO_PLAN_FOUND, result) if max_retries == 0 else None

    def _call(self) -> PlanResult:
        make_plan = self._run.plugin.instance.make_plan
        plan = partial(make_plan, self._request)
        if self._area is not None:
            plan = partial(plan_to_area, make_plan, self._request, self._area)
        return self._run.ask_reported("make_plan", plan, PlanResult)

    def _canceled(self) -> PlanResult:
        return self._end(PlannerState.CANCELED, PlanResult(GetPathOutcome.CANCELED, self._run.handle.cancel_reason))

    def _patience_end(self, waited: str = "") -> PlanResult:
        last = self.last_result.message if self.last_result is not None else ""
        tail = f"; last message of the planner: {last}" if last else ""
        text = waited or f"no plan within {self._run.patience:g} s{tail}"
        return self._end(PlannerState.PAT_EXCEEDED, PlanResult(GetPathOutcome.PAT_EXCEEDED, text))

    def _end(self, state: PlannerState, result: PlanResult) -> PlanResult:
        self._enter(state)
        return result

    def _enter(self, state: PlannerState) -> None:
        if state is not self.state:
            self._run.report_state("planner_execution", self.state.value, state.value)
            self.state = state
