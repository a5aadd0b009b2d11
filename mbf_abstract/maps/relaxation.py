"""Wider tolerances that a recovery behaviour grants for a time.

A grant carries the time of its end, and every reader compares it with the clock. So nothing has to be restored when the
behaviour is canceled, the plugin is unloaded or no goal runs.

When to use: a recovery that makes planning or driving less exact until a narrow place is passed. When not: a lasting
change of a tolerance is a change of parameters (``set_parameters``).
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass


@dataclass(frozen=True)
class Slack:
    """How much wider tolerances are; the default changes nothing.

    Attributes
    ----------
    plan_distance : float
        A planner may end its path at least this far [m] from the goal.
    arrival_distance, arrival_angle : float
        Arrival tolerances are at least this wide [m, rad].
    controller_factor : float
        At least 1. A controller's limits are wider by this factor: the distance from the path it may have is multiplied
        by it, the time or distance ahead that must be free of obstacles is divided by it.
    """

    plan_distance: float = 0.0
    arrival_distance: float = 0.0
    arrival_angle: float = 0.0
    controller_factor: float = 1.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) and value >= 0.0 for value in astuple(self)) or self.controller_factor < 1.0:
            raise ValueError(f"slack must be finite and must not make anything stricter, got {self}")

    def widest(self, other: Slack) -> Slack:
        """The wider of two, value by value."""
        return Slack(*map(max, astuple(self), astuple(other)))


NO_SLACK = Slack()


class Relaxation:
    """The slack in force in one server; one grant for each owner."""

    def __init__(self) -> None:
        self._grants: dict[str, tuple[Slack, float]] = {}

    def grant(self, owner: str, slack: Slack, until: float) -> None:
        """Give slack until the time ``until`` [s]; replaces what this owner granted before."""
        self._grants = {**self._grants, owner: (slack, until)}  # replaced as a whole: readers need no lock

    def slack(self, now: float) -> Slack:
        """What is granted at the time ``now`` [s]: the widest of all grants that have not ended."""
        slack = NO_SLACK
        for granted, until in self._grants.values():
            slack = slack.widest(granted) if now < until else slack
        return slack
