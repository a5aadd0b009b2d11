"""The classic move_base against its published behaviour; the fact ids are those of the reference (F300 to F308)."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.time.clock import Priority
from terrain.experiments.classic_move_base.settings import ClassicSettings
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase

GOAL = Pose.planar(2.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
NO_COMMAND = ControlResult(ExePathOutcome.NO_VALID_CMD, "nowhere to go")
LIST = ("clear", "back_up", "relax")


def run(session, target=GOAL, **settings):
    return ClassicMoveBase(session.navigator, ClassicSettings(**settings)).run(target)


def plans(session):
    return len(session.planner.requests)


def hand_overs(session):
    return len(session.controller.paths)


def states(session):
    events = [e for e in session.recorded(EventKind.STATE_CHANGED) if e.source == "classic_move_base"]
    return [(event.data["new"], event.data["trigger"]) for event in events]


def test_it_plans_once_drives_and_arrives(make_session, recoveries):
    session = make_session()
    result = run(session)
    assert (result.outcome, result.message) == (MoveBaseOutcome.SUCCESS, "Goal reached.")
    assert (plans(session), hand_overs(session), recoveries(session)) == (1, 1, [])
    assert result.dist_to_goal < 0.15


def test_f300_defaults_are_those_of_a_fresh_start():
    settings = ClassicSettings()
    assert (settings.planner_frequency, settings.controller_frequency) == (0.0, 20.0)
    assert (settings.planner_patience, settings.controller_patience) == (5.0, 15.0)
    assert settings.max_planning_retries == -1
    assert (settings.oscillation_timeout, settings.oscillation_distance) == (0.0, 0.5)


def test_f301_each_failing_cycle_costs_one_plan_and_one_hand_over(make_session, recoveries):
    session = make_session()
    session.controller.play(NO_COMMAND, NO_COMMAND, NO_COMMAND, session.controller.follow)
    assert run(session).success
    assert (plans(session), hand_overs(session), recoveries(session)) == (4, 4, [])
    assert states(session)[:3] == [("controlling", "planning"), ("planning", "planning"), ("controlling", "planning")]


def test_f301_the_robot_stands_while_it_is_planned_anew(make_session):
    session = make_session()
    session.planner.modelled_compute_time = 0.4
    session.controller.play(drive(0.5), NO_COMMAND, session.controller.follow)
    assert run(session).success
    changes = [e for e in session.recorded(EventKind.STATE_CHANGED) if e.source == "classic_move_base"]
    (failed,) = [e.time for e in changes if e.data["new"] == "planning"]
    during = [c for time, c in session.robot.commands if failed <= time < failed + 0.35]
    assert all(command.is_stopped() for command in during)


def test_f302_no_valid_command_beyond_patience_clears_with_trigger_control(make_session, recoveries):
    session = make_session()
    session.controller.play(NO_COMMAND)
    result = run(session, controller_patience=1.0)
    clearing = next(e for e in session.recorded(EventKind.STATE_CHANGED) if e.data.get("new") == "clearing")
    assert clearing.data["trigger"] == "controlling"
    assert 1.0 < clearing.time < 1.2
    assert recoveries(session) == list(LIST)
    assert result.outcome == MoveBaseOutcome.CTRL_FAILURE


def test_f303_no_plan_beyond_patience_clears_with_trigger_planning(make_session):
    session = make_session()
    session.planner.modelled_compute_time = 0.4
    session.planner.play(NO_PATH)
    run(session, planner_patience=2.0)
    clearing = next(e for e in session.recorded(EventKind.STATE_CHANGED) if e.data.get("new") == "clearing")
    assert clearing.data["trigger"] == "planning"
    assert clearing.time == pytest.approx(2.4)  # the sixth failure is the first one after 2 s
    assert plans(session) == 6 + 3 * 5  # after a recovery planning begins with the next control cycle


def test_f303_more_failures_than_retries_clear_before_patience_is_over(make_session, recoveries):
    session = make_session()
    session.planner.play(NO_PATH)
    run(session, planner_patience=100.0, max_planning_retries=2)
    assert plans(session) == 4 * 3
    assert recoveries(session) == list(LIST)


def test_f303_negative_retries_never_count(make_session):
    session = make_session()
    session.planner.play(*[NO_PATH] * 60, straight_plan)
    assert run(session, planner_patience=5.0).success
    assert plans(session) == 61


def test_f304_one_behaviour_runs_and_planning_has_its_patience_again(make_session, recoveries):
    session = make_session()
    session.planner.modelled_compute_time = 0.4
    session.planner.play(*[NO_PATH] * 6, *[NO_PATH] * 4, straight_plan)
    assert run(session, planner_patience=2.0).success
    assert recoveries(session) == ["clear"]


def test_f304_a_failed_behaviour_is_followed_by_planning_too(make_session, recoveries):
    session = make_session()
    session.plugin("clear", object).play(RecoveryResult(RecoveryOutcome.FAILURE, "no"))
    session.planner.play(NO_PATH, straight_plan)
    assert run(session, max_planning_retries=0).success
    assert recoveries(session) == ["clear"]


def test_f305_a_plan_after_trigger_planning_starts_the_list_again(make_session, recoveries):
    session = make_session()
    session.planner.play(NO_PATH, straight_plan, NO_PATH, straight_plan)
    session.controller.play(NO_COMMAND, session.controller.follow)
    assert run(session, max_planning_retries=0).success
    assert recoveries(session) == ["clear", "clear"]


def test_f305_a_valid_command_after_trigger_control_starts_the_list_again(make_session, recoveries):
    session = make_session()
    session.controller.play(NO_COMMAND, drive(0.1), NO_COMMAND, session.controller.follow)
    assert run(session, controller_patience=0.02).success
    assert recoveries(session) == ["clear", "clear"]


def test_f305_without_a_valid_command_the_list_goes_on_and_patience_is_not_renewed(make_session, recoveries):
    session = make_session()
    session.controller.play(*[NO_COMMAND] * 3, session.controller.follow)
    assert run(session, controller_patience=0.02).success
    assert recoveries(session)[:2] == ["clear", "back_up"]


def test_f305_half_a_metre_of_motion_after_trigger_oscillation_starts_the_list_again(make_session, recoveries):
    session = make_session()
    turn = drive(0.0, 0.2)
    session.controller.play(*[turn] * 60, *[drive(0.5)] * 30, *[turn] * 60, session.controller.follow)
    assert run(session, Pose.planar(3.0, 0.0), oscillation_timeout=2.0).success
    assert recoveries(session).count("clear") >= 2
    assert "back_up" not in recoveries(session)


def test_f305_a_new_goal_starts_the_list_again(make_session, recoveries):
    session = make_session()
    session.controller.play(NO_COMMAND)
    move_base = ClassicMoveBase(session.navigator, ClassicSettings(controller_patience=0.02))
    move_base.run(GOAL)
    move_base.run(GOAL)
    assert recoveries(session) == [*LIST, *LIST]


@pytest.mark.parametrize(
    ("trigger", "outcome", "text"),
    [
        ("planning", MoveBaseOutcome.PLAN_FAILURE, "valid plan"),
        ("control", MoveBaseOutcome.CTRL_FAILURE, "valid control"),
        ("oscillation", MoveBaseOutcome.OSCILLATION, "oscillating"),
    ],
)
def test_f306_the_text_of_an_abort_names_its_trigger(make_session, trigger, outcome, text):
    session = make_session()
    if trigger == "planning":
        session.planner.play(NO_PATH)
    session.controller.play(NO_COMMAND if trigger == "control" else drive(0.0, 0.2))
    result = run(session, max_planning_retries=0, controller_patience=0.02, oscillation_timeout=1.0)
    assert result.outcome == outcome
    assert text in result.message
    assert session.robot.command.is_stopped()


def test_f306_with_recovery_disabled_the_first_need_aborts(make_session, recoveries):
    session = make_session()
    session.planner.play(NO_PATH)
    result = run(session, max_planning_retries=0, recovery_behavior_enabled=False)
    assert result.outcome == MoveBaseOutcome.PLAN_FAILURE
    assert recoveries(session) == []


def test_f307_no_behaviour_runs_more_often_than_the_one_before_it(make_session, recoveries):
    session = make_session()
    session.planner.play(*[NO_PATH] * 3, straight_plan, NO_PATH, NO_PATH, straight_plan)
    session.controller.play(NO_COMMAND, drive(0.1), NO_COMMAND, session.controller.follow)
    assert run(session, max_planning_retries=0).success
    counts = [recoveries(session).count(name) for name in LIST]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == 2


def test_f308_a_refused_plan_aborts_at_once(make_session, recoveries):
    session = make_session()
    session.controller.accepts_plan = False
    result = run(session)
    assert result.outcome == ExePathOutcome.INVALID_PATH
    assert "Failed to pass global plan to the controller" in result.message
    assert (plans(session), recoveries(session)) == (1, [])


def test_with_a_planner_frequency_the_path_is_swapped_while_driving(make_session):
    session = make_session()
    assert run(session, planner_frequency=1.0).success
    assert plans(session) >= 4
    assert hand_overs(session) >= plans(session) - 1


def test_the_servers_parameters_are_as_before_afterwards(make_session):
    session = make_session(planner_max_retries=3, controller_patience=7.0)
    run(session)
    assert session.server.runtime.parameters.planner_max_retries == 3
    assert session.server.runtime.parameters.controller_patience == 7.0


@pytest.mark.parametrize("seconds", [0.01, 0.2, 0.43, 0.77, 1.3])
def test_cancel_from_another_thread_stops_the_robot_and_leaves_no_goal(make_session, seconds):
    session = make_session()
    session.planner.modelled_compute_time = 0.4
    session.controller.play(drive(0.5), NO_COMMAND)
    session.plugin("clear", object).play(lambda request: _drive_for_ever(request))
    move_base = ClassicMoveBase(session.navigator, ClassicSettings(controller_patience=0.3))

    def cancel_later():
        session.clock.sleep(seconds)
        move_base.cancel("enough")

    session.clock.spawn(cancel_later, "client", Priority.CLIENT)
    result = move_base.run(GOAL)
    assert (result.outcome, result.message) == (MoveBaseOutcome.CANCELED, "enough")
    assert session.robot.command.is_stopped()
    assert len(session.recorded(EventKind.GOAL_ACCEPTED)) == len(session.recorded(EventKind.GOAL_FINISHED))


def _drive_for_ever(request):
    while request.motion.send(drive(0.1).command) and request.motion.sleep(0.05):
        pass
    return RecoveryResult(RecoveryOutcome.CANCELED, "canceled")
