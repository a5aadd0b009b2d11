"""The ready trees on a robot without walls: what they do when planning or driving fails."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, control_tree, navigation_tree, planning_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.tracking.blocking import Blockage
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RefinePathOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RefineResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import ScriptedRefiner, straight_plan

GOAL = Pose.planar(2.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")
PAST_IT = ControlResult(ExePathOutcome.MISSED_GOAL, "0.2 m past it")
COLLISION = ControlResult(ExePathOutcome.COLLISION, "a wall")
OPTIONS = TreeOptions(check_poses=False, second_planner_pause=0.0)


def run(session, tree, target=GOAL):
    return TreeExecutive(tree, session.navigator).run(target)


def failing_for(session, result, cycles):
    """Let the controller fail for some cycles, then follow."""
    session.controller.play(*[result] * cycles, session.controller.follow)


def plans(session):
    return len(session.planner.requests)


def test_navigation_plans_once_and_arrives(make_session, recoveries):
    session = make_session()
    result = run(session, navigation_tree(OPTIONS))
    assert result.success
    assert (plans(session), recoveries(session)) == (1, [])
    assert session.robot.pose.distance_to(GOAL) < 0.15


def test_a_robot_whose_path_ends_beside_the_target_comes_the_nearer_to_its_end(make_session):
    session = make_session(dist_tolerance=0.2)
    session.planner.play(lambda request: straight_plan(replace(request, goal=Pose.planar(1.85, 0.0))))
    assert run(session, navigation_tree(OPTIONS)).success
    assert session.robot.pose.distance_to(GOAL) <= 0.2


def test_a_path_as_short_of_the_target_as_the_planner_may_end_it_leads_to_within_the_tolerance(make_session):
    session = make_session(dist_tolerance=0.2)
    session.planner.play(lambda asked: straight_plan(replace(asked, goal=Pose.planar(2.0 - asked.dist_tolerance, 0.0))))
    assert run(session, navigation_tree(OPTIONS)).success
    assert session.robot.pose.distance_to(GOAL) <= 0.2


def test_a_failed_plan_is_followed_by_the_next_recovery_of_the_list(make_session, recoveries):
    session = make_session()
    session.planner.play(NO_PATH, NO_PATH, straight_plan)
    options = TreeOptions(check_poses=False, relax_planner="relax")
    assert run(session, navigation_tree(options)).success
    assert recoveries(session) == ["clear", "relax"]


def test_planning_ends_with_the_planners_code_when_the_list_is_used_up(make_session, recoveries):
    session = make_session()
    session.planner.play(NO_PATH)
    result = run(session, planning_tree(TreeOptions(relax_planner="relax")))
    assert not result.success
    assert result.message == "NO_PATH_FOUND: walled in"
    assert (plans(session), recoveries(session)) == (3, ["clear", "relax"])


def test_no_recovery_is_wasted_on_a_target_that_makes_no_sense(make_session, recoveries):
    session = make_session()
    session.planner.play(PlanResult(GetPathOutcome.INVALID_GOAL, "in the sky"))
    assert not run(session, planning_tree()).success
    assert (plans(session), recoveries(session)) == (1, [])


def test_recoveries_of_driving_are_picked_by_code_and_the_path_is_kept(make_session, recoveries):
    session = make_session()
    session.controller.play(COLLISION, BLOCKED, session.controller.follow)
    assert run(session, navigation_tree(OPTIONS)).success
    assert recoveries(session) == ["back_up", "clear"]
    assert plans(session) == 1


@pytest.mark.parametrize("reuse_path", [True, False])
def test_a_robot_past_its_goal_gets_a_new_plan_and_what_it_has_seen_is_kept(make_session, recoveries, reuse_path):
    session = make_session()
    session.controller.play(PAST_IT, PAST_IT, session.controller.follow)
    assert run(session, navigation_tree(replace(OPTIONS, reuse_path=reuse_path))).success
    assert (plans(session), recoveries(session)) == (3, [])


def test_after_a_recovery_the_rest_of_the_path_is_driven(make_session):
    session = make_session()
    session.controller.play(*[session.controller.follow] * 40, BLOCKED, session.controller.follow)
    assert run(session, navigation_tree(OPTIONS)).success
    whole, rest = session.controller.paths
    assert rest.length == pytest.approx(whole.length - 1.0, abs=0.3)  # 40 cycles at 0.5 m/s
    assert rest[-1] == whole[-1]


def test_the_same_failure_again_takes_the_next_recovery_for_its_code(make_session, recoveries):
    session = make_session()
    session.controller.play(BLOCKED, BLOCKED, COLLISION, BLOCKED, session.controller.follow)
    assert run(session, navigation_tree(OPTIONS)).success
    assert recoveries(session) == ["clear", "back_up", "back_up", "clear"]


def test_where_patience_ran_out_the_controllers_own_words_pick_the_recovery(make_session, recoveries):
    session = make_session(controller_max_retries=-1, controller_patience=0.2)
    failing_for(session, COLLISION, 6)
    assert run(session, navigation_tree(OPTIONS)).success
    assert recoveries(session) == ["back_up"]


def test_when_control_falls_through_the_tree_plans_anew(make_session):
    session = make_session()
    failing_for(session, BLOCKED, OPTIONS.control_retries + 1)
    assert run(session, navigation_tree(OPTIONS)).success
    assert plans(session) == 2


def test_it_gives_up_after_its_replans_with_the_last_failure(make_session):
    session = make_session()
    session.controller.play(BLOCKED)
    result = run(session, navigation_tree(OPTIONS))
    assert result.message == "BLOCKED_PATH: a chair"
    assert plans(session) == 1 + OPTIONS.replans
    assert session.robot.command.is_stopped()


def test_without_reuse_of_the_path_every_failure_costs_a_plan(make_session, recoveries):
    session = make_session()
    failing_for(session, BLOCKED, 3)
    options = TreeOptions(check_poses=False, second_planner_pause=0.0, reuse_path=False)
    assert run(session, navigation_tree(options)).success
    assert (plans(session), recoveries(session)) == (4, ["clear", "back_up", "clear"])


@pytest.mark.parametrize("reuse_path", [True, False])
@pytest.mark.parametrize(
    ("motion", "recovery", "plans_made"),
    [(Motion.PARKED, [], 2), (Motion.MOVING, ["relax"], 1), (Motion.WAITING, [], 2)],
)
def test_who_is_in_the_way_decides_between_waiting_and_planning_around(
    make_session, recoveries, monkeypatch, reuse_path, motion, recovery, plans_made
):
    session = make_session()
    session.controller.play(BLOCKED, session.controller.follow)
    somebody = Blockage(SimpleNamespace(motion=motion, standing=3.0, course=(0.0, 0.0)), 0, 1.0)
    monkeypatch.setattr(type(session.server), "queries", SimpleNamespace(what_blocks=lambda path, margin: (somebody,)))
    options = replace(OPTIONS, wait="relax", give_way="back_up", reuse_path=reuse_path)
    result = run(session, navigation_tree(options))
    assert result.success, result.message
    if reuse_path:
        assert (plans(session), recoveries(session)) == (plans_made, recovery)
    else:  # every recovery is followed by a plan
        assert (plans(session), recoveries(session)) == (2, [] if motion is Motion.PARKED else ["relax"])


def on_the_path(session, monkeypatch, motion, distance=1.0):
    """Somebody has been standing so far ahead [m] for three seconds, and the map sees the path blocked there."""
    somebody = Blockage(SimpleNamespace(motion=motion, standing=3.0, course=(0.0, 0.0)), 0, distance)
    blocked = SimpleNamespace(state=CellState.LETHAL)
    queries = SimpleNamespace(what_blocks=lambda path, margin: (somebody,), check_path=lambda *asked: blocked)
    monkeypatch.setattr(type(session.server), "queries", queries)


ASKING = replace(OPTIONS, wait="relax", give_way="back_up")


@pytest.mark.parametrize(
    ("motion", "distance", "speed", "asks"),
    [("parked", 2.0, 0.5, 2), ("waiting", 2.0, 0.5, 1), ("waiting", 1.0, 0.5, 2), ("waiting", 2.0, 0.1, 2)],
    ids=["parked", "waiting and far", "waiting and near", "both stand"],
)
def test_who_stands_is_planned_around_while_driving_if_parked_or_near_or_if_both_stand(
    make_session, recoveries, monkeypatch, motion, distance, speed, asks
):
    session = make_session()
    on_the_path(session, monkeypatch, Motion(motion), distance)
    session.controller.play(*[drive(speed)] * 36, session.controller.follow)
    options = replace(ASKING, second_planner_pause=8.0)
    assert run(session, navigation_tree(options), Pose.planar(30.0, 0.0)).success
    assert recoveries(session) == [] and len([r for r in session.planner.requests if r.start.x < 1.0]) == asks


@pytest.mark.parametrize(
    ("longer", "recovery"), [(4.0, []), (20.0, ["relax", "relax", "back_up", "relax"])], ids=["taken", "too long"]
)
def test_a_detour_that_is_too_long_is_not_asked_for_again_at_once(
    make_session, recoveries, monkeypatch, longer, recovery
):
    def around(request):
        straight = straight_plan(request)
        beyond = Pose.planar(straight.path[-1].x + 0.5 * longer, 0.0)
        return replace(straight, path=Path.from_poses([*straight.path, beyond, straight.path[-1]]))

    session = make_session()
    on_the_path(session, monkeypatch, Motion.WAITING)
    failing_for(session, BLOCKED, max(len(recovery), 1))
    session.planner.play(straight_plan, around)
    assert run(session, navigation_tree(ASKING)).success
    assert (plans(session), recoveries(session)) == (2, recovery)


def test_without_codes_recoveries_are_taken_in_their_fixed_order(make_session, recoveries):
    session = make_session()
    failing_for(session, COLLISION, 2)
    options = TreeOptions(check_poses=False, by_outcome=False)
    assert run(session, navigation_tree(options)).success
    assert recoveries(session) == ["clear", "back_up"]


def test_the_second_planner_updates_the_path_and_the_robot_does_not_stop(make_session):
    session = make_session()
    options = TreeOptions(check_poses=False, second_planner_pause=0.5, second_planner_look_ahead=0.0)
    result = run(session, navigation_tree(options), Pose.planar(3.0, 0.0))
    assert result.success
    assert plans(session) > 4
    assert len(session.controller.paths) >= plans(session) - 1  # the last one may come at the goal
    moving = [time for time, command in session.robot.commands if not command.is_stopped()]
    stops = [t for t, command in session.robot.commands if command.is_stopped() and moving[0] < t < moving[-1]]
    assert stops == []


def test_an_update_that_is_a_detour_is_not_taken(make_session):
    session = make_session()

    def detour(request):
        return straight_plan(replace(request, goal=Pose.planar(9.0, 0.0)))

    session.planner.play(straight_plan, *[detour] * 9)
    options = TreeOptions(
        check_poses=False, second_planner_pause=0.5, second_planner_look_ahead=0.0, longest_update=1.5
    )
    assert run(session, navigation_tree(options), Pose.planar(2.0, 0.0)).success
    assert plans(session) > 1
    assert len(session.controller.paths) == 1


def test_a_second_planner_that_fails_harms_nothing(make_session, recoveries):
    session = make_session()
    session.planner.play(straight_plan, NO_PATH)
    options = TreeOptions(check_poses=False, second_planner_pause=0.5, second_planner_look_ahead=0.0)
    assert run(session, navigation_tree(options)).success
    assert recoveries(session) == []


def test_a_failing_second_planner_does_not_hide_why_driving_failed(make_session, recoveries):
    session = make_session()
    session.planner.play(straight_plan, NO_PATH)
    session.controller.play(*[drive(0.2)] * 10, COLLISION, session.controller.follow)
    options = TreeOptions(check_poses=False, second_planner_pause=0.05, second_planner_look_ahead=0.0)
    assert run(session, navigation_tree(options)).success
    assert recoveries(session) == ["back_up"]


def test_a_robot_without_progress_is_stopped_and_recovered(make_session, recoveries):
    session = make_session(cmd_vel_ignored_tolerance=0.0)
    session.robot.stuck = True
    session.plugin("back_up", type(session.plugin("clear", object))).play(lambda request: _free(session))
    options = TreeOptions(check_poses=False, progress_timeout=2.0)
    result = run(session, navigation_tree(options))
    assert result.success, result.message
    assert recoveries(session) == ["back_up"]


def _free(session):
    from mbf_abstract.outcomes import RecoveryOutcome
    from mbf_abstract.plugins import RecoveryResult

    session.robot.stuck = False
    return RecoveryResult(RecoveryOutcome.SUCCESS, "free")


def test_a_robot_that_is_held_raises_no_alarm_and_drives_on_when_released(make_session, recoveries):
    session = make_session()
    options = TreeOptions(check_poses=False, second_planner_pause=0.0, progress_timeout=1.0, motor_timeout=1.0)
    executive = TreeExecutive(navigation_tree(options), session.navigator)
    actions = {20: session.server.pause_all, 120: session.server.resume_all}
    executive.on_tick.append(lambda tick: actions.get(tick, lambda: None)())

    assert executive.run(GOAL).success
    assert recoveries(session) == []
    assert session.clock.now() > 100 * executive.period


def test_a_robot_that_turns_on_the_spot_oscillates(make_session):
    session = make_session()
    session.controller.play(drive(0.0, 0.2))
    options = TreeOptions(
        check_poses=False, progress_timeout=0.0, oscillation_timeout=2.0, control_retries=0, replans=0
    )
    result = run(session, navigation_tree(options))
    assert result.mission.failure_code == ExePathOutcome.OSCILLATION


def test_motors_that_ignore_commands_raise_an_alarm(make_session):
    session = make_session(cmd_vel_ignored_tolerance=0.0)
    session.robot.stuck = True
    options = TreeOptions(check_poses=False, progress_timeout=0.0, motor_timeout=1.0, control_retries=0, replans=0)
    result = run(session, navigation_tree(options))
    assert "motors" in result.message
    assert session.robot.command.is_stopped()


def test_the_control_tree_drives_a_path_given_to_it(make_session):
    session = make_session()
    session.controller.play(COLLISION, session.controller.follow)
    result = TreeExecutive(control_tree(OPTIONS), session.navigator).run(path=session.path_to(1.0))
    assert result.success
    assert plans(session) == 0


def test_the_running_node_is_written_to_the_event_log(make_session):
    session = make_session()
    run(session, navigation_tree(OPTIONS))
    at_work = [event.data["new"] for event in session.recorded(EventKind.STATE_CHANGED) if event.source == "tree"]
    assert at_work[:2] == ["get path", "follow path"]


def test_every_plan_of_a_tree_goes_through_its_refiner(make_session):
    session = make_session(plugins={"refiner": ScriptedRefiner})
    options = replace(OPTIONS, refiner="refiner", second_planner_pause=1.0, second_planner_look_ahead=0.0)
    assert run(session, navigation_tree(options)).success
    assert len(session.refiner.requests) == plans(session) > 1


def test_a_plan_that_cannot_be_refined_is_driven_as_it_is(make_session, recoveries):
    session = make_session(plugins={"refiner": ScriptedRefiner})
    session.refiner.play(RefineResult(RefinePathOutcome.FAILURE, "too rough"))
    assert run(session, navigation_tree(replace(OPTIONS, refiner="refiner"))).success
    assert (len(session.refiner.requests), recoveries(session)) == (1, [])


def test_a_tree_that_is_canceled_while_a_plan_is_refined_drives_nothing(make_session):
    session = make_session(plugins={"refiner": ScriptedRefiner})
    executive = TreeExecutive(navigation_tree(replace(OPTIONS, refiner="refiner")), session.navigator)

    def cancel(path):
        executive.cancel("enough")
        return RefineResult(0, "", path)

    session.refiner.play(cancel)
    assert not executive.run(GOAL).success
    assert session.controller.requests == []
