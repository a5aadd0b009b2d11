"""How a controller execution arrives and reports; F-numbers are facts of the upstream tests, with their ids."""

import math

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.events import EventKind
from mbf_abstract.execution.arrival import ArrivalCheck
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_area import DiscArea, PoseSetArea
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome as Outcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import ScriptedController

FAILS = ControlResult(Outcome.BLOCKED_PATH, "a chair")


def _coasting(session, seconds):
    """Odometry by which the robot still moves for a while after the zero command."""
    real = session.robot.odometry
    stopped_at = []

    def odometry():
        if session.robot.command.is_stopped() and session.robot.commands:
            stopped_at.append(session.clock.now())
            if session.clock.now() - stopped_at[0] < seconds:
                return Odometry(Twist.planar(0.3), session.clock.now())
        return real()

    return odometry


def test_with_force_stop_the_goal_succeeds_only_when_the_robot_stands(make_session, states):
    session = make_session(force_stop_at_goal=True)
    session.robot.odometry = _coasting(session, 1.0)
    session.controller.play(drive(0.5))
    assert session.navigator.exe_path(session.path_to(1.0), dist_tolerance=0.3).success
    assert states(session, "controller_execution")[-2:] == ["stopping", "arrived_goal"]


def _sliding_back(session, distances):
    """Odometry of a robot on ice: each time it is stopped it slides back for 0.5 s, by the next of ``distances``."""
    slides, robot, real = iter(distances), session.robot, session.robot.odometry
    stopped_at, slid = None, 0.0

    def odometry():
        nonlocal stopped_at, slid
        if not robot.command.is_stopped():
            stopped_at = None
        elif robot.commands and stopped_at is None:
            stopped_at, slid = session.clock.now(), slid + next(slides, 0.0)
            robot.T_map_odom = Transform((-slid, 0.0, 0.0), parent="map", child="odom")
        if stopped_at is not None and session.clock.now() - stopped_at < 0.5:
            return Odometry(Twist.planar(-0.3), session.clock.now())
        return real()

    return odometry


@pytest.mark.parametrize(("slides", "times_stopped"), [([], 1), ([0.1], 2), ([0.1] * 9, 2), ([0.02, 0.1, 0.12], 3)])
@pytest.mark.parametrize("who", ["mbf_tolerance_exclusive", "mbf_tolerance_check", ""])
def test_a_robot_that_slides_out_of_the_tolerance_while_it_stops_is_driven_in_farther(
    make_session, states, slides, times_stopped, who
):
    session = make_session(force_stop_at_goal=True, **({who: True} if who else {}))
    session.robot.odometry = _sliding_back(session, slides)
    session.controller.play(drive(0.2))
    result = session.navigator.exe_path(session.path_to(1.0), dist_tolerance=0.3)
    assert result.success
    assert states(session, "controller_execution").count("stopping") == times_stopped
    assert abs(session.robot.pose.x - 1.0) < 0.3


def test_a_robot_that_slides_away_from_its_goal_each_time_has_missed_it(make_session, states):
    session = make_session(force_stop_at_goal=True, mbf_tolerance_exclusive=True)
    session.robot.odometry = _sliding_back(session, [0.4] * 9)
    session.controller.play(drive(0.2))
    result = session.navigator.exe_path(session.path_to(1.0), dist_tolerance=0.3)
    assert result.outcome == Outcome.MISSED_GOAL
    assert "m from its goal: the robot slid away each of the 4 times it stopped" in result.message
    assert states(session, "controller_execution")[-1] == "missed_goal"
    assert session.robot.command.is_stopped()


def test_a_newer_goal_elsewhere_may_be_slid_away_from_as_often_as_the_first(make_session):
    session = make_session(force_stop_at_goal=True, mbf_tolerance_exclusive=True)
    session.robot.odometry = _sliding_back(session, [0.4] * 5)
    session.controller.play(drive(0.2))
    first = session.navigator.send(ExePathGoal(session.path_to(1.0), dist_tolerance=0.3))
    while len([1 for event in session.recorded(EventKind.STATE_CHANGED) if event.data["new"] == "stopping"]) < 3:
        session.clock.sleep(0.1)
    session.clock.sleep(0.6)
    second = session.navigator.send(ExePathGoal(session.path_to(3.0), dist_tolerance=0.3))
    assert second.wait().success and first.wait().outcome == Outcome.CANCELED


