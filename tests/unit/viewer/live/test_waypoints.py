"""Waypoints that are placed on the page: listed, removed, driven with the action for them, canceled."""

import math

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from terrain.viewer.live.controls import MAX_WAYPOINTS, Placing
from terrain.viewer.live.waypoint_list import NO_WAYPOINTS, waypoints_html

DOWN = (0.0, 0.0, -1.0)


def above(x, y):
    return np.array([x, y, 50.0]), DOWN


def place(run, *places):
    run.controls.placing = Placing.WAYPOINT
    for one in places:
        run.controls.place(above(*one))


def test_the_robot_visits_the_waypoints_in_their_order_instead_of_its_goal(steered):
    run = steered()
    run.at(1.0, lambda: place(run, (5.0, 6.0), (5.0, 4.0)), run.controls.drive_waypoints)

    result = run.visit_goals()

    assert result.success and "2 visit(s) made" in result.message
    assert np.hypot(result.final_pose.x - 5.0, result.final_pose.y - 4.0) < 0.5
    finished = [event.data["outcome_name"] for event in run.events(EventKind.GOAL_FINISHED, source="move_base")]
    assert finished == ["CANCELED", "SUCCESS", "SUCCESS"]
    assert [(round(goal.x), round(goal.y)) for goal in run.session.recorder.goals[1:]] == [(5, 6), (5, 4)]
    assert len(run.sequence.arrivals) == 2 and max(one.distance_m for one in run.sequence.arrivals) < 0.5
    assert run.sequence.target is None


@pytest.mark.parametrize("executive", ["move_base", "navigation"])
def test_waypoints_that_are_canceled_leave_the_robot_standing(steered, executive):
    run = steered(executive)
    run.at(1.0, lambda: place(run, (8.0, 8.0), (8.0, 2.0)), lambda: run.controls.drive_waypoints(3))
    run.at(3.0, run.controls.cancel)
    run.at(4.5, lambda: run.controls.end("enough"))

    result = run.visit_goals()

    assert result.outcome_name == "CANCELED" and result.message == "canceled in the live view"
    assert run.poses[3.6].position == pytest.approx(run.poses[4.5].position, abs=0.01)
    assert len(run.session.recorder.goals) == 2, "the second waypoint was never begun"


def test_waypoints_have_the_scenarios_time_limit_each_and_the_message_has_that_of_all(steered, meadow):
    run = steered()
    run.session.scenario = meadow.model_copy(update={"time_limit": 1.0})
    run.at(2.0, lambda: place(run, (8.0, 8.0), (8.0, 2.0)), run.controls.drive_waypoints)

    result = run.visit_goals()

    (canceled,) = run.events(EventKind.GOAL_CANCEL, source="follow_waypoints")
    assert round(canceled.time) == 4
    assert result.outcome_name == "CANCELED" and result.message == "the time limit of 2 s"


def test_a_goal_replaces_waypoints_and_the_list_stays(steered):
    run = steered()
    run.at(1.0, lambda: place(run, (8.0, 8.0)), run.controls.drive_waypoints)
    run.at(2.0, lambda: run.controls.go_to_pose(Pose.planar(4.5, 5.0)))

    result = run.visit_goals()

    assert result.success and np.hypot(result.final_pose.x - 4.5, result.final_pose.y - 5.0) < 0.5
    assert len(run.controls.waypoints) == 1


def test_the_list_loses_one_or_all_and_is_never_endless(steered):
    run = steered()
    place(run, (4.0, 4.0), (5.0, 4.0), (6.0, 4.0))
    run.controls.remove_waypoint(2)
    run.controls.remove_waypoint(7)
    assert [round(one.x) for one in run.controls.waypoints] == [4, 6]
    run.controls.clear_waypoints()
    with pytest.raises(ValueError, match="no waypoints to drive"):
        run.controls.drive_waypoints()
    for _ in range(MAX_WAYPOINTS):
        run.controls.add_waypoint(Pose.planar(1.0, 1.0))
    with pytest.raises(ValueError, match=f"{MAX_WAYPOINTS} waypoints already"):
        run.controls.add_waypoint(Pose.planar(1.0, 1.0))


def test_a_waypoint_faces_on_from_the_last_one_or_where_the_drag_has_ended(steered):
    run = steered()
    place(run, (5.0, 5.0), (5.0, 7.0))
    run.controls.place(above(6.0, 7.0), above(4.0, 5.0))
    run.controls.place(above(6.0, 7.0), (np.array([6.0, 0.0, 50.0]), (0.0, 1.0, 0.5)))
    yaws = [one.yaw for one in run.controls.waypoints]
    assert yaws[1] == pytest.approx(math.pi / 2, abs=1e-6)
    assert yaws[2] == pytest.approx(-0.75 * math.pi, abs=1e-6)
    assert yaws[3] == pytest.approx(math.pi / 2, abs=1e-3), "a drag into the sky faces there"


def test_nothing_is_placed_where_a_click_is_nothing(steered):
    run = steered()
    run.controls.placing = Placing.NOTHING
    run.controls.place(above(5.0, 5.0))
    assert run.controls.waypoints == () and run.events(EventKind.CUSTOM) == []


def test_the_list_marks_the_waypoint_that_the_robot_goes_to():
    first, second = Pose.planar(1.0, 2.0, 0.5), Pose.planar(3.0, 4.0)
    html = waypoints_html((first, second), second)
    assert "· 1: 1.0, 2.0, 0.0 m, 29°" in html and "▶ 2: 3.0, 4.0" in html
    assert NO_WAYPOINTS in waypoints_html((), None)
