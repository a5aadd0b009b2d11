"""Runs a plan refiner: like a planner, without patience but with its own retry limit."""

from __future__ import annotations

from mbf_abstract.execution.plugin_answer import PluginFault
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import AbstractRefiner, RefineResult


class RefinerExecution:
    """One refine_path goal's calls of its refiner."""

    def __init__(self, run: PluginRun[AbstractRefiner], path: Path) -> None:
        self._run = run
        self._path = path

    def execute(self) -> RefineResult:
        """Call the refiner until it succeeds or ``refiner_max_retries`` is used up (DEPLETED)."""
        if not self._run.acquire_plugin() and not self._run.canceled:
            return RefineResult(RefinePathOutcome.STOPPED, self._run.waited)
        if self._run.canceled:
            return RefineResult(RefinePathOutcome.CANCELED, "canceled while waiting for the refiner")
        calls = 0
        while True:
            try:
                result = self._call()
            except PluginFault as fault:
                return RefineResult(RefinePathOutcome.INTERNAL_ERROR, str(fault))
            calls += 1
            end = self._judge(result, calls)
            if end is not None:
                return end
            self._run.runtime.clock.sleep(self._run.runtime.parameters.planner_retry_delay)

    def _judge(self, result: RefineResult, calls: int) -> RefineResult | None:
        """What ends the execution after this call; None = call again."""
        limit = self._run.runtime.parameters.refiner_max_retries
        if self._run.canceled:
            return RefineResult(RefinePathOutcome.CANCELED, self._run.handle.cancel_reason)
        if result.success or limit == 0:
            return result
        if self._run.is_patience_over():
            return RefineResult(RefinePathOutcome.STOPPED, f"no success within {self._run.patience:g} s")
        if 0 < limit < calls:
            text = f"{calls} attempts failed, the last with: {result.message}"
            return RefineResult(RefinePathOutcome.DEPLETED, text)
        return None

    def _call(self) -> RefineResult:
        refiner, token = self._run.plugin.instance, self._run.handle.cancel_token
        return self._run.ask_reported(
            "apply_refinement", lambda: refiner.apply_refinement(self._path, token), RefineResult
        )