def test_a_controller_that_has_missed_the_goal_is_not_asked_again(make_session, states):
    session = make_session(controller_max_retries=-1, controller_patience=5.0)
    session.controller.play(drive(), ControlResult(Outcome.MISSED_GOAL, "past it"), drive())
    result = session.navigator.exe_path(session.path_to(5.0))
    assert (result.outcome, result.message) == (Outcome.MISSED_GOAL, "past it")
    assert states(session, "controller_execution")[-1] == "missed_goal"
    assert (len(session.controller.requests), session.robot.command.is_stopped()) == (2, True)


def test_a_robot_that_gets_no_farther_in_stops_where_it_is(make_session, states):
    """It slid by 0.1 m and can come back to 0.27 m at most: within its tolerance, but not by as much as it slid."""
    session = make_session(force_stop_at_goal=True, mbf_tolerance_exclusive=True)
    session.robot.odometry = _sliding_back(session, [0.1])
    session.controller.play(*[drive(0.2)] * 83, drive(0.001))
    result = session.navigator.exe_path(session.path_to(1.0), dist_tolerance=0.3)
    assert result.success
    driven = ["started", "controlling", "stopping", "controlling", "arrived_goal"]
    assert states(session, "controller_execution") == driven
    assert 0.2 < abs(session.robot.pose.x - 1.0) < 0.3


def test_a_robot_that_does_not_come_to_rest_at_its_goal_is_no_success(make_session):
    session = make_session(force_stop_at_goal=True, controller_patience=2.0)
    session.robot.odometry = _coasting(session, 1000.0)
    session.controller.play(drive(0.5))
    result = session.navigator.exe_path(session.path_to(1.0), dist_tolerance=0.3)
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert "still moves at 0.30 m/s" in result.message


def test_without_force_stop_the_goal_succeeds_at_once_and_the_watchdog_stops_the_robot(make_session):
    session = make_session(force_stop_at_goal=False)
    session.controller.play(drive(0.5))
    assert session.navigator.exe_path(session.path_to(1.0), dist_tolerance=0.3).success
    assert session.robot.command == Twist.planar(0.5)


@pytest.mark.parametrize(
    ("parameters", "plugin_says", "arrives_at"),
    [
        ({}, True, 0.0),  # the plugin alone
        ({}, False, None),
        ({"mbf_tolerance_check": True}, True, 0.0),  # either
        ({"mbf_tolerance_check": True}, False, 0.7),
        ({"mbf_tolerance_exclusive": True}, True, 0.7),  # the tolerances alone
        ({"mbf_tolerance_exclusive": True}, False, 0.7),
    ],
)
def test_who_decides_that_the_robot_has_arrived(make_session, parameters, plugin_says, arrives_at):
    session = make_session(force_stop_at_goal=False, **parameters)
    session.controller.is_goal_reached = lambda pose, distance, angle: plugin_says
    session.controller.play(drive(0.5))
    handle = session.navigator.send(ExePathGoal(session.path_to(1.0), dist_tolerance=0.3, angle_tolerance=0.1))
    session.clock.sleep(10.0)
    if arrives_at is None:
        assert not handle.done
        handle.cancel()
        handle.wait()
    else:
        assert handle.result.success
        assert handle.result.final_pose.x == pytest.approx(arrives_at, abs=0.06)


# F086 to F092: a goal checker's tolerances. Upstream MBF compares strictly (mbf.md 4.4), so the limit is not inside.
def driven_to_its_end():
    return PathTracker(Path.from_poses([Pose.planar(0.0, 0.0)]))


@pytest.mark.parametrize("parameters", [{"mbf_tolerance_check": True}, {"mbf_tolerance_exclusive": True}, {}])
def test_a_path_that_ends_where_it_begins_is_driven_before_the_robot_has_arrived(make_session, parameters):
    session = make_session(**parameters)
    session.controller.is_goal_reached = lambda pose, distance, angle: not parameters and session.clock.now() > 9.0
    there_and_back = [0.5] * 60 + [-0.5] * 60
    session.controller.play(*(ControlResult(Outcome.SUCCESS, "", Twist.planar(speed)) for speed in there_and_back))
    out_and_back = Path.from_points([(0, 0, 0), (1.5, 0, 0), (0, 0, 0)])
    assert session.navigator.exe_path(out_and_back, dist_tolerance=0.1, angle_tolerance=4.0).success
    assert max(command.vx for _, command in session.robot.commands) == 0.5
    assert session.clock.now() > 5.5


