"""Whether a run has succeeded: decided once, at the end of the run, and shown everywhere.

A run succeeds if navigation reached the last goal, the robot was at every goal in truth, it did not tip over, it
touched nothing while it moved, and no limit of the scenario was broken. ``Verdict.failures`` lists what is wrong,
whatever navigation reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from mbf_abstract.event_values import well_formed
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.physics.incidents import IncidentKind
from terrain.scenarios.limits import Limits, broken_limits
from terrain.session.arrival import missed_goals

TOUCHED = "collision_with_"


class Level(Enum):
    """How good a run was; pages, pictures and terminals show them in green, amber and red."""

    SUCCESS = "success"
    ARRIVED = "arrived"  # at all goals, but something has happened that must not
    FAILED = "failed"


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
    at_goals : bool
        Whether the robot was in truth at every goal that navigation reported as reached.
    """

    outcome: int | None
    message: str
    failures: tuple[str, ...] = ()
    at_goals: bool = True

    @property
    def level(self) -> Level:
        """How good the run was."""
        if not self._navigation_succeeded or not self.at_goals:
            return Level.FAILED
        return Level.ARRIVED if self.failures else Level.SUCCESS

    @property
    def success(self) -> bool:
        """Whether the run is a success; a robot that only arrived is not enough."""
        return self.level is Level.SUCCESS

    @property
    def outcome_name(self) -> str:
        """Name of navigation's outcome, which can be a success in a run that is none."""
        return "UNFINISHED" if self.outcome is None else outcome_name(self.outcome)

    @property
    def title(self) -> str:
        """Short verdict: navigation's outcome, or what is wrong with the run where that is a success."""
        if not self._navigation_succeeded or self.success:
            return self.outcome_name
        return "ARRIVED WITH FAILURES" if self.at_goals else "FAILED"

    def __str__(self) -> str:
        """The verdict in a line."""
        if self._navigation_succeeded and self.failures:
            return f"{self.title}: {'; '.join(self.failures)} (navigation: {self.outcome_name}, {self.message})"
        return f"{self.title}: {'; '.join([self.message, *self.failures])}"

    @property
    def _navigation_succeeded(self) -> bool:
        return self.outcome is not None and is_success(self.outcome)

    def to_json(self) -> dict[str, Any]:
        """Return what ``metrics.json`` and a sweep's rows hold of it."""
        return {
            "success": self.success,
            "level": self.level.value,
            "verdict": str(self),
            "outcome": self.outcome_name,
            "outcome_code": self.outcome,
            "message": self.message,
            "failures": list(self.failures),
        }


UNFINISHED = Verdict(None, "the run was cut short")


def judge(result: MoveBaseResult, limits: Limits, metrics: Mapping[str, Any]) -> Verdict:
    """Return the verdict on a run: navigation's result, and what the metrics of the run break."""
    missed = missed_goals(metrics)
    failures = (*missed, *_tip_overs(limits, metrics), *broken_limits(limits, metrics), *_contacts(metrics))
    return Verdict(int(result.outcome), well_formed(result.message), failures, not missed)


def _tip_overs(limits: Limits, metrics: Mapping[str, Any]) -> list[str]:
    """A robot that tipped over has failed in every scenario; where it is forbidden, the limits name it."""
    count = metrics["tip_overs"]
    if not count or IncidentKind.TIPPED_OVER in limits.forbidden:
        return []
    return ["the robot tipped over"]


def _contacts(metrics: Mapping[str, Any]) -> list[str]:
    count = metrics["collisions_while_moving"]
    if not count:
        return []
    things = [incident.removeprefix(TOUCHED) for incident in metrics["incidents"] if incident.startswith(TOUCHED)]
    return [f"contacts while the robot moved: {count} ({', '.join(things)})"]
