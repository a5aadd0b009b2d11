"""Whether a run has succeeded: decided once, at the end of the run, and shown everywhere.

A run succeeds if navigation reached the last goal, the robot was at every goal in truth, no limit of the scenario was
broken, and the robot touched nothing while it moved. ``Verdict.failures`` lists what is wrong, whatever
navigation reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mbf_abstract.event_values import well_formed
from mbf_abstract.goals.goal_types import MoveBaseResult
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.scenarios.limits import Limits, broken_limits
from terrain.session.arrival import missed_goals

TOUCHED = "collision_with_"


@dataclass(frozen=True)
class Verdict:
    """How a run ended.

    Attributes
    ----------
    outcome : int or None
        Code of navigation's last goal; None for a run that was cut short before it had one.
    message : str
        Message of that goal.
    failures : tuple of str
        What must not happen in a run and did; empty in a good one.
    """

    outcome: int | None
    message: str
    failures: tuple[str, ...] = ()

    @property
    def success(self) -> bool:
        """Whether the run is a success."""
        return self._navigation_succeeded and not self.failures

    @property
    def outcome_name(self) -> str:
        """Name of navigation's outcome, which can be a success in a run that is none."""
        return "UNFINISHED" if self.outcome is None else outcome_name(self.outcome)

    @property
    def title(self) -> str:
        """Short verdict: navigation's outcome, or FAILED where that is a success but the run is not."""
        return "FAILED" if self.failures and self._navigation_succeeded else self.outcome_name

    def __str__(self) -> str:
        """The verdict in a line."""
        if self.title == "FAILED":
            return f"FAILED: {'; '.join(self.failures)} (navigation: {self.outcome_name}, {self.message})"
        return f"{self.title}: {'; '.join([self.message, *self.failures])}"

    @property
    def _navigation_succeeded(self) -> bool:
        return self.outcome is not None and is_success(self.outcome)

    def to_json(self) -> dict[str, Any]:
        """Return what ``metrics.json`` and a sweep's rows hold of it."""
        return {
            "success": self.success,
            "verdict": str(self),
            "outcome": self.outcome_name,
            "outcome_code": self.outcome,
            "message": self.message,
            "failures": list(self.failures),
        }


UNFINISHED = Verdict(None, "the run was cut short")


def judge(result: MoveBaseResult, limits: Limits, metrics: Mapping[str, Any]) -> Verdict:
    """Return the verdict on a run: navigation's result, and what the metrics of the run break."""
    failures = (*missed_goals(metrics), *broken_limits(limits, metrics), *_contacts(metrics))
    return Verdict(int(result.outcome), well_formed(result.message), failures)


def _contacts(metrics: Mapping[str, Any]) -> list[str]:
    count = metrics["collisions_while_moving"]
    if not count:
        return []
    things = [incident.removeprefix(TOUCHED) for incident in metrics["incidents"] if incident.startswith(TOUCHED)]
    return [f"contacts while the robot moved: {count} ({', '.join(things)})"]