def test_a_robot_that_turns_and_drives_without_getting_farther_is_ended_by_default(make_session):
    session = make_session()
    to_and_fro = [Twist.planar(0.3, wz=1.0)] * 20 + [Twist.planar(-0.3, wz=1.0)] * 20
    session.controller.play(*(ControlResult(Outcome.SUCCESS, "", command) for command in to_and_fro * 50))
    result = session.navigator.exe_path(Path.from_points([(0, 0, 0), (5, 0, 0)]))
    assert result.outcome == Outcome.OSCILLATION
    assert "no progress in 60 s" in result.message


@pytest.mark.parametrize(
    ("x", "y", "yaw", "arrived"),
    [
        (0.0, 0.0, 0.0, True),  # F086
        (1.0, 0.0, 0.0, False),  # F087
        (0.0, 1.0, 0.0, False),
        (0.0, 0.0, 1.0, False),
        (0.25, 0.0, 0.0, False),  # F090: ours is exclusive
        (0.25 - 1e-9, 0.0, 0.0, True),
        (0.25 + 1e-9, 0.0, 0.0, False),  # F091
    ],
)
def test_a_pose_is_inside_the_tolerances_or_not(x, y, yaw, arrived):
    check = ArrivalCheck(Pose.planar(0.0, 0.0), 0.25, 0.25, "exclusive")
    for plugin_agrees in (True, False):
        assert check.reached(Pose.planar(x, y, yaw), driven_to_its_end(), plugin_agrees) is arrived


def test_f088_headings_are_compared_around_the_circle():
    assert ArrivalCheck(Pose.planar(0, 0, 3.14), 0.25, 0.25).within(Pose.planar(0, 0, -3.14), driven_to_its_end())


SLOPE = Pose((0.0, 0.0, 0.0), (0.0, math.sin(-0.2), 0.0, math.cos(-0.2)))  # nose up by 0.4 rad


@pytest.mark.parametrize(
    ("pose", "goal", "arrived"),
    [
        (Pose.planar(0.0, 0.0), Pose.planar(0.0, 0.0, z=0.4), True),  # a goal above the ground, a robot below
        (Pose.planar(0.0, 0.0, z=0.4), Pose.planar(0.0, 0.0), True),
        (SLOPE, Pose.planar(0.0, 0.0), True),  # a goal that does not know the slope
        (Pose.planar(0.0, 0.0), Pose.planar(0.3, 0.0, z=0.4), False),
        (Pose.planar(0.0, 0.0), Pose.planar(0.0, 0.0, z=2.0), False),  # on another storey
        (Pose.planar(0.0, 0.0), Pose.planar(0.0, 0.0, 0.3, z=0.4), False),
    ],
)
@pytest.mark.parametrize("area", [False, True])
def test_heights_and_slopes_that_the_goal_does_not_know_do_not_count(pose, goal, arrived, area):
    around = PoseSetArea((goal,), 0.2499, 0.2499) if area else None
    check = ArrivalCheck(goal, 0.25, 0.25, "exclusive", around)
    assert check.reached(pose, driven_to_its_end(), plugin_agrees=True) is arrived


def test_on_level_maps_no_height_counts():
    goal = Pose.planar(0.0, 0.0, z=7.0)
    for area in (None, DiscArea(goal, 0.25)):
        level = ArrivalCheck(goal, 0.25, 0.25, "exclusive", area, same_storey=math.inf)
        assert level.reached(Pose.planar(0.2, 0.0), driven_to_its_end(), False)
        assert not level.reached(Pose.planar(0.3, 0.0), driven_to_its_end(), False)


def test_on_level_maps_a_path_may_climb_to_its_goal():
    climbing = PathTracker(Path.from_points([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (5.0, 0.0, 2.0)]))
    for x in (0.0, 2.5, 5.0):
        climbing.update((x, 0.0, 0.0))
    check = ArrivalCheck(Pose.planar(5.0, 0.0, z=2.0), 0.25, 0.25, "exclusive", same_storey=math.inf)
    assert check.reached(Pose.planar(5.0, 0.0), climbing, False)


