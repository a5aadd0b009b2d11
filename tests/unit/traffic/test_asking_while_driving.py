"""A robot that drives, and plans beside that without finding a path, asks who stands on its path for room at once."""

from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.server.announcer import ASKS_FOR, Announcer
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, straight_plan
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import SharedChannel, Traffic

END = Pose.planar(4.5, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "somebody stands there")
BEN = Announcement("ben", 0.0, np.array([(3.0, 0.0, 0.0)]), 0.0, radius=0.2, makes_room=True)


class GiveWay(ScriptedRecovery):
    meeting_distance = 0.6


PLUGINS = {"planner": ScriptedPlanner, "controller": ScriptedController, "give_way": GiveWay}


@pytest.fixture
def anna(make_session):
    """Anna, who drives along x to ``END``; ``heard()`` is what she announces now, ``ben`` who stands on her path."""
    session, channel = make_session(PLUGINS, planner_max_retries=0), SharedChannel()
    announcer = Announcer(session.server, "anna", channel)
    session.ben = Traffic()
    session.ben.connect("ben", channel)

    def heard(**changes):
        session.ben.announce(replace(BEN, stamp=session.clock.now(), **changes))
        announcer.announce()
        return channel.latest()[0]

    session.heard = heard
    session.handle = session.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), END])))
    session.clock.sleep(0.5)
    assert not heard().asks
    return session


def plan(session, answer=NO_PATH, target=END, **goal):
    session.planner.play(answer)
    return session.navigator.send(GetPathGoal(target, **goal)).wait()


def test_the_first_plan_that_fails_asks_and_the_path_that_is_driven_stays_announced(anna):
    assert plan(anna).outcome == GetPathOutcome.NO_PATH_FOUND
    heard = anna.heard()
    assert heard.asks and not heard.wishes
    assert heard.path[-1].tolist() == [4.5, 0.0, 0.0] and heard.remaining > 3.0
    assert [one.name for one in anna.ben.rivals(anna.clock.now(), 0.6, 5.0)] == ["anna"], "who stands there is asked"
    assert anna.handle.result is None and len(anna.planner.requests) == 1, "the map that it drives on forgets nobody"


def test_it_is_said_once_in_the_event_log(anna):
    for _ in range(3):
        plan(anna)
        anna.heard()
    said = [event for event in anna.recorded(EventKind.CUSTOM) if event.source == "announcer"]
    assert [event.data["message"] for event in said] == ["finds no path beside its drive, and asks ben for room"]


def test_a_plan_that_succeeds_ends_it(anna):
    plan(anna)
    assert anna.heard().asks
    plan(anna, straight_plan)
    assert not anna.heard().asks


@pytest.mark.parametrize("end", ["canceled", "driven"])
def test_the_end_of_the_drive_ends_it(anna, end):
    plan(anna)
    assert anna.heard().asks
    if end == "canceled":
        anna.handle.cancel()
    anna.handle.wait(60.0)
    assert not anna.heard().asks
    anna.navigator.send(ExePathGoal(Path.from_poses([anna.robot.pose, Pose.planar(9.0, 0.0)])))
    anna.clock.sleep(0.5)
    assert not anna.heard().asks, "nor does another drive take it up"


def test_a_path_that_takes_over_before_a_plan_fails_asks_for_nothing(anna):
    anna.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), END])))
    anna.clock.sleep(0.5)
    assert not anna.heard().asks


@pytest.mark.parametrize(
    ("answer", "target", "goal"),
    [
        (NO_PATH, END, {"start_pose": Pose.planar(1.0, 0.0)}),
        (NO_PATH, Pose.planar(2.0, 3.0), {}),
        (PlanResult(GetPathOutcome.OUT_OF_MAP, "off the map"), END, {}),
        (PlanResult(GetPathOutcome.NO_PATH_FOUND, "an island", permanent=True), END, {}),
    ],
    ids=["from another place", "to another place", "off the map", "permanent"],
)
def test_other_questions_and_failures_ask_for_nothing(anna, answer, target, goal):
    assert not plan(anna, answer, target, **goal).success
    assert not anna.heard().asks


def test_a_plan_that_fails_counts_for_a_while_as_some_plan_only_where_their_path_is_blocked(anna):
    plan(anna)
    assert anna.heard().asks
    anna.clock.sleep(ASKS_FOR)
    assert not anna.heard().asks and not anna.handle.done
    plan(anna)
    assert anna.heard().asks


@pytest.mark.parametrize(
    "ben",
    [
        {"makes_room": False},
        {"cannot_yield": True},
        {"path": np.array([(3.0, 1.0, 0.0)])},
        {"path": np.array([(-1.0, 0.0, 0.0)])},
    ],
    ids=["has a goal", "no place to make room", "stands beside", "stands behind"],
)
def test_without_somebody_who_makes_room_on_the_path_nobody_is_asked(anna, ben):
    plan(anna)
    assert not anna.heard(**ben).asks


def test_a_robot_that_runs_nothing_in_meetings_asks_nobody(anna):
    anna.server.set_parameters(right_of_way_behavior="")
    plan(anna)
    assert not anna.heard().asks


def test_a_plan_to_another_place_does_not_end_it(anna):
    plan(anna)
    plan(anna, straight_plan, Pose.planar(2.0, 3.0))
    assert anna.heard().asks


def test_a_plan_that_fails_before_the_drive_does_not_count(make_session):
    session, channel = make_session(PLUGINS, planner_max_retries=0), SharedChannel()
    announcer = Announcer(session.server, "anna", channel)
    plan(session)
    channel.publish(BEN)
    session.navigator.send(ExePathGoal(Path.from_poses([Pose.planar(0.0, 0.0), END])))
    session.clock.sleep(0.5)
    announcer.announce()
    assert not channel.latest()[0].asks
