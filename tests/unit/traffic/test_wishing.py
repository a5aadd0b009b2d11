"""A robot that finds no path, because of others that may leave, announces the one that there would be without them."""

from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import PlanResult, RecoveryResult
from mbf_abstract.server.announcer import IDLE_TIME, Announcer
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, straight_plan
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import SharedChannel, Traffic

GOAL = Pose.planar(8.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "somebody stands there")
BEN = Announcement("ben", 0.0, np.array([(6.5, 0.0, 0.0)]), 0.0, radius=0.2, makes_room=True)
TO_THE_WEST = replace(BEN, path=np.array([(6.5, 0.0, 0.0), (-5.0, 0.0, 0.0)]), remaining=11.5, makes_room=False)


class GiveWay(ScriptedRecovery):
    meeting_distance = 0.6

    def make_room(self, request):
        raise NotImplementedError("a robot with it stands idle at first, and makes room")


@pytest.fixture
def anna(make_session):
    """``anna(others, **parameters)``: a robot at the origin; its planner finds a path while its map forgets others."""

    def make(*others, **parameters):
        plugins = {"planner": ScriptedPlanner, "controller": ScriptedController, "give_way": GiveWay}
        session, channel = make_session(plugins, planner_max_retries=0, **parameters), SharedChannel()
        announcer = Announcer(session.server, "anna", channel)
        session.forgotten = []

        def forget(places):
            session.forgotten += places
            session.planner.play(straight_plan)

        def announced():
            announcer.announce()
            return session.heard()

        def let_pass(seconds):
            end = session.clock.now() + seconds
            while True:
                for other in others:
                    channel.publish(replace(other, stamp=session.clock.now()))
                announced()
                if session.clock.now() >= end:
                    return
                session.clock.sleep(0.5)

        session.server.forget, session.announced = forget, announced
        session.heard = lambda: next(one for one in channel.latest() if one.name == "anna")
        session.planner.play(NO_PATH)
        session.let_pass = let_pass
        let_pass(0.0)
        return session

    return make


def plan(session, **goal):
    return session.navigator.send(GetPathGoal(GOAL, **goal)).wait()


def test_the_result_stays_without_a_path_and_the_wish_is_announced_at_once(anna):
    session = anna(BEN)
    assert session.heard().makes_room
    result = plan(session)
    assert (result.outcome, result.path) == (GetPathOutcome.NO_PATH_FOUND, None)
    heard = session.heard()
    assert heard.wishes and not heard.makes_room and heard.remaining == 8.0
    assert heard.path[-1].tolist() == [8.0, 0.0, 0.0]
    assert session.announced().path[-1].tolist() == [8.0, 0.0, 0.0], "and again while nothing else comes"


def test_what_its_map_forgets_is_the_body_of_the_other_one_and_a_margin(anna):
    session = anna(BEN)
    plan(session)
    ((place, size),) = session.forgotten
    assert place.position == (6.5, 0.0, 0.0)
    assert size == pytest.approx(0.6)


def test_one_that_wishes_and_one_that_makes_room_know_each_other_from_afar(anna):
    session = anna(BEN)
    plan(session)
    now = session.clock.now()
    assert [one.name for one in session.server.runtime.traffic.rivals(now, 0.6, 5.0)] == ["ben"]
    ben = Traffic()
    ben.connect("ben", session.server.runtime.traffic._channel)
    ben.announce(BEN)
    assert ben.rivals(now, 0.6, 5.0) == (), "it is not asked"
    session.server.runtime.traffic.ask(True)
    assert [one.name for one in ben.rivals(now, 0.6, 5.0)] == ["anna"]


def test_of_two_that_wish_each_to_pass_the_other_exactly_one_goes_first(anna):
    """So they cannot wait for each other for ever; both see that they meet, also from afar."""
    session = anna(replace(TO_THE_WEST, wishes=True))
    plan(session)
    traffic, now = session.server.runtime.traffic, session.clock.now()
    ben = Traffic()
    ben.connect("ben", traffic._channel)
    ben.announce(replace(TO_THE_WEST, wishes=True))
    ben.wished = Path.from_poses([Pose.planar(6.5, 0.0), Pose.planar(-5.0, 0.0)])
    ben.announce(replace(TO_THE_WEST, wishes=True))
    assert [one.name for one in traffic.rivals(now, 0.6, 5.0)] == ["ben"]
    assert [one.name for one in ben.rivals(now, 0.6, 5.0)] == ["anna"]


