"""Plugins that answer what no robot can follow: on every map the goal ends with a text that names what came."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mbf_abstract.geometry import Path, Twist
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RefinePathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult, PlanRequest, PlanResult, PluginKind, RefineResult
from mbf_abstract.testing.conformance.rig import START
from mbf_abstract.testing.conformance.site import Site, situation, somewhere
from mbf_abstract.time.cancel import CancelToken


@contextmanager
def _answering(site: Site, kind: PluginKind, method: str, answer: Callable[..., object]) -> Iterator[str]:
    """Let the first plugin of a kind answer by a function for the time of a ``with`` block; its name."""
    plugin = site.server.plugins.all_of(kind)[0]
    setattr(plugin.instance, method, answer)
    try:
        yield plugin.name
    finally:
        delattr(plugin.instance, method)


@situation()
def a_planned_path_off_the_map_is_refused(site: Site) -> None:
    """A planner's path that leaves the map ends with INTERNAL_ERROR and the pose, not with SUCCESS."""
    goal = somewhere(5.0, 4.0)

    def leaving(request: PlanRequest) -> PlanResult:
        return PlanResult(GetPathOutcome.SUCCESS, "found", site.path((START.x, START.y), (3.0, -3.0), (5.0, 4.0)))

    with _answering(site, PluginKind.PLANNER, "make_plan", leaving):
        plan = site.navigator.get_path(goal)
        site.expect_outcome(plan, GetPathOutcome.INTERNAL_ERROR, "of the path (2.", "is outside the map")
        site.expect(plan.path is None, "the path off the map was handed out")
    site.expect_outcome(site.navigator.get_path(goal), GetPathOutcome.SUCCESS)


@situation()
def a_refined_path_off_the_map_is_refused(site: Site) -> None:
    """A refiner's path that leaves the map ends with INTERNAL_ERROR, the pose and the given path."""
    if not site.server.plugins.all_of(PluginKind.REFINER):
        return
    path = site.path((START.x, START.y), (5.0, 4.0))

    def leaving(given: Path, token: CancelToken) -> RefineResult:
        return RefineResult(RefinePathOutcome.SUCCESS, "", site.path((START.x, START.y), (3.0, -3.0), (5.0, 4.0)))

    with _answering(site, PluginKind.REFINER, "apply_refinement", leaving) as name:
        result = site.navigator.refine_path(path, refiner=name)
    texts = f"the path of refiner {name!r} is refused", "of the path (2.", "is outside the map"
    site.expect_outcome(result, RefinePathOutcome.INTERNAL_ERROR, *texts)
    site.expect(result.refined_path is path, "the path as it was given does not come back")
    site.expect_outcome(site.navigator.refine_path(path, refiner=name), RefinePathOutcome.SUCCESS)


@situation(controller_max_retries=-1)
def a_command_of_another_type_ends_at_once(site: Site) -> None:
    """What is no command ends the path with INTERNAL_ERROR, the plugin and the type that came, without a retry."""
    calls: list[ControlRequest] = []

    def no_twist(request: ControlRequest) -> ControlResult:
        calls.append(request)
        return ControlResult(ExePathOutcome.SUCCESS, "go", (0.5, 0.0, 0.0))  # type: ignore[arg-type]

    with _answering(site, PluginKind.CONTROLLER, "compute_velocity_commands", no_twist) as name:
        result = site.navigator.exe_path(site.path((START.x, START.y), (5.0, 4.0)))
    texts = f"plugin {name!r} returned a command of type tuple, not Twist", "compute_velocity_commands"
    site.expect_outcome(result, ExePathOutcome.INTERNAL_ERROR, *texts)
    site.expect(len(calls) == 1, f"it was asked {len(calls)} times, a type does not change")
    site.expect_stands(0.5, "no command came")


@situation(controller_max_retries=-1, controller_patience=1.0)
def a_command_that_is_not_finite_is_not_followed(site: Site) -> None:
    """A command that is not finite stops the robot, and the message names its field once patience is over."""

    def nan(request: ControlRequest) -> ControlResult:
        return ControlResult(ExePathOutcome.SUCCESS, "go", Twist.planar(wz=float("nan")))

    with _answering(site, PluginKind.CONTROLLER, "compute_velocity_commands", nan) as name:
        result = site.navigator.exe_path(site.path((START.x, START.y), (5.0, 4.0)))
    site.expect_outcome(result, ExePathOutcome.PAT_EXCEEDED, name, "angular[2] must be finite, got nan")
    site.expect_near(START.x, START.y, 0.05, "no command was finite")
