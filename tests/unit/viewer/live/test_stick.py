"""Who holds the stick of the page: one visitor at a time, as long as the page reports it."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from terrain.viewer.live.stick import SILENCE, Stick


@pytest.fixture
def by_hand(request, steered):
    """A run with a stick; the wall's time is that of the run."""
    run = steered(getattr(request, "param", "move_base"))
    controls = run.controls
    stick = Stick(
        run.session.navigator.server, run.session.clock, controls.take_over, controls.note_end_of_teleoperation
    )
    run.session.loop.on_tick.append(lambda time: stick.step(controls.holding))
    return run, stick


def report(run, stick, visitor=1, turn=0.0, forward=1.0, delay=0.0):
    """What a page reports that has seen the heartbeat of ``delay`` s ago."""
    return stick.hold(visitor, turn, forward, run.session.clock.now() - delay)


def hold(run, stick, begin, end, turn=0.0, forward=1.0, visitor=1, delay=0.0):
    """Report it as a page does, ten times a second."""
    for tenth in range(round(10 * begin), round(10 * end)):
        run.at(0.1 * tenth, lambda: report(run, stick, visitor, turn, forward, delay))


def log(run):
    return [(e.data["what"], e.data.get("reason")) for e in run.events(EventKind.CUSTOM, source="live_view")]


def test_who_takes_the_stick_cancels_the_goal_and_the_robot_stands_afterwards(by_hand):
    run, stick = by_hand
    hold(run, stick, 2.0, 4.0, turn=0.5)
    run.at(4.0, lambda: stick.release(1))
    run.at(6.0, lambda: run.controls.end("enough"))

    result = run.visit_goals()

    assert result.outcome_name == "CANCELED" and "teleoperation in the live view" in result.message
    assert run.poses[2.5].distance_to(run.poses[4.0]) > 0.2
    assert run.poses[5.0].distance_to(run.poses[6.0]) < 0.01
    assert log(run)[:2] == [("teleoperation", None), ("end of teleoperation", "the stick was released")]


@pytest.mark.parametrize("by_hand", ["move_base", "navigation"], indirect=True)
def test_a_goal_that_was_asked_for_just_before_does_not_drive_the_robot_when_the_stick_is_released(by_hand):
    run, stick = by_hand
    run.at(
        2.0, lambda: run.controls.go_to_pose(Pose.planar(9.0, 8.0)), lambda: report(run, stick, turn=0.5, forward=0.0)
    )
    hold(run, stick, 2.1, 3.0, turn=0.5)
    run.at(3.0, lambda: stick.release(1))
    run.at(6.0, lambda: run.controls.end("enough"))

    run.visit_goals()

    assert len(run.session.recorder.goals) == 2, "the goal had begun"
    assert run.poses[3.5].distance_to(run.poses[6.0]) < 0.01


def test_goals_and_waypoints_of_others_are_refused_while_somebody_drives_and_accepted_afterwards(by_hand):
    run, stick = by_hand
    goal = Pose.planar(4.5, 5.0)
    hold(run, stick, 2.0, 4.0, turn=0.5, forward=0.0)
    run.at(3.0, lambda: run.controls.go_to_pose(goal))
    run.at(3.1, lambda: run.controls.add_waypoint(goal), run.controls.drive_waypoints)
    run.at(4.0, lambda: stick.release(1))
    run.at(6.0, lambda: run.controls.go_to_pose(goal))

    result = run.visit_goals()

    refused = [event for event in run.events(EventKind.CUSTOM) if event.data["what"] == "refused"]
    assert [event.data["message"].split(":")[1] for event in refused] == [" somebody drives the robot by hand"] * 2
    assert run.poses[4.5].distance_to(run.poses[6.0]) < 0.01
    assert result.success and run.session.recorder.goals[1:] == [goal]


def test_a_page_that_falls_silent_has_released_the_stick(by_hand):
    run, stick = by_hand
    hold(run, stick, 2.0, 3.0)
    run.at(5.0, lambda: run.controls.end("enough"))

    run.visit_goals()

    assert ("end of teleoperation", "the page that held the stick is silent") in log(run)
    (ended,) = [e.time for e in run.events(EventKind.CUSTOM) if e.data["what"] == "end of teleoperation"]
    assert ended - 2.9 == pytest.approx(SILENCE, abs=0.1)
    assert run.poses[4.0].distance_to(run.poses[5.0]) < 0.01


