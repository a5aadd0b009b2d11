"""A robot without a goal makes room for one that is blocked by it and asks, and goes back afterwards."""

from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, FollowWaypointsGoal, MoveBaseGoal
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.server.announcer import Announcer
from mbf_abstract.server.making_room import IDLE_TIME, MOST_RETURNS, NO_PLACE_FOR
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import SharedChannel, Traffic

PLUGINS = {"planner": ScriptedPlanner, "controller": ScriptedController}
PERIOD = 0.5  # s between two announcements
NO_PLACE = RecoveryResult(RecoveryOutcome.IMPASSABLE, "no place beside the paths of others")


class StepAside(ScriptedRecovery):
    """Drives 1 m to the left in 2 s, unless it is asked to end."""

    meeting_distance = 0.6

    def make_room(self, request):
        raise NotImplementedError("the server runs the behaviour, which decides what it does")

    def run_behavior(self, request):
        self.requests.append(request)
        for _ in range(40):
            request.motion.send(Twist.planar(0.0, 0.5))
            if not request.motion.sleep(0.05):
                return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        request.motion.send(Twist())
        return RecoveryResult(RecoveryOutcome.SUCCESS, "stands aside")


class NoRoom(StepAside):
    def run_behavior(self, request):
        self.requests.append(request)
        return NO_PLACE


@pytest.fixture
def anna(make_session):
    """``anna(recovery, **parameters)``: a session of a robot at the origin, with a peer ``ben`` that drives along x."""

    def make(recovery=StepAside, **parameters):
        session, channel = make_session(PLUGINS | {"give_way": recovery}, **parameters), SharedChannel()
        announcer = Announcer(session.server, "anna", channel)
        session.ben = ben = Traffic()
        ben.connect("ben", channel)
        session.way = None

        def let_pass(seconds):
            end = session.clock.now() + seconds
            while session.clock.now() < end - 1e-9:
                if session.way is not None:
                    ben.announce(replace(session.way, stamp=session.clock.now()))
                announcer.announce()
                session.clock.sleep(PERIOD)
            return channel.latest()[0]

        session.let_pass = let_pass
        session.step_aside = session.plugin("give_way", recovery)
        return session

    return make


def way(x_from, x_to, y=0.0):
    x = np.linspace(x_from, x_to, 40)
    return Announcement("", 0.0, np.column_stack([x, np.full(40, y), np.zeros(40)]), abs(x_to - x_from))


def ask(session, asks=True, **changes):
    session.way, session.ben.asks = replace(way(-2.0, 4.0), **changes), asks


def said(session):
    return [event.data["message"] for event in session.recorded(EventKind.CUSTOM) if event.source == "making_room"]


def pulled_out(session):
    return len(session.step_aside.requests)


def test_it_makes_room_when_it_is_asked_and_goes_back_when_the_other_one_has_passed(anna):
    session = anna()
    ask(session)
    assert session.let_pass(3.0).makes_room
    assert pulled_out(session) == 1
    assert session.robot.pose.y == pytest.approx(1.0, abs=0.05)
    ask(session, asks=False)
    session.let_pass(5.0)
    assert session.robot.pose.y == pytest.approx(1.0, abs=0.05), "the other one has not passed yet"
    session.way = way(1.0, 4.0)
    session.let_pass(6.0)
    assert session.robot.pose.distance_to(Pose.planar(0.0, 0.0)) < 0.3
    assert "ben" in said(session)[0] and said(session)[-1] == "is back"


@pytest.mark.parametrize(
    "asked",
    [
        {"asks": False},
        {"path": way(-2.0, 4.0, y=1.0).path},
        {"path": way(1.0, 4.0).path},
        {"path": way(-8.0, 4.0).path},
        {"path": np.add(way(-2.0, 4.0).path, (0.0, 0.0, 4.0))},
    ],
    ids=["does not ask", "passes beside", "has passed", "is far away", "on another storey"],
)
def test_it_stays_where_it_is_for_one_that_it_does_not_block(anna, asked):
    session = anna()
    ask(session, **asked)
    session.let_pass(5.0)
    assert pulled_out(session) == 0


def test_one_that_is_switched_off_stays_and_announces_nothing_of_it(anna):
    session = anna(idle_makes_room=False)
    ask(session)
    assert not session.let_pass(5.0).makes_room
    assert pulled_out(session) == 0
    session.server.set_parameters(idle_makes_room=True)
    assert session.let_pass(3.0).makes_room
    assert pulled_out(session) == 1


def test_one_whose_behaviour_cannot_make_room_does_not_offer_it(anna):
    session = anna(ScriptedRecovery)
    ask(session)
    assert not session.let_pass(5.0).makes_room
    assert session.step_aside.requests == []


def test_a_robot_with_a_goal_follows_the_rule_for_robots_that_go_somewhere(anna):
    session = anna()
    ask(session)
    session.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), Pose.planar(0.0, 9.0)])))
    assert not session.let_pass(4.0).makes_room
    assert pulled_out(session) == 0


