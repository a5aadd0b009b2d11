"""What a robot announces of the path it follows, and how long others believe it: each on a clock of its own."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.server.announcer import IDLE_TIME, LENGTH, Announcer
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import paths_conflict
from mbf_abstract.traffic.traffic import MAX_AGE, SharedChannel, Traffic


@pytest.fixture
def robot(make_session):
    """A session whose robot stands at the origin and drives along x, with ``announced()``: what it announces now."""
    session, channel = make_session(), SharedChannel()
    announcer = Announcer(session.server, "anna", channel)

    def announced():
        announcer.announce()
        return channel.latest()[0]

    session.announced = announced
    return session


def path(*x):
    return Path.from_poses([Pose.planar(value, 0.0) for value in x])


def drive(session, *x):
    handle = session.navigator.send(ExePathGoal(path(*x)))
    session.clock.sleep(0.5)
    return handle


def test_a_robot_that_is_given_a_path_announces_it(robot):
    drive(robot, 0.0, 1.0, 2.0, 3.0)
    announced = robot.announced()
    place = robot.robot.pose.x
    assert announced.path[0, 0] == pytest.approx(place, abs=0.02)
    assert announced.path[-1].tolist() == [3.0, 0.0, 0.0]
    assert announced.remaining == pytest.approx(3.0 - place, abs=0.02)


def test_of_a_path_of_two_poses_the_stretch_ahead_is_announced_whole_and_without_a_detour(robot):
    drive(robot, 0.0, 20.0)
    announced = robot.announced()
    place = robot.robot.pose.x
    assert announced.path[-1, 0] == pytest.approx(place + LENGTH, abs=0.02)
    assert announced.remaining == pytest.approx(20.0 - place, abs=0.02)
    assert (np.diff(announced.path[:, 0]) >= 0.0).all()


def test_what_lies_before_a_path_remains_too(robot):
    drive(robot, 1.0, 5.0)
    assert robot.announced().remaining == pytest.approx(5.0 - robot.robot.pose.x, abs=0.02)


def test_a_robot_without_a_goal_goes_nowhere_after_its_idle_time_and_not_before(robot):
    handle = drive(robot, 0.0, 5.0)
    assert robot.announced().remaining > 0.0
    handle.cancel()
    handle.wait()
    ended = robot.clock.now()
    robot.announced()
    robot.clock.sleep(IDLE_TIME - 0.5)
    assert robot.announced().remaining > 0.0
    robot.clock.sleep_until(ended + IDLE_TIME)
    assert robot.announced().remaining == 0.0


@pytest.mark.parametrize(("behavior", "expected"), [(None, 0.7), ("", 0.0)])
def test_how_far_it_keeps_from_others_is_announced_where_it_runs_something_in_meetings(
    make_session, behavior, expected
):
    plugins = {"planner": ScriptedPlanner, "controller": ScriptedController, "give_way": ScriptedRecovery}
    session, channel = make_session(plugins, right_of_way_behavior=behavior, right_of_way_distance=0.7), SharedChannel()
    Announcer(session.server, "anna", channel).announce()
    assert channel.latest()[0].distance == expected


def test_a_question_about_another_place_is_not_announced(robot):
    drive(robot, 0.0, 20.0)
    assert robot.navigator.send(GetPathGoal(Pose.planar(0.0, 30.0))).wait().success
    assert robot.announced().path[-1, 1] == 0.0
    robot.navigator.cancel_all()
    robot.clock.sleep(IDLE_TIME)
    robot.announced()
    robot.planner.play(slow(robot.clock, 2.0, RuntimeError("late")))
    asked = robot.navigator.send(GetPathGoal(Pose.planar(0.0, 30.0)))
    robot.clock.sleep(1.0)
    assert len(robot.announced().path) == 1
    asked.wait()


def test_a_new_path_is_announced_while_the_robot_drives_on(robot):
    drive(robot, 0.0, 20.0)
    robot.announced()
    drive(robot, 0.0, 5.0)
    announced = robot.announced()
    assert announced.path[-1, 0] == 5.0
    assert announced.remaining == pytest.approx(5.0 - robot.robot.pose.x, abs=0.02)


def test_another_goal_ends_a_meeting(robot):
    """What is announced is what remained when they met, but of this goal."""
    traffic = robot.server.runtime.traffic
    drive(robot, 0.0, 20.0)
    robot.announced()
    traffic._channel.publish(Announcement("ben", 0.0, np.array([(4.0, 0.0, 0.0), (-4.0, 0.0, 0.0)]), 8.0))
    assert traffic.meet(robot.clock.now(), 0.8, 5.0)
    before = robot.announced().remaining
    drive(robot, 0.0, 19.5)
    assert robot.announced().remaining == before
    drive(robot, 0.0, 5.0)
    assert robot.announced().remaining < 5.0


def test_the_path_is_kept_during_a_recovery_and_forgotten_by_an_idle_robot(robot):
    drive(robot, 0.0, 5.0)
    robot.announced()
    robot.navigator.cancel_all()
    robot.recovery.play(slow(robot.clock, 2.0 * IDLE_TIME, RecoveryResult(RecoveryOutcome.SUCCESS)))
    recovery = robot.navigator.send(RecoveryGoal("recovery"))
    robot.clock.sleep(1.5 * IDLE_TIME)
    assert robot.announced().path[-1, 0] == 5.0
    recovery.wait()
    robot.announced()
    robot.clock.sleep(IDLE_TIME)
    announced = robot.announced()
    assert (len(announced.path), announced.remaining) == (1, 0.0)


def test_a_path_that_is_not_known_in_the_global_frame_is_not_announced(robot):
    lost = Path.from_poses([Pose.planar(x, 0.0, frame_id="elsewhere") for x in (0.0, 1.0)])
    robot.navigator.send(ExePathGoal(lost))
    assert len(robot.announced().path) == 1


# ------------------------------------------------------------------------------------------ what others believe
def state(stamp, z=0.0):
    return Announcement("", stamp, np.array([(0.0, 0.0, z), (3.0, 0.0, z)]), 3.0)


def pair():
    channel, anna, ben = SharedChannel(), Traffic(), Traffic()
    anna.connect("anna", channel)
    ben.connect("ben", channel)
    return anna, ben


@pytest.mark.parametrize("origin", [-5000.0, 5000.0])
def test_clocks_of_other_origins_make_no_announcement_younger_or_older(origin):
    anna, ben = pair()
    for time in (0.0, 2.0, 4.0, 6.0):
        anna.announce(state(origin + time))
        assert [one.name for one in ben.others(time)] == ["anna"]
    assert [one.name for one in ben.others(6.0 + MAX_AGE)] == ["anna"]
    assert ben.others(6.1 + MAX_AGE) == ()


def test_announcements_age_also_while_nobody_asks_for_them():
    anna, ben = pair()
    anna.announce(state(0.0))
    for time in (100.0, 102.0, 104.0):
        ben.announce(state(time))
    assert ben.others(104.0) == ()


def test_a_robot_on_a_bridge_is_not_in_the_way_of_one_below_it():
    assert paths_conflict(state(0.0), state(0.0, z=0.2), 0.8, 5.0)
    assert not paths_conflict(state(0.0), state(0.0, z=4.0), 0.8, 5.0)
    assert not paths_conflict(state(0.0), state(0.0, z=2.5), 5.0, 5.0)
