"""A plan after a clearing waits for the next scans, by the clock, and no longer than a sensor may be silent."""

import pytest
from py_trees.composites import Sequence

from mbf_abstract.executives.leaves import GetPath
from mbf_abstract.executives.map_leaves import ClearMap
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import site

WALL, GOAL = Box(3.8, 3.4, 3.85, 4.6), Pose.planar(7.0, 4.0)


@pytest.fixture(params=["costmap", "mesh"])
def made(request, backends):
    with site(backends[request.param], planner_patience=0.1) as made:
        made.place(WALL)
        yield made


def gap(path):
    """Least distance [m] between the poses of a path and the wall."""
    return min(WALL.gap(x, y) for x, y, _ in path.positions.tolist())


def test_a_plan_keeps_off_a_wall_that_only_the_sensor_knows(made):
    made.server.queries.clear_map()
    began = made.rig.clock.now()
    result = made.navigator.get_path(GOAL)
    assert result.success, "patience is with the planner"
    assert gap(result.path) > 0.2, "it leads through the wall, if it does not wait"
    assert made.rig.clock.now() - began < 0.31, "a scan comes every 0.2 s"


def test_a_leaf_that_clears_is_followed_by_a_plan_that_knows_the_wall(made):
    tree = Sequence("clear, then plan", memory=True, children=[ClearMap(), GetPath()])
    result = TreeExecutive(tree, made.navigator).run(target=GOAL)
    assert result.success and gap(result.mission.path) > 0.2


def test_without_a_clearing_a_plan_waits_for_nothing(made):
    made.rig.sensing = False
    made.rig.clock.sleep(0.5)
    began = made.rig.clock.now()
    assert made.navigator.get_path(GOAL).success and made.rig.clock.now() - began < 0.02


def test_a_sensor_that_has_fallen_silent_is_waited_for_until_it_is_late(made):
    made.rig.sensing = False
    made.server.queries.clear_map()
    began = made.rig.clock.now()
    assert made.navigator.get_path(GOAL).success
    assert 0.7 < made.rig.clock.now() - began < 1.1, "it sends within a second"
    began = made.rig.clock.now()
    assert made.navigator.get_path(GOAL).success and made.rig.clock.now() - began < 0.02
    assert "'lidar' is silent" in made.server.map_problem(), "and nothing drives along the plan"


def test_a_scan_that_comes_while_a_plan_waits_is_enough(made):
    made.rig.sensing = False
    made.server.queries.clear_map()
    handle = made.navigator.send(GetPathGoal(GOAL))
    made.rig.clock.sleep(0.42)
    assert not handle.done
    made.server.take_scan(made.rig.scan())
    assert gap(handle.wait(0.06).path) > 0.2


def test_a_cancel_ends_the_waiting(made):
    made.rig.sensing = False
    made.server.queries.clear_map()
    handle = made.navigator.send(GetPathGoal(GOAL))
    made.rig.clock.sleep(0.2)
    handle.cancel()
    result = handle.wait(0.06)
    assert result is not None and result.outcome == GetPathOutcome.CANCELED


def test_a_map_that_cannot_be_updated_holds_no_plan_for_ever(made, monkeypatch):
    def broken(*_):
        raise ArithmeticError("broken")

    made.server.queries.clear_map()
    for served in made.server.served.values():
        monkeypatch.setattr(served, "update", broken)
    began = made.rig.clock.now()
    assert made.navigator.get_path(GOAL).success and made.rig.clock.now() - began < 1.1


def test_a_source_is_awaited_after_a_clearing_for_as_long_as_it_may_be_silent():
    watch = SourceWatch("lidar")
    watch.cleared()
    assert not watch.awaits_scan(0.0, 1.0), "it has never sent anything"
    watch.heard(1.0)
    assert not watch.awaits_scan(1.0, 1.0), "it was not cleared since"
    watch.used()
    watch.cleared()
    assert watch.awaits_scan(1.5, 1.0) and not watch.awaits_scan(2.1, 1.0)
    assert not watch.awaits_scan(1.0, 0.0), "it may be silent"
    watch.heard(1.6)
    assert watch.awaits_scan(1.6, 1.0), "what it saw is not in the map yet"
    assert not watch.awaits_scan(2.1, 1.0), "and may never be"
    watch.used()
    assert not watch.awaits_scan(1.6, 1.0)
