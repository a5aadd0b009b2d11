"""Binds nav_core-style plugins (``mbf_abstract.server.nav_core``) to the costmaps, for types that are no MBF plugins.

Such a plugin gets the ``LayeredCostmap`` its kind is bound to; in place of a transform listener it gets the
robot information (``pose()``, ``velocity()``).
"""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.plugins import (
    ControlRequest,
    ControlResult,
    PlanRequest,
    PlanResult,
    PluginKind,
    RecoveryRequest,
    RecoveryResult,
)
from mbf_abstract.server.nav_core import (
    BaseGlobalPlanner,
    BaseLocalPlanner,
    RecoveryBehavior,
    control_with,
    plan_with,
    recover_with,
)
from mbf_costmap_nav.plugins import CostmapContext, CostmapController, CostmapPlanner, CostmapRecovery


class WrappedPlanner(CostmapPlanner):
    """A nav_core global planner as MBF planner."""

    wrapped: Callable[[], BaseGlobalPlanner]

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._planner = type(self).wrapped()
        self._planner.initialize(self.name, self.costmap)

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Call the nav_core planner."""
        return plan_with(self._planner, request)


class WrappedController(CostmapController):
    """A nav_core local planner as MBF controller."""

    wrapped: Callable[[], BaseLocalPlanner]

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._controller = type(self).wrapped()
        self._controller.initialize(self.name, self.robot, self.costmap)

    def set_plan(self, path: Path) -> bool:
        """Pass the poses on."""
        return bool(self._controller.set_plan(list(path)))

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Call the nav_core controller."""
        return control_with(self._controller)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Call the nav_core controller, which has tolerances of its own."""
        return bool(self._controller.is_goal_reached())


class WrappedRecovery(CostmapRecovery):
    """A nav_core recovery behavior as MBF recovery."""

    wrapped: Callable[[], RecoveryBehavior]

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._behavior = type(self).wrapped()
        self._behavior.initialize(self.name, self.robot, self.global_costmap, self.local_costmap)

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Run the nav_core behavior."""
        return recover_with(self._behavior)


_WRAPPERS: dict[str, tuple[type, type]] = {
    PluginKind.PLANNER.value: (BaseGlobalPlanner, WrappedPlanner),
    PluginKind.CONTROLLER.value: (BaseLocalPlanner, WrappedController),
    PluginKind.RECOVERY.value: (RecoveryBehavior, WrappedRecovery),
}


def wrap_nav_core(group: str, plugin_class: type) -> type | None:
    """Return an MBF plugin class that wraps a nav_core class of the same kind; None for any other class."""
    base, wrapper = _WRAPPERS.get(group, (None, None))
    if base is None or wrapper is None or not issubclass(plugin_class, base):
        return None
    return type(plugin_class.__name__, (wrapper,), {"wrapped": plugin_class, "__doc__": plugin_class.__doc__})
