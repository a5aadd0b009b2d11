"""What a planner calls a path its controller accepts, on the small random worlds of ``benchmarks/agreement.py``."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from mbf_abstract.plugins import PlanRequest, PluginKind

pytestmark = pytest.mark.usefixtures("one_core")

SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "agreement.py"
SPEC = spec_from_file_location("agreement", SOURCE)
agreement = sys.modules["agreement"] = module_from_spec(SPEC)
sys.path.insert(0, str(SOURCE.parent))  # it imports its worlds
SPEC.loader.exec_module(agreement)
sys.path.remove(str(SOURCE.parent))

PLANNED = range(8)
DRIVEN = {"costmap": [8, 16], "mesh": [1]}
REFUSED = (
    ("astar", "follow_path", 0), ("astar", "regulated_pure_pursuit", 0), ("dijkstra", "follow_path", 0),
    ("theta_star", "follow_path", 0), ("astar", "follow_path", 6), ("hybrid_astar", "follow_path", 9),
    ("hybrid_astar", "regulated_pure_pursuit", 9), ("theta_star", "follow_path", 15),
    ("straight_line", "follow_path", 20), ("theta_star", "follow_path", 20), ("astar", "follow_path", 23),
)  # fmt: skip
"""Drives on the costmap that were refused twice at one place."""
AT_LIMITS = (
    ("costmap", "astar", 8, True), ("costmap", "theta_star", 8, True), ("mesh", "dijkstra", 84, True),
    ("mesh", "dijkstra", 65, True), ("mesh", "dijkstra", 84, False), ("mesh", "dijkstra", 104, True),
)  # fmt: skip
"""Paths along a free end of the map, or towards a wall to a goal beside it; whether no walls stand around."""
FOLLOWERS = {"regulated_pure_pursuit", "follow_path", "path_follower"}
"""Controllers that keep to their path; those that sample motions may leave it, and are only counted."""


def every_planner():
    for backend in agreement.WORLDS:
        yield from ((backend, name) for name in agreement.installed(backend, PluginKind.PLANNER))


def driven_pairs():
    for backend, seeds in DRIVEN.items():
        chosen = [pair for pair in agreement.pairs(backend) if pair[1] in FOLLOWERS]
        yield from ((backend, *pair, seed) for pair in chosen for seed in seeds)
    yield from (("costmap", *drive) for drive in REFUSED)


@pytest.mark.parametrize(("backend", "planner"), [pytest.param(*one, id=".".join(one)) for one in every_planner()])
def test_the_outline_fits_at_every_pose_of_a_fresh_plan(backend, planner):
    paths = 0
    for seed in PLANNED:
        world = agreement.WORLDS[backend](seed)
        if world.ends is None:
            continue
        result = world.plugin(PluginKind.PLANNER, planner).make_plan(PlanRequest(*world.ends))
        if result.success:
            paths += 1
            assert world.first_misfit(result.path) == -1, seed
    assert paths > 0


@pytest.mark.parametrize(("backend", "planner", "controller", "seed"), list(driven_pairs()))
def test_no_plan_is_refused_twice_on_a_map_that_does_not_change(backend, planner, controller, seed):
    world = agreement.WORLDS[backend](seed)
    made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, controller)
    verdict = agreement.drive(world, *made)
    assert verdict.agrees, verdict


@pytest.mark.parametrize(("backend", "planner", "seed", "is_open"), AT_LIMITS)
def test_a_plan_along_the_end_of_the_map_or_to_beside_a_wall_is_driven(backend, planner, seed, is_open):
    world = agreement.WORLDS[backend](seed, is_open)
    made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, "follow_path")
    verdict = agreement.drive(world, *made)
    assert verdict.ending == "arrived", verdict
