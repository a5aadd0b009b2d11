"""Calls plugins before any goal, so that their kernels are compiled; what goes wrong then, the goals report.

A plugin that raises, or answers something else than it should, is recorded as a fault. One that hangs is quarantined
until its call returns. So a server starts whatever its plugins do, and its goals end as always.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from mbf_abstract.compiling.compilation import unwatch_compiler, watch_compiler
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.plugin_answer import checked_answer, checked_flag
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.plugins import (
    AbstractController,
    AbstractPlanner,
    ControlRequest,
    ControlResult,
    PlanRequest,
    PlanResult,
    Plugin,
)
from mbf_abstract.time.clock import Priority, Stopwatch, ThreadDetached

P = TypeVar("P", bound=Plugin)
T = TypeVar("T")


def try_planner(runtime: Runtime, planner: LoadedPlugin[AbstractPlanner], start: Pose, goal: Pose) -> Path | None:
    """Plan once; the path, or None where there is none or the planner misbehaves."""
    request = PlanRequest(start, goal)

    def plan(instance: AbstractPlanner) -> PlanResult:
        return checked_answer(instance.make_plan(request), PlanResult, planner.name, "make_plan")

    result = FirstCall(runtime, planner, plan).answer()
    if result is None:
        request.cancel_token.cancel("the warm-up is over")
        return None
    return result.path if result.success else None


def try_controller(runtime: Runtime, controller: LoadedPlugin[AbstractController], path: Path, pose: Pose) -> None:
    """Have a command computed once, which drives nothing."""
    name, tolerance = controller.name, runtime.parameters.dist_tolerance

    def follow(instance: AbstractController) -> bool:
        checked_flag(instance.set_plan(path), name, "set_plan")
        answer = instance.compute_velocity_commands(ControlRequest(pose, Twist()))
        checked_answer(answer, ControlResult, name, "compute_velocity_commands")
        return checked_flag(instance.is_goal_reached(pose, tolerance, 0.1), name, "is_goal_reached")

    FirstCall(runtime, controller, follow).answer()


class FirstCall(Generic[P, T]):
    """One call into a plugin on a thread of its own, so that it may hang.

    As long as ``hang_guard`` allows, on either clock and without the time of numba's compiler.
    """

    def __init__(self, runtime: Runtime, plugin: LoadedPlugin[P], function: Callable[[P], T]) -> None:
        self._runtime = runtime
        self._plugin = plugin
        self._function = function
        self._watch = Stopwatch(runtime.clock)
        self._condition = runtime.clock.condition()
        self._answer: T | None = None
        self._returned = False
        self._given_up = False

    def __str__(self) -> str:
        return "the warm-up"

    def answer(self) -> T | None:
        """Make the call and wait for it; None where a goal uses the plugin, and where it raises or hangs."""
        limit = self._runtime.parameters.hang_guard
        if not self._plugin.acquire(self, lambda: True):
            return None
        self._runtime.clock.spawn(self._run, f"warm up {self._plugin.name}", Priority.WORKER)
        with self._condition:
            while not self._returned and not self._given_up and (remaining := limit - self._watch.elapsed) > 0.0:
                self._condition.wait(remaining)
        if not self._returned:
            self._plugin.quarantine(self, f"its first call took more than {limit:g} s (hang_guard)")
        return self._answer

    def _run(self) -> None:
        watch_compiler(self._watch.pause, self._watch.resume)
        try:
            with self._runtime.clock.guarded(f"the first call of {self._plugin.title}", self._give_up):
                self._answer = self._function(self._plugin.instance)
        except ThreadDetached:
            pass  # it hung, and is back
        except BaseException as error:  # also sys.exit() in a plugin
            self._plugin.report("warm_up", error)
        finally:
            unwatch_compiler()
            self._plugin.release(self)
        with self._condition:
            self._returned = True
            self._condition.notify_all()

    def _give_up(self) -> None:
        with self._condition:
            self._given_up = True
            self._condition.notify_all()
