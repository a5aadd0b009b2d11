"""Recoveries of the core end with the same outcome and the same substance of text in the same situation on each map."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.relaxation import NO_SLACK, Slack
from mbf_abstract.outcomes import RecoveryOutcome
from tests.contract.recoveries.recovery_situations import (
    MOVING,
    START,
    PausedMotion,
    StuckMotion,
    before_the_wall,
    everything,
    nothing,
)


# ------------------------------------------------------------------------------------------------- those that move
@pytest.mark.parametrize(
    ("name", "options", "end"),
    [
        ("back_up", {"distance": 0.6}, (2.4, 3.0, 0.0)),
        ("drive_on_heading", {"distance": 0.6}, (3.6, 3.0, 0.0)),
        ("drive_on_heading", {"distance": -0.6}, (2.4, 3.0, 0.0)),
        ("rotate", {"angle": -1.5}, (3.0, 3.0, -1.5)),
        ("rotate", {"angle": 3.0 * math.pi}, (3.0, 3.0, math.pi)),
        ("move_away", {"clearance": 1.9}, (2.6, 3.0, 0.0)),
    ],
)
def test_finished_is_success_where_it_was_to_end(world, run, name, options, end):
    result, motion = run(name, world.map_of(before_the_wall), **options)
    assert result.outcome == RecoveryOutcome.SUCCESS and "done" in result.message
    assert (motion.end.x, motion.end.y) == pytest.approx(end[:2], abs=0.12)
    assert math.remainder(motion.end.yaw - end[2], math.tau) == pytest.approx(0.0, abs=0.15)
    assert motion.commands[-1] == Twist()


def test_a_robot_along_a_wall_turns_before_it_moves_away(world, run):
    result, motion = run("move_away", world.map_of(before_the_wall), start=Pose.planar(3.0, 3.0, 1.4), clearance=1.9)
    assert result.outcome == RecoveryOutcome.SUCCESS and motion.end.x == pytest.approx(2.6, abs=0.12)
    assert motion.end.yaw == pytest.approx(0.0, abs=0.15)


@pytest.mark.parametrize("name", MOVING)
def test_time_over_is_pat_exceeded(world, run, name):
    result, motion = run(name, world.map_of(before_the_wall), StuckMotion, time_limit=1)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED and "not done after 1 s" in result.message
    assert not motion.commands[0].is_stopped() and motion.commands[-1] == Twist()


@pytest.mark.parametrize("name", MOVING)
def test_a_gate_that_refuses_is_stopped(world, run, name):
    result, motion = run(name, world.map_of(before_the_wall), closed=True)
    assert result.outcome == RecoveryOutcome.STOPPED and "the velocity gate refused the command" in result.message
    assert motion.seconds < 0.06, "two refusals in a row, one control period apart, are enough"


@pytest.mark.parametrize("name", MOVING)
def test_a_refusal_for_the_time_of_a_pause_is_no_end(world, run, name):
    result, motion = run(name, world.map_of(before_the_wall), PausedMotion, time_limit=1)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED, "it drives on until its second is over"
    assert not motion.commands[0].is_stopped()


@pytest.mark.parametrize("cancel", [0.0, 0.3], ids=["before", "midway"])
@pytest.mark.parametrize("name", [*MOVING, "wait"])
def test_a_cancel_is_canceled_with_its_reason(world, run, name, cancel):
    result, motion = run(name, world.map_of(before_the_wall), cancel=cancel)
    assert result.outcome == RecoveryOutcome.CANCELED and "enough of this" in result.message
    assert motion.seconds <= cancel + 0.1
    assert cancel > 0.0 or all(command.is_stopped() for command in motion.commands)


@pytest.mark.parametrize("name", MOVING)
def test_a_lost_robot_is_a_tf_error(world, run, name):
    result, _ = run(name, world.map_of(before_the_wall), lost=True)
    assert result.outcome == RecoveryOutcome.TF_ERROR and "no fresh robot pose" in result.message


@pytest.mark.parametrize("name", MOVING)
def test_the_robot_stands_while_the_map_is_stale_and_the_reason_is_said(world, run, name):
    navigation_map = world.sensing(rate=0.5)
    world.see(navigation_map, (4.05, 3.05), stamp=-10.0)
    result, motion = run(name, navigation_map, time_limit=1)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    assert "not done after 1 s" in result.message and "observation source 'scan' is silent for" in result.message
    assert len(motion.commands) > 1 and all(command.is_stopped() for command in motion.commands)


@pytest.mark.parametrize(
    ("name", "start", "options"),
    [
        ("back_up", Pose.planar(4.2, 3.0, math.pi), {}),
        ("back_up", Pose.planar(3.7, 3.0, math.pi), {"distance": 2.0}),
        ("drive_on_heading", Pose.planar(4.2, 3.0), {}),
        ("drive_on_heading", Pose.planar(4.2, 3.0, math.pi), {"distance": -0.5}),
        ("drive_on_heading", Pose.planar(3.5, 3.0), {"distance": 2.0}),
    ],
)
def test_an_obstacle_ahead_is_impassable_with_the_place(world, run, name, start, options):
    result, motion = run(name, world.map_of(before_the_wall), start=start, **options)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert "an obstacle is in the way" in result.message and "would touch it at (4." in result.message
    assert motion.end.x <= 4.5 - 0.2 + 0.02


@pytest.mark.parametrize(("name", "sign"), [("back_up", -1.0), ("drive_on_heading", 1.0)])
def test_along_a_wall_it_does_not_creep_into_it(world, run, name, sign):
    """At 0.7 degrees each look ahead finds it less than a tenth of a cell deeper than it lies by then."""
    start = Pose.planar(4.0 - 1.975 * sign, 3.22 if world.backend == "costmap" else 3.3, sign * 0.012)
    navigation_map = world.inflated(lambda x, y: y > 3.42)
    depth = navigation_map.contact_depth(start)
    assert 0.0 < depth < 0.12
    result, motion = run(name, navigation_map, start=start, distance=4.0, time_limit=60)
    assert abs(motion.end.x - start.x) > 0.2, "along the wall it may move"
    assert navigation_map.contact_depth(motion.end) < depth + 0.015, "4.7 cm, if each look begins anew"
    assert result.outcome == RecoveryOutcome.IMPASSABLE and "would touch it at" in result.message


@pytest.mark.parametrize("forward", [True, False])
def test_no_recovery_drives_over_the_end_of_the_map(world, run, forward):
    start, distance = Pose.planar(7.5, 3.0, 0.0 if forward else math.pi), 2.0 if forward else -2.0
    result, motion = run("drive_on_heading", world.map_of(nothing), start=start, distance=distance)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert motion.end.x <= 8.0 - 0.2 + 0.02


@pytest.mark.parametrize("name", MOVING)
def test_wholly_on_obstacles_nothing_moves(world, run, name):
    result, motion = run(name, world.map_of(everything))
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert all(command.is_stopped() for command in motion.commands)


def test_moving_away_between_two_obstacles_is_impassable_where_the_clearance_is_best(world, run):
    between = world.map_of(lambda x, y: np.abs(x - 3.0) > 0.6)
    result, motion = run("move_away", between, start=Pose.planar(3.15, 3.0), clearance=1.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE and "cannot move away" in result.message
    assert motion.end.x == pytest.approx(3.0, abs=0.1)


def test_moving_away_sideways_needs_an_omnidirectional_robot_or_one_that_turns(world, run):
    wall = world.map_of(lambda x, y: y > 3.4)
    assert run("move_away", wall, clearance=0.7, yaw_rate=0.0)[0].outcome == RecoveryOutcome.IMPASSABLE
    result, motion = run("move_away", wall, clearance=0.7, omnidirectional=True)
    assert result.outcome == RecoveryOutcome.SUCCESS and motion.end.y < 2.8


# ------------------------------------------------------------------------------------------ wait, clear and relax
def test_waiting_takes_its_time(world, run):
    result, motion = run("wait", world.map_of(nothing), duration=2.0)
    assert result.outcome == RecoveryOutcome.SUCCESS and motion.seconds == pytest.approx(2.0, abs=0.1)


def test_waiting_by_chance_stays_within_its_bounds_and_is_the_same_for_the_same_seed(world, run):
    times = [run("wait", world.map_of(nothing), duration=1.0, random_extra=2.0)[1].seconds for _ in range(2)]
    assert times[0] == times[1]
    assert 1.3 < times[0] < 3.1, "drawn, not the shortest time"


@pytest.mark.parametrize(
    ("options", "left"),
    [
        ({}, set()),
        ({"layers": ("obstacle",)}, set()),
        ({"radius": 1.2}, {"far"}),
        ({"radius": 1.2, "keep_inside": True}, {"near"}),
        ({"radius": 1.2, "layers": ("obstacle",)}, {"far"}),
    ],
)
def test_clearing_forgets_what_it_shall(world, run, options, left):
    navigation_map, places = world.sensing(), {"near": (3.95, 3.05), "far": (5.05, 3.05)}
    world.see(navigation_map, *places.values())
    assert all(np.isinf(world.cost_at(navigation_map, *place)) for place in places.values())
    result, motion = run("clear", navigation_map, **options)
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert result.message.startswith("cleared ") and "obstacle" in result.message
    assert motion.commands == []
    assert {name for name, place in places.items() if np.isinf(world.cost_at(navigation_map, *place))} == left


@pytest.mark.parametrize("options", [{}, {"radius": 1.2}])
def test_a_cleared_map_is_stale_until_it_is_seen_again(world, run, options):
    navigation_map = world.sensing(rate=10.0)
    world.see(navigation_map, (3.95, 3.05))
    assert not navigation_map.stale_reason(0.1)
    run("clear", navigation_map, **options)
    assert "observation source 'scan'" in navigation_map.stale_reason(0.1)
    world.see(navigation_map, (3.95, 3.05), stamp=0.2)
    assert not navigation_map.stale_reason(0.2)


@pytest.mark.parametrize("name", ["clear", "relax"])
def test_an_unknown_layer_is_a_failure_that_names_the_known_ones(world, run, name):
    result, motion = run(name, world.sensing(), layers=("sonar",))
    assert result.outcome == RecoveryOutcome.FAILURE
    assert f"nothing to {name}: there is no layer 'sonar', only " in result.message and "obstacle" in result.message
    assert motion.plugin.relaxation.slack(0.0) == NO_SLACK


@pytest.mark.parametrize("name", ["clear", "relax"])
def test_a_cancel_before_keeps_the_map_as_it_is(world, run, name):
    navigation_map = world.sensing()
    world.see(navigation_map, (3.95, 3.05))
    before = navigation_map.snapshot()
    result, motion = run(name, navigation_map, cancel=0.0)
    assert result.outcome == RecoveryOutcome.CANCELED and "enough of this" in result.message
    assert navigation_map.snapshot() is before and motion.plugin.relaxation.slack(0.0) == NO_SLACK


@pytest.mark.parametrize(("options", "outcome"), [({}, "SUCCESS"), ({"radius": 1.0}, "TF_ERROR")])
def test_only_clearing_around_a_lost_robot_is_a_tf_error(world, run, options, outcome):
    result, _ = run("clear", world.sensing(), lost=True, **options)
    assert result.outcome == RecoveryOutcome[outcome]


def test_relaxing_a_layer_without_inflation_is_a_failure(world, run):
    result, _ = run("relax", world.sensing(), layers=("obstacle",))
    assert (
        result.outcome == RecoveryOutcome.FAILURE
        and "'obstacle' has no inflation radius and no margin" in result.message
    )


def test_relaxed_inflation_and_slack_come_back_by_the_clock_and_again_means_longer(world, run):
    navigation_map = world.sensing()
    world.see(navigation_map, (4.05, 3.05))
    beside, touching = (4.55, 3.05), (4.15, 3.05)
    usual, forbidden = world.cost_at(navigation_map, *beside), world.cost_at(navigation_map, *touching)
    for start in (0.0, 6.0):  # the second run relaxes the usual radii again, not the relaxed ones
        navigation_map.end_overrides(start)
        result, motion = run("relax", navigation_map, inflation_factor=0.5, duration=10.0 + start)
        assert result.outcome == RecoveryOutcome.SUCCESS
        assert "inflation at 0.4 m" in result.message and "path ends within 0.2 m" in result.message
    assert world.cost_at(navigation_map, *beside) == 0.0 < usual
    assert world.cost_at(navigation_map, *touching) == forbidden, "what the robot would touch stays forbidden"
    navigation_map.update(START, 15.9)
    assert world.cost_at(navigation_map, *beside) == 0.0
    navigation_map.update(START, 16.1)
    assert world.cost_at(navigation_map, *beside) == usual
    assert motion.plugin.relaxation.slack(15.9) == Slack(0.2, 0.2, 0.35, 2.0)
    assert motion.plugin.relaxation.slack(16.1) == NO_SLACK


def test_relaxing_may_leave_the_inflation_as_it_is(world, run):
    navigation_map = world.sensing()
    before = navigation_map.snapshot()
    result, _ = run("relax", navigation_map, inflation_factor=1.0)
    assert result.outcome == RecoveryOutcome.SUCCESS and "inflation and margins as usual" in result.message
    assert navigation_map.snapshot() is before


@pytest.mark.parametrize("name", ["clear", "relax"])
def test_a_server_with_one_map_has_no_map_to_choose(world, run, name):
    with pytest.raises(ValueError, match="costmaps: local: the server has one map only"):
        run(name, world.map_of(nothing), costmaps="local")


@pytest.mark.parametrize("name", ["clear", "relax"])
def test_no_map_can_be_chosen_at_run_time_either(world, run, name):
    _, motion = run(name, world.map_of(nothing))
    motion.plugin.parameters = motion.plugin.parameters.model_copy(update={"costmaps": "global"})
    with pytest.raises(ValueError, match="costmaps: global: the server has one map only"):
        motion.plugin.parameters_changed()
