"""Refiners of every backend that has some: what they keep of a path, what they make better, and how they end."""

from __future__ import annotations

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path
from mbf_abstract.goals.goal_types import RefinePathGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import GetPathOutcome, RefinePathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.conformance.planning import NEAR, WALL
from mbf_abstract.testing.conformance.rig import T_map_dock
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

CORNER = ((2.0, 4.0), (6.0, 4.0), (6.0, 7.0))
"""A path [m] that a straight line is 2 m shorter than."""
SAME_PLACE = 0.05  # m
STEP = 0.05  # m between the places whose costs are compared
REASON = "the path is not wanted any more"


def _refiners(site: Site) -> list[str]:
    """Names of the loaded refiners."""
    return [plugin.name for plugin in site.server.plugins.all_of(PluginKind.REFINER)]


def _state_and_cost(site: Site, path: Path) -> tuple[CellState, float]:
    """Worst state along a path, and its length [m] counted twice where a place costs as much as one beside a wall."""
    tracker, queries = PathTracker(path), site.server.queries
    dense = Path.from_points([*tracker.points_at(np.arange(0.0, tracker.length, STEP)).tolist(), path[-1].position])
    answer, beside = queries.check_path(dense, path_cells_only=True), queries.check_point(NEAR).cost
    return queries.check_path(dense).state, tracker.length + STEP * answer.cost / beside


def _expect_ends(site: Site, refined: Path, given: Path, who: str) -> None:
    """Expect that a path begins and ends where another one does, with its last heading."""
    for where, index in (("begins", 0), ("ends", -1)):
        gap = refined[index].distance_to(given[index])
        site.expect(gap <= SAME_PLACE, f"the path of {who} {where} {gap:.2f} m from that of the given one")
    turned = refined[-1].angle_to(given[-1])
    site.expect(turned < 0.05, f"the path of {who} ends {turned:.2f} rad off the heading of the given one")


@situation()
def a_refined_path_keeps_its_ends_and_is_no_longer(site: Site) -> None:
    """A refiner keeps where a path begins and ends and its last heading, and makes it no longer."""
    path = site.path(*CORNER)
    for name in _refiners(site):
        result = site.navigator.refine_path(path, refiner=name)
        site.expect_outcome(result, RefinePathOutcome.SUCCESS)
        if result.refined_path is not None:
            _expect_ends(site, result.refined_path, path, name)
            ratio = result.path_length_ratio
            site.expect(ratio < 0.99, f"{name} leaves a right angle on empty ground, {ratio:.3f} times as long")


@situation()
def a_refined_path_costs_no_more(site: Site) -> None:
    """A refiner leads a plan around an obstacle through no worse places, and at no higher cost."""
    site.place(WALL)
    plan = site.navigator.get_path(somewhere(7.0, 4.0))
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    if plan.path is None:
        return
    worst, cost = _state_and_cost(site, plan.path)
    for name in _refiners(site):
        refined = site.navigator.refine_path(plan.path, refiner=name).refined_path
        if refined is None:
            site.expect(False, f"{name} gives no path")
            continue
        _expect_ends(site, refined, plan.path, name)
        state, price = _state_and_cost(site, refined)
        site.expect(state <= worst, f"the path of {name} leads through {state.name}, the plan through {worst.name}")
        site.expect(price <= 1.01 * cost, f"the path of {name} costs {price:.2f} m, the plan {cost:.2f} m")


@situation()
def a_refined_path_stays_in_its_frame(site: Site) -> None:
    """A path in another known frame is refined and comes back in its own; one in an unknown frame is a MAP_ERROR."""
    dock = T_map_dock.inverse()
    path = dock.apply_to_path(site.path(*CORNER))
    lost = Path(path.positions, path.orientations, "nowhere", path.stamp)
    for name in _refiners(site):
        result = site.navigator.refine_path(path, refiner=name)
        site.expect_outcome(result, RefinePathOutcome.SUCCESS)
        if result.refined_path is not None:
            frame = result.refined_path.frame_id
            site.expect(frame == "dock", f"{name} answers a path in 'dock' with one in {frame!r}")
            _expect_ends(site, result.refined_path, path, name)
        result = site.navigator.refine_path(lost, refiner=name)
        site.expect_outcome(result, RefinePathOutcome.MAP_ERROR, "nowhere")
        site.expect(result.refined_path is lost, f"{name} does not hand back the path that it could not transform")


@situation()
def a_cancel_while_refining(site: Site) -> None:
    """A goal that is canceled while its refiner works ends CANCELED with the reason and the given path."""
    path = site.path(*CORNER)
    for plugin in site.server.plugins.all_of(PluginKind.REFINER):
        plugin.instance.modelled_compute_time = 1.0
        handle = site.navigator.send(RefinePathGoal(path, plugin.name))
        site.rig.clock.sleep(0.5)
        handle.cancel(REASON)
        result = handle.wait(1.5)
        site.expect_outcome(result, RefinePathOutcome.CANCELED, REASON)
        site.expect(result.refined_path is path, f"{plugin.name} does not hand back the path of a canceled goal")


@situation()
def a_refiner_that_is_not_loaded_is_named(site: Site) -> None:
    """A path for a refiner that is not loaded ends with INVALID_PLUGIN and its name; one without poses with FAILURE."""
    path = site.path(*CORNER)
    result = site.navigator.refine_path(path, refiner="unheard_of")
    site.expect_outcome(result, RefinePathOutcome.INVALID_PLUGIN, "unheard_of")
    site.expect(result.refined_path is path, "the path of a goal that is refused does not come back")
    if _refiners(site):
        site.expect_outcome(site.navigator.refine_path(Path.from_poses([])), RefinePathOutcome.FAILURE, "no poses")
