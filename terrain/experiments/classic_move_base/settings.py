"""States, triggers and parameters of ROS 1's ``move_base``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum

from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from mbf_abstract.server.navigation_server import AbstractNavigationServer


class ClassicState(Enum):
    """The three states of move_base."""

    PLANNING = "planning"
    CONTROLLING = "controlling"
    CLEARING = "clearing"


class Trigger(Enum):
    """What made the last recovery necessary; the value is the message of an abort."""

    PLANNING = "Failed to find a valid plan. Even after executing recovery behaviors."
    CONTROLLING = "Failed to find a valid control. Even after executing recovery behaviors."
    OSCILLATION = "Robot is oscillating. Even after executing recovery behaviors."


ABORT_OUTCOMES = {
    Trigger.PLANNING: MoveBaseOutcome.PLAN_FAILURE,
    Trigger.CONTROLLING: MoveBaseOutcome.CTRL_FAILURE,
    Trigger.OSCILLATION: MoveBaseOutcome.OSCILLATION,
}


CANNOT_FOLLOW = (
    ExePathOutcome.INVALID_PATH,
    ExePathOutcome.INVALID_PLUGIN,
    ExePathOutcome.NOT_INITIALIZED,
    ExePathOutcome.INTERNAL_ERROR,
)


@dataclass(frozen=True)
class ClassicSettings:
    """The parameters of move_base, with the values of a fresh start.

    Attributes
    ----------
    planner_frequency, controller_frequency : float
        [Hz]; a planner_frequency of 0 plans once, and again after a failure of control.
    planner_patience, controller_patience : float
        Time [s] without a plan, without a valid command, before a recovery.
    max_planning_retries : int
        Failed plans before a recovery; negative = only patience counts.
    recovery_behaviors : tuple of str, optional
        Names in their fixed order; None = all that are loaded.
    oscillation_timeout, oscillation_distance : float
        Recover if the robot has not moved this far [m] in this time [s]; 0 s = never.
    """

    planner_frequency: float = 0.0
    controller_frequency: float = 20.0
    planner_patience: float = 5.0
    controller_patience: float = 15.0
    max_planning_retries: int = -1
    recovery_behavior_enabled: bool = True
    recovery_behaviors: tuple[str, ...] | None = None
    oscillation_timeout: float = 0.0
    oscillation_distance: float = 0.5

    @contextmanager
    def imposed_on(self, server: AbstractNavigationServer) -> Iterator[None]:
        """One plugin call a goal, and no second watch: patience, retries and oscillation are decided by the machine."""
        ours = {
            "planner_max_retries": 0,
            "planner_patience": 0.0,
            "controller_max_retries": 0,
            "controller_patience": self.controller_patience,
            "controller_frequency": self.controller_frequency,
            "oscillation_timeout": 0.0,
        }
        before = {name: getattr(server.runtime.parameters, name) for name in ours}
        server.set_parameters(**ours)
        try:
            yield
        finally:
            server.set_parameters(**before)