@pytest.mark.parametrize(
    "others",
    [
        (),
        (replace(BEN, cannot_yield=True),),
        (replace(BEN, makes_room=False),),
        (replace(BEN, radius=0.0),),
    ],
    ids=["alone", "no place to make room", "has a goal and no path", "unknown size"],
)
def test_where_nobody_may_leave_the_map_forgets_nothing_and_no_wish_is_announced(anna, others):
    session = anna(*others)
    assert plan(session).outcome == GetPathOutcome.NO_PATH_FOUND
    assert session.forgotten == [] and len(session.planner.requests) == 1
    assert not session.heard().wishes and session.heard().remaining == 0.0


def test_one_that_goes_somewhere_may_leave_too(anna):
    session = anna(TO_THE_WEST)
    plan(session)
    assert session.heard().wishes


@pytest.mark.parametrize(
    ("answer", "goal"),
    [
        (NO_PATH, {"start_pose": Pose.planar(1.0, 0.0)}),
        (PlanResult(GetPathOutcome.OUT_OF_MAP, "the goal is off the map"), {}),
        (PlanResult(GetPathOutcome.NO_PATH_FOUND, "an island", permanent=True), {}),
    ],
    ids=["from another place", "off the map", "permanent"],
)
def test_other_questions_and_failures_make_no_wish(anna, answer, goal):
    session = anna(BEN)
    session.planner.play(answer)
    assert not plan(session, **goal).success
    assert session.forgotten == [] and not session.heard().wishes


def test_without_a_path_on_the_map_without_the_others_there_is_no_wish(anna):
    session = anna(BEN)
    session.server.forget = session.forgotten.extend
    session.planner.play(NO_PATH, NO_PATH)
    assert not plan(session).success
    assert len(session.forgotten) == 1 and not session.heard().wishes


def test_one_that_drives_goes_on_announcing_the_path_that_it_follows(anna):
    session = anna(BEN)
    session.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), Pose.planar(3.0, 0.0)])))
    session.clock.sleep(0.5)
    assert not plan(session).success
    assert session.forgotten == []
    assert session.announced().path[-1, 0] == 3.0 and not session.heard().wishes


def test_a_plan_ends_the_wish(anna):
    session = anna(BEN)
    plan(session)
    session.planner.play(straight_plan)
    assert plan(session).success
    assert not session.heard().wishes and session.heard().remaining == 0.0


def test_a_path_that_is_followed_ends_the_wish(anna):
    session = anna(BEN)
    plan(session)
    session.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), Pose.planar(3.0, 0.0)])))
    session.clock.sleep(0.5)
    assert session.announced().path[-1, 0] == 3.0 and not session.heard().wishes


def test_a_wish_of_a_robot_without_a_goal_is_forgotten(anna):
    session = anna(BEN)
    plan(session)
    session.announced()
    session.clock.sleep(IDLE_TIME)
    session.announced()
    assert not session.announced().wishes and session.heard().remaining == 0.0


@pytest.fixture
def waiting(anna):
    """Anna, whose ``move_base`` finds no path and runs ``give_way``, and the handle of its goal."""
    session = anna(BEN)
    session.plugin("give_way", GiveWay).play(slow(session.clock, 5.0, RecoveryResult(RecoveryOutcome.SUCCESS)))
    handle = session.navigator.send(MoveBaseGoal(GOAL, recovery_behaviors=()))
    session.let_pass(1.5 * IDLE_TIME)
    assert len(session.plugin("give_way", GiveWay).requests) == 1, "nothing clears, and it asks at the first failure"
    assert session.heard().wishes, "also while it recovers"
    return session, handle


def test_the_wish_ends_with_its_goal(waiting):
    session, handle = waiting
    handle.cancel()
    handle.wait(10.0)
    assert handle.done and not session.heard().wishes and session.heard().remaining == 0.0


def test_another_goal_has_a_wish_of_its_own(waiting):
    session, handle = waiting
    session.planner.play(NO_PATH)
    session.navigator.send(MoveBaseGoal(Pose.planar(7.5, 0.5), recovery_behaviors=()))
    session.clock.sleep(0.1)
    assert handle.done and not session.heard().wishes
    session.let_pass(4.0)
    assert session.heard().wishes and session.heard().path[-1].tolist() == [7.5, 0.5, 0.0]


def test_robots_of_an_older_version_wish_for_nothing():
    text = replace(BEN, wishes=True).to_json()
    assert Announcement.from_json(text).wishes
    assert not Announcement.from_json(text.replace(',"wishes":true', "")).wishes
