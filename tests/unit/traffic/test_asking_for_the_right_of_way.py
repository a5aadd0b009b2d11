"""A robot that is blocked where it meets robots that announce their ways asks for the right of way before all else."""

import numpy as np
import pytest

from mbf_abstract.actions.stuck_monitor import MOST_MEETINGS
from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, PluginKind
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import SharedChannel

USUAL = {"clear": ScriptedRecovery, "back_up": ScriptedRecovery}
RECOVERIES = USUAL | {"give_way": ScriptedRecovery}
GOAL = Pose.planar(2.0, 0.0)
BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a robot ahead")
STAMP = 0.0  # s; a robot is heard of for 3 s from the first look, longer than these tests meet it


def with_tree(session):
    options = TreeOptions(check_poses=False, second_planner_pause=0.0)
    return TreeExecutive(navigation_tree(options), session.navigator).run(GOAL)


def with_move_base(session):
    return session.navigator.send(MoveBaseGoal(GOAL, recovery_behaviors=("clear", "back_up"))).wait()


@pytest.fixture(params=[with_tree, with_move_base], ids=["tree", "move_base"])
def run(request):
    """``run(session)`` goes to the goal with each executive."""
    return request.param


@pytest.fixture
def make_session():
    """Make sessions of a robot at the origin that announces that it goes along x; all are closed at the end."""
    sessions = []

    def make(*others, recoveries=RECOVERIES, announces=True, **parameters):
        plugins = {"planner": ScriptedPlanner, "controller": ScriptedController}
        asked = {"planner_max_retries": 0, "controller_max_retries": 0}
        session = ScriptedSession(plugins | recoveries, **asked | parameters)
        sessions.append(session)
        if announces:
            traffic, channel = session.server.runtime.traffic, SharedChannel()
            traffic.connect("anna", channel)
            traffic.announce(robot("", 0.0, 2.0))
            for other in others:
                channel.publish(other)
        return session

    yield make
    for session in sessions:
        session.close()


def robot(name, x_from, x_to, y=0.0, remaining=None):
    x = np.linspace(x_from, x_to, 20)
    way = np.column_stack([x, np.full(20, y), np.zeros(20)])
    return Announcement(name, STAMP, way, abs(x_to - x_from) if remaining is None else remaining)


HEAD_ON = robot("ben", 4.0, -4.0)


def recoveries(session):
    return [event.data["plugin"] for event in session.recorded(EventKind.RECOVERY)]


def test_it_is_asked_for_at_the_first_failure_of_driving(make_session, run):
    session = make_session(HEAD_ON)
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["give_way"]


def test_it_is_asked_for_at_the_first_failure_of_planning(make_session, run):
    session = make_session(HEAD_ON)
    session.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "a robot ahead"), straight_plan)
    assert run(session).success
    assert recoveries(session) == ["give_way"]


@pytest.mark.parametrize(
    ("others", "parameters"),
    [
        ([], {}),
        ([robot("ben", 1.0, 9.0)], {}),
        ([robot("ben", -1.0, 9.0)], {}),
        ([robot("ben", -1.0, -9.0)], {}),
        ([robot("ben", 4.0, -4.0, y=1.0)], {}),
        ([robot("ben", 1.0, 1.0, remaining=0.0)], {}),
        ([HEAD_ON], {"right_of_way_behavior": ""}),
    ],
    ids=[
        "nobody",
        "one that drives ahead",
        "one that follows",
        "one that has passed",
        "one that passes beside",
        "one that stays",
        "no behaviour for it",
    ],
)
def test_otherwise_the_usual_recoveries_come_first(make_session, run, others, parameters):
    session = make_session(*others, **parameters)
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["clear"]


def test_it_waits_too_for_one_ahead_that_is_letting_others_pass(make_session, run):
    session = make_session(Announcement("ben", STAMP, np.array([[1.0, 0.1, 0.0]]), 8.0))
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["give_way"]


def test_robots_meet_at_a_crossing(make_session, run):
    across = Announcement("ben", STAMP, np.array([[1.0, -2.0, 0.0], [1.0, 2.0, 0.0]]), 4.0)
    session = make_session(across)
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["give_way"]


def test_robots_meet_where_their_ways_come_nearer_than_the_distance(make_session, run):
    session = make_session(robot("ben", 4.0, -4.0, y=1.0), right_of_way_distance=1.1)
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["give_way"]


