"""What the page asks for reaches the run between two steps of the world, and does what its button says."""

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from terrain.scenarios.faults import LocalizationJump, SensorFault
from terrain.viewer.live.controls import MAX_WAITING

DOWN = (0.0, 0.0, -1.0)


def above(x, y):
    return np.array([x, y, 50.0])


def end(run):
    return lambda: run.controls.end("enough")


def reported(run):
    return [event.data["what"] for event in run.events(EventKind.CUSTOM, source="live_view")]


def test_the_robot_goes_where_the_click_hits_the_ground_instead_of_to_the_scenarios_goal(steered):
    run = steered()
    run.at(2.0, lambda: run.controls.place((above(5.0, 7.0), DOWN)))

    result = run.visit_goals()

    assert result.success, result.message
    assert np.hypot(result.final_pose.x - 5.0, result.final_pose.y - 7.0) < 0.5
    clicked = run.session.recorder.goals[-1]
    assert clicked.z == pytest.approx(run.session.world.height_at(5.0, 7.0), abs=1e-3)
    finished = [event.data["outcome_name"] for event in run.events(EventKind.GOAL_FINISHED, source="move_base")]
    assert finished == ["CANCELED", "SUCCESS"]
    assert reported(run) == ["new goal"]


def test_a_click_beside_the_ground_changes_nothing(steered):
    run = steered()
    run.at(2.0, lambda: run.controls.place((above(500.0, 0.0), DOWN)))

    assert run.visit_goals().success
    assert reported(run) == ["there is no ground where the click was"]
    assert len(run.session.recorder.goals) == 1


@pytest.mark.parametrize("executive", ["move_base", "navigation", "classic"])
def test_a_canceled_goal_leaves_the_robot_standing_and_the_run_waiting(steered, executive):
    run = steered(executive)
    run.at(2.0, run.controls.cancel)
    run.at(3.5, end(run))

    result = run.visit_goals()

    assert result.outcome_name == "CANCELED"
    assert run.poses[2.5].position == pytest.approx(run.poses[3.5].position, abs=0.01)


@pytest.mark.parametrize("executive", ["move_base", "navigation"])
def test_a_paused_robot_stands_until_it_is_released_and_then_arrives(steered, executive):
    run = steered(executive)
    run.at(2.0, lambda: run.controls.hold(True))
    run.at(5.0, lambda: run.controls.hold(False))

    assert run.visit_goals().success
    assert run.poses[3.0].position == pytest.approx(run.poses[5.0].position, abs=0.01)
    assert run.poses[2.0].distance_to(run.poses[6.0]) > 0.2


def test_a_goal_that_is_clicked_while_the_robot_is_held_waits_too(steered):
    run = steered()
    run.at(2.0, lambda: run.controls.hold(True))
    run.at(3.0, lambda: run.controls.place((above(5.0, 7.0), DOWN)))
    run.at(5.0, end(run))

    assert run.visit_goals().outcome_name == "CANCELED"
    assert run.poses[3.0].position == pytest.approx(run.poses[5.0].position, abs=0.01)


def test_the_chosen_planner_makes_the_plans_of_the_goals_to_come(steered):
    run = steered()
    run.at(1.0, lambda: run.controls.choose("cvp", "follower"), lambda: run.controls.place((above(5.0, 7.0), DOWN)))

    assert run.visit_goals().success
    assert [event.data["plugin"] for event in run.events(EventKind.PLAN)] == ["astar", "cvp"]


def test_injected_faults_befall_the_sensor_and_the_localisation_and_end(steered):
    run = steered()
    stamps, offsets = {}, {}
    run.session.loop.on_tick.append(
        lambda t: stamps.update({round(t, 1): run.session.simulation.latest["lidar"].stamp})
    )
    run.session.loop.on_tick.append(lambda t: offsets.update({round(t, 1): run.session.localization.offset}))
    silent = SensorFault(type="silent", sensor="lidar", start=2.0, end=3.0)
    run.at(1.5, lambda: run.controls.inject(silent))
    run.at(1.5, lambda: run.controls.inject(LocalizationJump(type="jump", dx=0.3, start=2.0, end=3.0)))
    run.at(4.0, end(run))

    run.visit_goals()

    assert stamps[2.9] < 2.01 and stamps[3.5] > 3.2
    assert (offsets[1.9][0], offsets[2.5][0], offsets[3.5][0]) == (0.0, 0.3, 0.0)
    assert reported(run) == ["fault", "fault", "end"]


def test_a_clicked_goal_has_the_scenarios_time_limit_of_its_own(steered, meadow):
    run = steered()
    run.session.scenario = meadow.model_copy(update={"time_limit": 2.0})
    run.at(3.0, lambda: run.controls.place((above(9.0, 8.0), DOWN)))

    result = run.visit_goals()

    canceled = [event for event in run.events(EventKind.GOAL_CANCEL, source="move_base")]
    assert [round(event.time) for event in canceled] == [2, 5]
    assert result.outcome_name == "CANCELED" and "time limit of 2 s" in canceled[1].data["reason"]


def test_of_too_many_commands_the_newest_are_done(steered):
    run, done = steered(), []
    for number in range(MAX_WAITING + 5):
        run.controls.post(lambda number=number: done.append(number))

    run.controls.work_off()

    assert done == list(range(5, MAX_WAITING + 5))


@pytest.mark.parametrize("executive", ["move_base", "navigation"])
@pytest.mark.parametrize("waypoints", [False, True])
def test_an_end_that_is_asked_for_while_a_goal_is_about_to_begin_ends_it(steered, executive, waypoints):
    run = steered(executive)
    run.sequence.on_goal.append(lambda goal: run.sequence.end("enough"))
    run.controls.waypoints = (Pose.planar(9.0, 8.0),)
    run.at(1.0, run.controls.drive_waypoints if waypoints else lambda: run.controls.go_to_pose(Pose.planar(9.0, 8.0)))

    result = run.visit_goals()

    assert result.outcome_name == "CANCELED" and result.message == "enough"
