"""For plugins written for nav_core: its three interfaces, and how they answer as MBF plugins.

Move Base Flex runs plugins of the older ``move_base`` by wrapping them; so do we. Here are the interfaces, which know
no map, and what is common to the wrappers; a server of a map binds them to it (``mbf_costmap_nav.planning.nav_core``)
and offers its binding to the registry, which asks it about a class that is no MBF plugin.

Use this to bring an old planner over. Write new plugins for ``mbf_abstract.plugins``: only they get tolerances, cancel,
the robot's velocity and outcome codes of their own.

==================  ==========================  =========================================================
class               answers                     becomes
==================  ==========================  =========================================================
global planner      a list of poses or None     SUCCESS "Plan found" / FAILURE "Planner failed"
local planner       a twist or None             SUCCESS "Valid command" / FAILURE "Controller failed"
recovery behavior   nothing                     SUCCESS, always
==================  ==========================  =========================================================
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanRequest, PlanResult, RecoveryResult


class BaseGlobalPlanner(ABC):
    """A planner with one map."""

    @abstractmethod
    def initialize(self, name: str, costmap: Any) -> None:
        """Take over name and map; called once."""

    @abstractmethod
    def make_plan(self, start: Pose, goal: Pose) -> Sequence[Pose] | None:
        """Poses from start to goal in one frame, None or empty if there is no plan."""


class BaseLocalPlanner(ABC):
    """A controller that asks the map for the robot's pose itself."""

    @abstractmethod
    def initialize(self, name: str, transforms: Any, costmap: Any) -> None:
        """Take over name, robot state and map; called once."""

    @abstractmethod
    def set_plan(self, plan: Sequence[Pose]) -> bool:
        """Take over a plan; False = refused."""

    @abstractmethod
    def compute_velocity_commands(self) -> Twist | None:
        """Command of this cycle, None if there is no valid one."""

    @abstractmethod
    def is_goal_reached(self) -> bool:
        """Whether the plan's end is reached, by the plugin's own tolerances."""


class RecoveryBehavior(ABC):
    """A recovery with both maps."""

    @abstractmethod
    def initialize(self, name: str, transforms: Any, global_costmap: Any, local_costmap: Any) -> None:
        """Take over name, robot state and maps; called once."""

    @abstractmethod
    def run_behavior(self) -> None:
        """Run to the end."""


def plan_with(planner: BaseGlobalPlanner, request: PlanRequest) -> PlanResult:
    """Ask an old planner, once for each leg between via poses; it knows neither tolerances nor cancel."""
    stops = (request.start, *request.via, request.goal)
    poses: list[Pose] = []
    for start, goal in itertools.pairwise(stops):
        leg = planner.make_plan(start, goal)
        if not leg:
            return PlanResult(GetPathOutcome.FAILURE, "Planner failed")
        poses += leg[1:] if poses else leg
    return PlanResult(GetPathOutcome.SUCCESS, "Plan found", Path.from_poses(poses))


def control_with(controller: BaseLocalPlanner) -> ControlResult:
    """Ask an old controller; it finds pose and velocity by itself."""
    command = controller.compute_velocity_commands()
    if command is None:
        return ControlResult(ExePathOutcome.FAILURE, "Controller failed")
    return ControlResult(ExePathOutcome.SUCCESS, "Valid command", command)


def recover_with(behavior: RecoveryBehavior) -> RecoveryResult:
    """Run an old recovery; it reports nothing, so its end is its success."""
    behavior.run_behavior()
    return RecoveryResult(RecoveryOutcome.SUCCESS, "behavior ended")