@pytest.mark.parametrize("velocity", [Twist.planar(1.0), Twist.planar(0.0, 1.0), Twist.planar(wz=1.0)])
@pytest.mark.parametrize("force_stop", [True, False])
def test_f089_speed_at_the_goal_counts_only_with_force_stop(make_session, velocity, force_stop):
    session = make_session(force_stop_at_goal=force_stop, controller_patience=1.0)
    session.robot.odometry = lambda: Odometry(velocity, session.clock.now())
    assert session.navigator.exe_path(Path.from_points([(0, 0, 0), (0.01, 0, 0)])).success is not force_stop


def test_the_lease_goes_to_one_goal_only(make_session):
    session = make_session({"controller": ScriptedController, "other": ScriptedController})
    first = session.navigator.send(ExePathGoal(session.path_to(9.0), controller="controller"))
    session.clock.sleep(0.5)
    second = session.navigator.send(ExePathGoal(session.path_to(9.0), controller="other", concurrency_slot=1))
    result = second.wait()
    assert result.outcome == Outcome.FAILURE
    assert "driven by exe_path controller" in result.message
    assert not first.done
    first.cancel()
    first.wait()


def test_feedback_reports_where_the_robot_is_on_its_path(make_session):
    session = make_session()
    seen = []
    handle = session.navigator.send(ExePathGoal(session.path_to(2.0)))
    handle.add_feedback_callback(seen.append)
    handle.wait()
    session.clock.sleep(0.1)
    assert len(seen) > 50
    middle = seen[len(seen) // 2]
    assert middle.dist_to_goal == pytest.approx(2.0 - middle.current_pose.x, abs=0.02)
    assert middle.distance_along_path == pytest.approx(middle.dist_to_goal, abs=0.11)
    assert 0.0 < middle.time_to_goal < 10.0
    assert [f.distance_along_path for f in seen] == sorted((f.distance_along_path for f in seen), reverse=True)
    assert len(session.recorded(EventKind.LEASE_GRANTED)) == 1


def test_the_time_to_the_goal_is_right_soon_after_a_robot_that_turned_first_has_set_off(make_session):
    """It turns for two seconds and then drives at 0.5 m/s."""
    session, seen = make_session(), []
    session.controller.play(*[drive(0.0, wz=0.1)] * 40, drive(0.5, wz=0.0))
    handle = session.navigator.send(ExePathGoal(session.path_to(3.0)))
    handle.add_feedback_callback(seen.append)
    handle.wait()
    session.clock.sleep(0.1)
    assert all(math.isinf(feedback.time_to_goal) for feedback in seen[:40])
    soon = next(feedback for feedback in seen if feedback.distance_along_path < 2.8)
    assert soon.time_to_goal == pytest.approx(soon.distance_along_path / 0.5, rel=0.4)


def test_a_loop_ends_with_one_event_that_counts_its_cycles(make_session):
    session = make_session(controller_max_retries=-1)
    session.controller.play(FAILS, FAILS, drive())
    session.navigator.exe_path(session.path_to(1.0))

    (reported,) = session.memory.of_kind(EventKind.CONTROL_LOOP)
    assert (reported.source, reported.data["failed"]) == ("controller", 2)
    assert reported.data["cycles"] == len(session.controller.requests)
    assert reported.data["began"] < reported.time


@pytest.mark.parametrize(
    ("radius", "off", "tolerance"),
    [(2.0, 0.0, 0.5), (0.2, 0.0, 0.18), (0.6, 0.2, 0.36), (0.2, 0.3, 0.5)],
    ids=["a wide area", "a narrow one", "beside its middle", "outside"],
)
def test_a_controller_may_stop_short_of_an_end_inside_an_area_by_what_keeps_the_robot_inside(radius, off, tolerance):
    end, area = Pose.planar(3.0, 0.0), DiscArea(Pose.planar(3.0 + off, 0.0), radius)
    assert ArrivalCheck(end, 0.5, 0.1, area=area).dist_tolerance == pytest.approx(tolerance)
