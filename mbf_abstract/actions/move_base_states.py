"""States of the ``move_base`` machine, and what it needs of the action that runs it."""

from __future__ import annotations

from enum import Enum
from typing import Any, Protocol

from mbf_abstract.actions.action import GoalJob
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathFeedback, MoveBaseGoal, MoveBaseResult
from mbf_abstract.goals.handle import AnyGoalHandle, GoalHandle
from mbf_abstract.server.plugin_table import PluginTable

Handle = GoalHandle[MoveBaseGoal, MoveBaseResult, ExePathFeedback]
Job = GoalJob[MoveBaseGoal, MoveBaseResult, ExePathFeedback]


class MoveBaseState(Enum):
    """What the machine waits for."""

    GET_PATH = "get_path"
    EXE_PATH = "exe_path"
    STOPPING = "stopping"
    RECOVERY = "recovery"
    CANCELING = "canceling"


class Trigger(Enum):
    """What made the last recovery necessary."""

    NONE = "none"
    PLAN = "plan"
    CONTROL = "control"
    OSCILLATION = "oscillation"


End = tuple[int, str]


class SubGoalAction(Protocol):
    """An action that the machine sends goals to."""

    def send(self, goal: Any) -> AnyGoalHandle:
        """Send a goal; returns at once."""


class MachineOwner(Protocol):
    """What the machine needs of the action that runs it."""

    @property
    def runtime(self) -> Runtime:
        """Clock, events, robot and parameters."""

    @property
    def plugins(self) -> PluginTable:
        """The loaded plugins."""

    @property
    def get_path(self) -> SubGoalAction:
        """Plans."""

    @property
    def exe_path(self) -> SubGoalAction:
        """Follows paths."""

    @property
    def recovery(self) -> SubGoalAction:
        """Runs recovery behaviours."""

    def target(self, handle: Handle) -> Pose:
        """Target pose of a goal in the global frame; raises TransformError."""

    def finish(self, handle: Handle, outcome: int, message: str) -> None:
        """End a goal that another one has replaced."""

    def report_started(self, handle: Handle) -> None:
        """Record that a goal is being worked on."""