def test_one_that_works_at_a_waypoint_is_not_idle(anna):
    session = anna()
    ask(session)
    goal = FollowWaypointsGoal((session.robot.pose,), task=lambda index, pose: session.clock.sleep(20.0))
    session.navigator.send(goal)
    assert not session.let_pass(5.0).makes_room
    assert pulled_out(session) == 0


def test_between_two_goals_it_waits_a_while(anna):
    session = anna()
    ask(session)
    session.navigator.send(MoveBaseGoal(Pose.planar(0.1, 0.0))).wait()
    assert not session.let_pass(IDLE_TIME - PERIOD).makes_room
    assert session.let_pass(2.0).makes_room


def test_it_goes_back_to_where_its_goal_was_however_often_it_makes_room(anna):
    session = anna(dist_tolerance=0.3)
    session.navigator.send(MoveBaseGoal(Pose.planar(0.5, 0.0))).wait()
    for _ in range(3):
        session.let_pass(IDLE_TIME + PERIOD)
        ask(session)
        session.let_pass(3.0)
        assert session.robot.pose.y > 0.7
        session.way = None
        session.let_pass(8.0)
    (home,) = {event.data["target"][0] for event in session.recorded(EventKind.GOAL_ACCEPTED) if "target" in event.data}
    assert home == 0.5
    assert pulled_out(session) == 3


@pytest.mark.parametrize(("moved", "belongs"), [(0.1, 0.0), (0.3, 0.3)])
def test_one_that_has_been_moved_since_its_goal_belongs_where_it_stands(anna, moved, belongs):
    session = anna(dist_tolerance=0.05)
    session.navigator.send(MoveBaseGoal(Pose.planar(0.5, 0.0))).wait()
    session.robot.T_map_odom = Transform((0.0, moved, 0.0), parent="map", child="odom")
    session.let_pass(IDLE_TIME + PERIOD)
    ask(session)
    session.let_pass(3.0)
    session.way = None
    session.let_pass(8.0)
    targets = [event.data.get("target") for event in session.recorded(EventKind.GOAL_ACCEPTED)]
    assert list(filter(None, targets))[-1][1] == pytest.approx(belongs, abs=0.01)


def test_one_that_finds_no_place_says_so_and_is_not_waited_for(anna):
    session = anna(NoRoom)
    ask(session)
    announced = session.let_pass(2.0)
    assert announced.makes_room and announced.cannot_yield
    assert pulled_out(session) == 1
    assert session.ben.rivals(session.clock.now(), 0.6, 5.0) == ()
    session.let_pass(NO_PLACE_FOR)
    assert pulled_out(session) == 2


def test_a_path_that_is_given_while_it_pulls_out_is_followed_at_once(anna):
    session = anna()
    ask(session)
    session.let_pass(1.0)
    handle = session.navigator.send(ExePathGoal(Path.from_poses([session.robot.pose, Pose.planar(-3.0, 0.0)])))
    session.let_pass(0.5)
    assert handle.status is GoalStatus.ACTIVE, handle.result
    assert session.server.runtime.gate.holder.startswith("exe_path")
    assert handle.wait().success
    session.way = None
    session.let_pass(6.0)
    assert session.robot.pose.x < -2.5, "it belongs where its goal was"


def test_a_goal_that_comes_while_it_drives_back_takes_over(anna):
    session = anna()
    ask(session)
    session.let_pass(3.0)
    session.way = None
    session.let_pass(4.0)
    back = session.server.move_base.unfinished
    assert len(back) == 1
    handle = session.navigator.send(MoveBaseGoal(Pose.planar(-3.0, 1.0)))
    assert handle.wait().success
    assert back[0].status is GoalStatus.CANCELED
    session.let_pass(5.0)
    assert session.robot.pose.x < -2.5


def test_a_drive_back_that_is_canceled_is_not_begun_again(anna):
    session = anna()
    ask(session)
    session.let_pass(3.0)
    session.way = None
    session.let_pass(4.0)
    session.navigator.cancel_all()
    place = session.robot.pose
    session.let_pass(6.0)
    assert session.robot.pose.distance_to(place) < 0.2
    assert not session.server.move_base.busy


@pytest.mark.parametrize("x", [0.2, 0.5])
def test_it_does_not_go_back_while_somebody_stands_there_and_stays_where_it_cannot(anna, x):
    session = anna()
    ask(session)
    session.let_pass(3.0)
    session.way, session.ben.asks = Announcement("", 0.0, np.array([(x, 0.0, 0.0)]), 0.0), False
    session.let_pass(5.0)
    assert session.robot.pose.y == pytest.approx(1.0, abs=0.05)
    session.planner.play(*[RuntimeError("no way")] * 20)
    session.way = None
    session.let_pass(60.0)
    assert sum("drives back" in text for text in said(session)) == MOST_RETURNS
    assert "stays here" in said(session)[-1]
