"""What a controller execution takes and reports: its plan, its states, how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from mbf_abstract.execution.arrival import ArrivalCheck
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path


class ControllerState(Enum):
    """Where a controller execution is."""

    INITIALIZED = "initialized"
    STARTED = "started"
    CONTROLLING = "controlling"
    GOT_LOCAL_CMD = "got_local_cmd"
    NO_LOCAL_CMD = "no_local_cmd"
    HOLDING = "holding"
    PAUSED = "paused"
    STOPPING = "stopping"
    ARRIVED_GOAL = "arrived_goal"
    MISSED_GOAL = "missed_goal"
    NO_PLAN = "no_plan"
    EMPTY_PLAN = "empty_plan"
    INVALID_PLAN = "invalid_plan"
    MAX_RETRIES = "max_retries"
    PAT_EXCEEDED = "pat_exceeded"
    CANCELED = "canceled"
    OSCILLATING = "oscillating"
    ROBOT_DISABLED = "robot_disabled"
    STOPPED = "stopped"
    INTERNAL_ERROR = "internal_error"


@dataclass(frozen=True)
class ControllerEnd:
    """How the loop ended: its last state, the outcome for the goal, and a text."""

    state: ControllerState
    outcome: int
    message: str


@dataclass(frozen=True)
class Plan:
    """A path in the global frame with the arrival rule of its goal, and the robot's progress on it."""

    path: Path
    arrival: ArrivalCheck
    tracker: PathTracker = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tracker", PathTracker(self.path))
