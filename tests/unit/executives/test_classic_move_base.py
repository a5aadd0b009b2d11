"""The classic move_base against its published behaviour; the fact ids are those of the reference (F300 to F308)."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.time.clock import Priority
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase, ClassicSettings

GOAL = Pose.planar(2.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
NO_COMMAND = ControlResult(ExePathOutcome.NO_VALID_CMD, "nowhere to go")
LIST = ("clear", "back_up", "relax")


def run(bench, target=GOAL, **settings):
    return ClassicMoveBase(bench.navigator, ClassicSettings(**settings)).run(target)


def plans(bench):
    return len(bench.planner.requests)


def hand_overs(bench):
    return len(bench.controller.paths)


def states(bench):
    events = [e for e in bench.events(EventKind.STATE_CHANGED) if e.source == "classic_move_base"]
    return [(event.data["new"], event.data["trigger"]) for event in events]


def test_it_plans_once_drives_and_arrives(make_bench, recoveries):
    bench = make_bench()
    result = run(bench)
    assert (result.outcome, result.message) == (MoveBaseOutcome.SUCCESS, "Goal reached.")
    assert (plans(bench), hand_overs(bench), recoveries(bench)) == (1, 1, [])
    assert result.dist_to_goal < 0.15


def test_f300_defaults_are_those_of_a_fresh_start():
    settings = ClassicSettings()
    assert (settings.planner_frequency, settings.controller_frequency) == (0.0, 20.0)
    assert (settings.planner_patience, settings.controller_patience) == (5.0, 15.0)
    assert settings.max_planning_retries == -1
    assert (settings.oscillation_timeout, settings.oscillation_distance) == (0.0, 0.5)


def test_f301_each_failing_cycle_costs_one_plan_and_one_hand_over(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(NO_COMMAND, NO_COMMAND, NO_COMMAND, bench.controller.follow)
    assert run(bench).success
    assert (plans(bench), hand_overs(bench), recoveries(bench)) == (4, 4, [])
    assert states(bench)[:3] == [("controlling", "planning"), ("planning", "planning"), ("controlling", "planning")]


def test_f301_the_robot_stands_while_it_is_planned_anew(make_bench):
    bench = make_bench()
    bench.planner.modelled_compute_time = 0.4
    bench.controller.play(drive(0.5), NO_COMMAND, bench.controller.follow)
    assert run(bench).success
    changes = [e for e in bench.events(EventKind.STATE_CHANGED) if e.source == "classic_move_base"]
    (failed,) = [e.time for e in changes if e.data["new"] == "planning"]
    during = [c for time, c in bench.robot.commands if failed <= time < failed + 0.35]
    assert all(command.is_stopped() for command in during)


def test_f302_no_valid_command_beyond_patience_clears_with_trigger_control(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(NO_COMMAND)
    result = run(bench, controller_patience=1.0)
    clearing = next(e for e in bench.events(EventKind.STATE_CHANGED) if e.data.get("new") == "clearing")
    assert clearing.data["trigger"] == "controlling"
    assert 1.0 < clearing.time < 1.2
    assert recoveries(bench) == list(LIST)
    assert result.outcome == MoveBaseOutcome.CTRL_FAILURE


def test_f303_no_plan_beyond_patience_clears_with_trigger_planning(make_bench):
    bench = make_bench()
    bench.planner.modelled_compute_time = 0.4
    bench.planner.play(NO_PATH)
    run(bench, planner_patience=2.0)
    clearing = next(e for e in bench.events(EventKind.STATE_CHANGED) if e.data.get("new") == "clearing")
    assert clearing.data["trigger"] == "planning"
    assert clearing.time == pytest.approx(2.4)  # the sixth failure is the first one after 2 s
    assert plans(bench) == 6 + 3 * 5  # after a recovery planning begins with the next control cycle


def test_f303_more_failures_than_retries_clear_before_patience_is_over(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(NO_PATH)
    run(bench, planner_patience=100.0, max_planning_retries=2)
    assert plans(bench) == 4 * 3
    assert recoveries(bench) == list(LIST)


def test_f303_negative_retries_never_count(make_bench):
    bench = make_bench()
    bench.planner.play(*[NO_PATH] * 60, straight_plan)
    assert run(bench, planner_patience=5.0).success
    assert plans(bench) == 61


def test_f304_one_behaviour_runs_and_planning_has_its_patience_again(make_bench, recoveries):
    bench = make_bench()
    bench.planner.modelled_compute_time = 0.4
    bench.planner.play(*[NO_PATH] * 6, *[NO_PATH] * 4, straight_plan)
    assert run(bench, planner_patience=2.0).success
    assert recoveries(bench) == ["clear"]


def test_f304_a_failed_behaviour_is_followed_by_planning_too(make_bench, recoveries):
    bench = make_bench()
    bench.plugin("clear", object).play(RecoveryResult(RecoveryOutcome.FAILURE, "no"))
    bench.planner.play(NO_PATH, straight_plan)
    assert run(bench, max_planning_retries=0).success
    assert recoveries(bench) == ["clear"]


def test_f305_a_plan_after_trigger_planning_starts_the_list_again(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(NO_PATH, straight_plan, NO_PATH, straight_plan)
    bench.controller.play(NO_COMMAND, bench.controller.follow)
    assert run(bench, max_planning_retries=0).success
    assert recoveries(bench) == ["clear", "clear"]


def test_f305_a_valid_command_after_trigger_control_starts_the_list_again(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(NO_COMMAND, drive(0.1), NO_COMMAND, bench.controller.follow)
    assert run(bench, controller_patience=0.02).success
    assert recoveries(bench) == ["clear", "clear"]


def test_f305_without_a_valid_command_the_list_goes_on_and_patience_is_not_renewed(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(*[NO_COMMAND] * 3, bench.controller.follow)
    assert run(bench, controller_patience=0.02).success
    assert recoveries(bench)[:2] == ["clear", "back_up"]


def test_f305_half_a_metre_of_motion_after_trigger_oscillation_starts_the_list_again(make_bench, recoveries):
    bench = make_bench()
    turn = drive(0.0, 0.2)
    bench.controller.play(*[turn] * 60, *[drive(0.5)] * 30, *[turn] * 60, bench.controller.follow)
    assert run(bench, Pose.planar(3.0, 0.0), oscillation_timeout=2.0).success
    assert recoveries(bench).count("clear") >= 2
    assert "back_up" not in recoveries(bench)


def test_f305_a_new_goal_starts_the_list_again(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(NO_COMMAND)
    move_base = ClassicMoveBase(bench.navigator, ClassicSettings(controller_patience=0.02))
    move_base.run(GOAL)
    move_base.run(GOAL)
    assert recoveries(bench) == [*LIST, *LIST]


@pytest.mark.parametrize(
    ("trigger", "outcome", "text"),
    [
        ("planning", MoveBaseOutcome.PLAN_FAILURE, "valid plan"),
        ("control", MoveBaseOutcome.CTRL_FAILURE, "valid control"),
        ("oscillation", MoveBaseOutcome.OSCILLATION, "oscillating"),
    ],
)
def test_f306_the_text_of_an_abort_names_its_trigger(make_bench, trigger, outcome, text):
    bench = make_bench()
    if trigger == "planning":
        bench.planner.play(NO_PATH)
    bench.controller.play(NO_COMMAND if trigger == "control" else drive(0.0, 0.2))
    result = run(bench, max_planning_retries=0, controller_patience=0.02, oscillation_timeout=1.0)
    assert result.outcome == outcome
    assert text in result.message
    assert bench.robot.command.is_stopped()


def test_f306_with_recovery_disabled_the_first_need_aborts(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(NO_PATH)
    result = run(bench, max_planning_retries=0, recovery_behavior_enabled=False)
    assert result.outcome == MoveBaseOutcome.PLAN_FAILURE
    assert recoveries(bench) == []


def test_f307_no_behaviour_runs_more_often_than_the_one_before_it(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(*[NO_PATH] * 3, straight_plan, NO_PATH, NO_PATH, straight_plan)
    bench.controller.play(NO_COMMAND, drive(0.1), NO_COMMAND, bench.controller.follow)
    assert run(bench, max_planning_retries=0).success
    counts = [recoveries(bench).count(name) for name in LIST]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == 2


def test_f308_a_refused_plan_aborts_at_once(make_bench, recoveries):
    bench = make_bench()
    bench.controller.accepts_plan = False
    result = run(bench)
    assert result.outcome == ExePathOutcome.INVALID_PATH
    assert "Failed to pass global plan to the controller" in result.message
    assert (plans(bench), recoveries(bench)) == (1, [])


def test_with_a_planner_frequency_the_path_is_swapped_while_driving(make_bench):
    bench = make_bench()
    assert run(bench, planner_frequency=1.0).success
    assert plans(bench) >= 4
    assert hand_overs(bench) >= plans(bench) - 1


def test_the_servers_parameters_are_as_before_afterwards(make_bench):
    bench = make_bench(planner_max_retries=3, controller_patience=7.0)
    run(bench)
    assert bench.server.runtime.parameters.planner_max_retries == 3
    assert bench.server.runtime.parameters.controller_patience == 7.0


@pytest.mark.parametrize("seconds", [0.01, 0.2, 0.43, 0.77, 1.3])
def test_cancel_from_another_thread_stops_the_robot_and_leaves_no_goal(make_bench, seconds):
    bench = make_bench()
    bench.planner.modelled_compute_time = 0.4
    bench.controller.play(drive(0.5), NO_COMMAND)
    bench.plugin("clear", object).play(lambda request: _drive_for_ever(request))
    move_base = ClassicMoveBase(bench.navigator, ClassicSettings(controller_patience=0.3))

    def cancel_later():
        bench.clock.sleep(seconds)
        move_base.cancel("enough")

    bench.clock.spawn(cancel_later, "client", Priority.CLIENT)
    result = move_base.run(GOAL)
    assert (result.outcome, result.message) == (MoveBaseOutcome.CANCELED, "enough")
    assert bench.robot.command.is_stopped()
    assert len(bench.events(EventKind.GOAL_ACCEPTED)) == len(bench.events(EventKind.GOAL_FINISHED))


def _drive_for_ever(request):
    while request.motion.send(drive(0.1).command) and request.motion.sleep(0.05):
        pass
    return RecoveryResult(RecoveryOutcome.CANCELED, "canceled")