def test_it_is_not_asked_for_after_a_failure_that_no_other_robot_causes(make_session, run):
    session = make_session(HEAD_ON)
    session.controller.play(ControlResult(ExePathOutcome.MISSED_PATH, "beside it"), session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["clear"]


def test_a_robot_that_stays_blocked_goes_on_with_its_usual_recoveries(make_session, run):
    session = make_session(HEAD_ON, stuck_failures=0)
    session.controller.play(*[BLOCKED] * (MOST_MEETINGS + 2), session.controller.follow)
    assert run(session).success
    assert recoveries(session)[: MOST_MEETINGS + 1] == ["give_way"] * MOST_MEETINGS + ["clear"]


def test_it_is_none_of_the_recoveries_that_move_base_runs_by_default(make_session):
    session = make_session()
    session.controller.play(BLOCKED, BLOCKED, BLOCKED)
    assert not session.navigator.send(MoveBaseGoal(GOAL)).wait().success
    assert recoveries(session) == ["clear", "back_up"]


def test_a_robot_that_announces_nothing_runs_it_like_any_other_recovery(make_session):
    session = make_session(announces=False)
    session.controller.play(BLOCKED, BLOCKED, BLOCKED, BLOCKED)
    assert not session.navigator.send(MoveBaseGoal(GOAL)).wait().success
    assert recoveries(session) == list(RECOVERIES)


def test_without_a_recovery_of_that_name_the_usual_ones_are_run(make_session, run):
    session = make_session(HEAD_ON, recoveries=USUAL)
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["clear"]


def test_another_behaviour_can_be_named_for_it(make_session, run):
    session = make_session(
        HEAD_ON, recoveries=RECOVERIES | {"step_aside": ScriptedRecovery}, right_of_way_behavior="step_aside"
    )
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["step_aside"]


def test_one_that_is_quarantined_refuses_no_goal_unless_it_is_named(make_session):
    for named, refused in ((None, False), ("give_way", True)):
        session = make_session(HEAD_ON, right_of_way_behavior=named)
        plugin = session.server.plugins.find(PluginKind.RECOVERY, "give_way")
        user = object()
        assert plugin.acquire(user, lambda: True)
        plugin.quarantine(user, "it hangs")
        session.controller.play(BLOCKED, session.controller.follow)
        handle = session.navigator.send(MoveBaseGoal(GOAL, recovery_behaviors=("clear",)))
        assert (handle.status is GoalStatus.REJECTED) == refused
        assert handle.wait().success != refused
        assert recoveries(session) == ([] if refused else ["clear"])


def test_a_behaviour_that_is_not_loaded_refuses_a_goal_of_move_base(make_session):
    session = make_session(right_of_way_behavior="step_aside")
    handle = session.navigator.send(MoveBaseGoal(GOAL))
    assert handle.status is GoalStatus.REJECTED
    assert "step_aside" in handle.wait().message


class ShortSighted(ScriptedRecovery):
    """It sees others as ``give_way`` with a distance of 0.6 m does."""

    meeting_distance = 0.6


@pytest.mark.parametrize(("distance", "noted"), [(None, False), (0.6, False), (0.8, True)])
def test_a_behaviour_that_sees_less_than_what_it_is_asked_for_is_noted(distance, noted):
    plugins = {"planner": ScriptedPlanner, "give_way": ShortSighted}
    with ScriptedSession(plugins, right_of_way_distance=distance) as session:
        text = "right_of_way_distance 0.8 m is more than the distance 0.6 m of the behaviour that is run for it"
        assert [text in note for note in session.server.notes] == [True] * noted


@pytest.mark.parametrize(("y", "expected"), [(0.5, "give_way"), (0.7, "clear")])
def test_robots_meet_at_the_distance_from_which_the_behaviour_sees_others(make_session, run, y, expected):
    session = make_session(robot("ben", 4.0, -4.0, y=y), recoveries=USUAL | {"give_way": ShortSighted})
    session.controller.play(BLOCKED, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == [expected]


def test_where_recovery_is_off_move_base_does_not_ask(make_session):
    session = make_session(HEAD_ON, recovery_enabled=False)
    session.controller.play(BLOCKED)
    assert not with_move_base(session).success
    assert recoveries(session) == []
