"""What a tree that asks who is in its way does behind somebody who goes its way, but slower."""

import math
from types import SimpleNamespace

import pytest
from py_trees.common import Status

from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.executives.trees.overtaking import SIDEWAYS, Overtake, has_room_beside
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.tracking.blocking import Blockage
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan

OPTIONS = TreeOptions(check_poses=False, wait="relax", give_way="back_up")
GOAL = Pose.planar(6.0, 0.0)
FAST = 0.5  # m/s


def slow_one(speed=0.2, along=1.0, motion=Motion.MOVING, distance=1.0):
    known = SimpleNamespace(motion=motion, standing=0.0, number=7, course=(along, 0.0), speed=speed)
    return Blockage(known, 0, distance, along)


@pytest.fixture
def behind(make_session, monkeypatch):
    """A session whose robot drives fast, then slowly behind somebody; so far [m] beside its path there is ``room``.

    A path that ends at y above 0 leads past them.
    """

    def make(blockage, room=2.0, cycles=(20, 120), plans=()):
        session = make_session()

        def what_blocks(path, within_time=2.0, margin=0.0):
            return () if path[-1].y > 0.3 else (blockage,)

        def check_path(path, *asked):
            beside = max(abs(pose.y) for pose in path)
            return SimpleNamespace(state=CellState.FREE if beside <= room else CellState.LETHAL, cost=0.0)

        queries = SimpleNamespace(what_blocks=what_blocks, check_path=check_path)
        monkeypatch.setattr(type(session.server), "queries", queries)
        fast, slow = cycles
        session.controller.play(*[drive(FAST)] * fast, *[drive(0.1)] * slow, session.controller.follow)
        session.planner.play(straight_plan, *plans)
        return session

    return make


def plans_of(session):
    """Places [m] along x from which plans were asked for while the robot drove slowly."""
    assert TreeExecutive(navigation_tree(OPTIONS), session.navigator).run(GOAL).success
    return [round(request.start.x, 1) for request in session.planner.requests[1:] if request.start.x < 1.8]


def test_a_robot_that_is_held_up_asks_for_a_path_past(behind):
    assert plans_of(behind(slow_one()))


@pytest.mark.parametrize(
    "blockage",
    [
        slow_one(speed=0.45),  # nearly as fast as the robot has driven
        slow_one(along=-1.0),  # comes
        slow_one(along=0.0),  # crosses
        slow_one(distance=4.0),
    ],
)
def test_nobody_else_is_overtaken(behind, blockage):
    assert plans_of(behind(blockage)) == []


def test_where_there_is_no_room_beside_the_path_no_plan_is_asked_for(behind):
    assert plans_of(behind(slow_one(), room=0.5)) == []


def test_a_robot_that_has_never_driven_faster_is_not_held_up(behind):
    assert plans_of(behind(slow_one(), cycles=(0, 120))) == []


def test_a_path_that_does_not_keep_clear_of_them_is_not_taken_nor_asked_for_again(behind):
    session = behind(slow_one())
    assert len(plans_of(session)) == 1  # of straight_plan, which leads through them
    assert {request.start.y for request in session.planner.requests} == {0.0}


def test_where_the_map_cannot_say_who_is_on_a_path_none_is_taken(behind, monkeypatch):
    session = behind(slow_one())
    asked = session.server.queries.what_blocks

    def what_blocks(path, within_time=2.0, margin=0.0):
        if len(session.planner.requests) > 1:
            raise TransformError("no transform from map to odom")
        return asked(path, within_time, margin)

    session.server.queries.what_blocks = what_blocks
    assert len(plans_of(session)) == 1


def test_room_is_looked_for_along_lines_beside_the_path_to_the_left_and_to_the_right():
    yaw, asked = 0.6, []
    ends = [(1.0 + s * math.cos(yaw), 2.0 + s * math.sin(yaw), 0.0) for s in (0.0, 3.0, 6.0, 9.0)]

    def check_path(path):
        asked.append(path)
        return SimpleNamespace(state=CellState.LETHAL)

    queries = SimpleNamespace(what_blocks=lambda path, margin: (), check_path=check_path)
    navigator = SimpleNamespace(server=SimpleNamespace(queries=queries))
    mission = SimpleNamespace(path_to_follow=lambda: Path.from_points(ends), navigator=navigator)

    assert not has_room_beside(mission, slow_one())
    aside = [[math.cos(yaw) * (pose.y - 2.0) - math.sin(yaw) * (pose.x - 1.0) for pose in path] for path in asked]
    assert [round(line[0], 6) for line in aside] == [side * shift for shift in SIDEWAYS for side in (1.0, -1.0)]
    assert all(line == pytest.approx([line[0]] * len(line)) for line in aside)


@pytest.mark.parametrize(("aside", "status"), [(0.0, Status.FAILURE), (0.5, Status.SUCCESS)])
def test_it_succeeds_if_and_only_if_the_path_past_somebody_is_taken(behind, aside, status):
    session = behind(slow_one())
    past = Overtake("path past it", "", 0, math.inf, "")
    result = TreeExecutive(past, session.navigator).run(Pose.planar(6.0, aside), path=session.path_to(6.0))
    assert result.status == status