def test_the_page_reads_driving_only_once_the_robot_has_got_a_command(by_hand):
    run, stick = by_hand
    read = {}
    for taken in (2.0, 3.0):  # the second time the first one's answer is still known
        run.at(taken, lambda: report(run, stick), lambda: read.setdefault("taken", []).append(stick.status(False)))
        hold(run, stick, taken + 0.1, taken + 0.5)
        run.at(taken + 0.4, lambda: read.setdefault("later", []).append(stick.status(False)))
        run.at(taken + 0.5, lambda: stick.release(1))
    run.at(4.0, lambda: run.controls.end("enough"))

    run.visit_goals()

    assert read == {"taken": ["taking over"] * 2, "later": ["driving"] * 2}


def test_the_second_visitor_gets_the_stick_when_the_first_one_has_released_it(by_hand):
    run, stick = by_hand
    answers = []
    hold(run, stick, 2.0, 3.0)
    run.at(2.5, lambda: answers.append(report(run, stick, 2)), lambda: stick.release(2))
    run.at(3.0, lambda: stick.release(1), lambda: answers.append(report(run, stick, 2)))
    run.at(3.2, lambda: run.controls.end("enough"))

    run.visit_goals()

    assert answers == ["somebody else holds the stick", ""]


def test_over_a_slow_connection_the_robot_stops_when_the_last_report_is_too_old_however_late_it_comes(by_hand):
    run, stick = by_hand
    timeout = 0.3
    run.session.navigator.server.set_parameters(command_timeout=timeout)
    hold(run, stick, 2.0, 3.0, delay=0.2)  # the last heartbeat that was seen is that of 2.7 s
    answers = []
    for tenth in range(35, 45):  # reports that the connection has kept back, all of them in a burst
        run.at(0.1 * tenth, lambda: answers.append(stick.hold(1, 0.0, 1.0, 2.8)))
    run.at(5.0, lambda: run.controls.end("enough"))

    run.visit_goals()

    (ended,) = [e.time for e in run.events(EventKind.CUSTOM) if e.data["what"] == "end of teleoperation"]
    assert ended - 2.7 == pytest.approx(timeout, abs=0.1)
    assert run.poses[2.1].distance_to(run.poses[2.9]) > 0.1
    assert run.poses[3.5].distance_to(run.poses[5.0]) < 0.01
    assert len(answers) == 10 and all("too slow to drive" in answer for answer in answers)


def test_a_paused_robot_does_not_follow_the_stick(by_hand):
    run, stick = by_hand
    run.at(2.0, lambda: run.controls.hold(True))
    hold(run, stick, 3.0, 5.0)
    run.at(5.0, lambda: stick.release(1), lambda: run.controls.end("enough"))

    run.visit_goals()

    assert stick.status(is_paused=True).startswith("paused")
    assert run.poses[3.0].position == pytest.approx(run.poses[5.0].position, abs=0.01)
    assert "teleoperation" not in [what for what, _ in log(run)]


def test_the_stick_at_its_end_asks_for_its_share_of_the_limits(by_hand):
    run, stick = by_hand
    run.session.navigator.server.set_parameters(max_vel_x=0.8, min_vel_x=-0.2, max_vel_theta=1.0)
    stick.share = 0.5
    speeds = {}
    run.session.loop.on_tick.append(
        lambda time: speeds.update({round(time, 1): run.session.navigator.server.runtime.gate.last_command})
    )
    hold(run, stick, 2.0, 3.0, turn=-1.0, forward=0.5)
    hold(run, stick, 3.0, 4.0, forward=-1.0)
    run.at(4.0, lambda: stick.release(1), lambda: run.controls.end("enough"))

    run.visit_goals()

    assert (speeds[2.8].vx, speeds[2.8].wz) == pytest.approx((0.2, -0.5))
    assert (speeds[3.8].vx, speeds[3.8].wz) == pytest.approx((-0.1, 0.0))
