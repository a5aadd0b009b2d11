"""The ready trees on a robot without walls: what they do when planning or driving fails."""

from dataclasses import replace

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, control_tree, navigation_tree, planning_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import ControlResult, PlanResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan

GOAL = Pose.planar(2.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")
COLLISION = ControlResult(ExePathOutcome.COLLISION, "a wall")
OPTIONS = TreeOptions(check_poses=False, second_planner_pause=0.0)


def run(bench, tree, target=GOAL):
    return TreeExecutive(tree, bench.navigator).run(target)


def failing_for(bench, result, cycles):
    """Let the controller fail for some cycles, then follow."""
    bench.controller.play(*[result] * cycles, bench.controller.follow)


def plans(bench):
    return len(bench.planner.requests)


def test_navigation_plans_once_and_arrives(make_bench, recoveries):
    bench = make_bench()
    result = run(bench, navigation_tree(OPTIONS))
    assert result.success
    assert (plans(bench), recoveries(bench)) == (1, [])
    assert bench.robot.pose.distance_to(GOAL) < 0.15


def test_a_failed_plan_is_followed_by_the_next_recovery_of_the_list(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(NO_PATH, NO_PATH, straight_plan)
    options = TreeOptions(check_poses=False, relax_planner="relax")
    assert run(bench, navigation_tree(options)).success
    assert recoveries(bench) == ["clear", "relax"]


def test_planning_ends_with_the_planners_code_when_the_list_is_used_up(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(NO_PATH)
    result = run(bench, planning_tree(TreeOptions(relax_planner="relax")))
    assert not result.success
    assert result.message == "NO_PATH_FOUND: walled in"
    assert (plans(bench), recoveries(bench)) == (3, ["clear", "relax"])


def test_no_recovery_is_wasted_on_a_target_that_makes_no_sense(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(PlanResult(GetPathOutcome.INVALID_GOAL, "in the sky"))
    assert not run(bench, planning_tree()).success
    assert (plans(bench), recoveries(bench)) == (1, [])


def test_recoveries_of_driving_are_picked_by_code_and_the_path_is_kept(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(COLLISION, BLOCKED, bench.controller.follow)
    assert run(bench, navigation_tree(OPTIONS)).success
    assert recoveries(bench) == ["back_up", "clear"]
    assert plans(bench) == 1


def test_after_a_recovery_the_rest_of_the_path_is_driven(make_bench):
    bench = make_bench()
    bench.controller.play(*[bench.controller.follow] * 40, BLOCKED, bench.controller.follow)
    assert run(bench, navigation_tree(OPTIONS)).success
    whole, rest = bench.controller.paths
    assert rest.length == pytest.approx(whole.length - 1.0, abs=0.3)  # 40 cycles at 0.5 m/s
    assert rest[-1] == whole[-1]


def test_the_same_failure_again_takes_the_next_recovery_for_its_code(make_bench, recoveries):
    bench = make_bench()
    bench.controller.play(BLOCKED, BLOCKED, COLLISION, BLOCKED, bench.controller.follow)
    assert run(bench, navigation_tree(OPTIONS)).success
    assert recoveries(bench) == ["clear", "back_up", "back_up", "clear"]


def test_where_patience_ran_out_the_controllers_own_words_pick_the_recovery(make_bench, recoveries):
    bench = make_bench(controller_max_retries=-1, controller_patience=0.2)
    failing_for(bench, COLLISION, 6)
    assert run(bench, navigation_tree(OPTIONS)).success
    assert recoveries(bench) == ["back_up"]


def test_when_control_falls_through_the_tree_plans_anew(make_bench):
    bench = make_bench()
    failing_for(bench, BLOCKED, OPTIONS.control_retries + 1)
    assert run(bench, navigation_tree(OPTIONS)).success
    assert plans(bench) == 2


def test_it_gives_up_after_its_replans_with_the_last_failure(make_bench):
    bench = make_bench()
    bench.controller.play(BLOCKED)
    result = run(bench, navigation_tree(OPTIONS))
    assert result.message == "BLOCKED_PATH: a chair"
    assert plans(bench) == 1 + OPTIONS.replans
    assert bench.robot.command.is_stopped()


def test_without_reuse_of_the_path_every_failure_costs_a_plan(make_bench, recoveries):
    bench = make_bench()
    failing_for(bench, BLOCKED, 3)
    options = TreeOptions(check_poses=False, second_planner_pause=0.0, reuse_path=False)
    assert run(bench, navigation_tree(options)).success
    assert (plans(bench), recoveries(bench)) == (4, ["clear", "back_up", "clear"])


def test_without_codes_recoveries_are_taken_in_their_fixed_order(make_bench, recoveries):
    bench = make_bench()
    failing_for(bench, COLLISION, 2)
    options = TreeOptions(check_poses=False, by_outcome=False)
    assert run(bench, navigation_tree(options)).success
    assert recoveries(bench) == ["clear", "back_up"]


def test_the_second_planner_updates_the_path_and_the_robot_does_not_stop(make_bench):
    bench = make_bench()
    options = TreeOptions(check_poses=False, second_planner_pause=0.5)
    result = run(bench, navigation_tree(options), Pose.planar(3.0, 0.0))
    assert result.success
    assert plans(bench) > 4
    assert len(bench.controller.paths) >= plans(bench) - 1  # the last one may come at the goal
    moving = [time for time, command in bench.robot.commands if not command.is_stopped()]
    stops = [t for t, command in bench.robot.commands if command.is_stopped() and moving[0] < t < moving[-1]]
    assert stops == []


def test_an_update_that_is_a_detour_is_not_taken(make_bench):
    bench = make_bench()

    def detour(request):
        return straight_plan(replace(request, goal=Pose.planar(9.0, 0.0)))

    bench.planner.play(straight_plan, *[detour] * 9)
    options = TreeOptions(check_poses=False, second_planner_pause=0.5, longest_update=1.5)
    assert run(bench, navigation_tree(options), Pose.planar(2.0, 0.0)).success
    assert plans(bench) > 1
    assert len(bench.controller.paths) == 1


def test_a_second_planner_that_fails_harms_nothing(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(straight_plan, NO_PATH)
    options = TreeOptions(check_poses=False, second_planner_pause=0.5)
    assert run(bench, navigation_tree(options)).success
    assert recoveries(bench) == []


def test_a_failing_second_planner_does_not_hide_why_driving_failed(make_bench, recoveries):
    bench = make_bench()
    bench.planner.play(straight_plan, NO_PATH)
    bench.controller.play(*[drive(0.2)] * 10, COLLISION, bench.controller.follow)
    options = TreeOptions(check_poses=False, second_planner_pause=0.05)
    assert run(bench, navigation_tree(options)).success
    assert recoveries(bench) == ["back_up"]


def test_a_robot_without_progress_is_stopped_and_recovered(make_bench, recoveries):
    bench = make_bench(cmd_vel_ignored_tolerance=0.0)
    bench.robot.stuck = True
    bench.plugin("back_up", type(bench.plugin("clear", object))).play(lambda request: _free(bench))
    options = TreeOptions(check_poses=False, progress_timeout=2.0)
    result = run(bench, navigation_tree(options))
    assert result.success, result.message
    assert recoveries(bench) == ["back_up"]


def _free(bench):
    from mbf_abstract.outcomes import RecoveryOutcome
    from mbf_abstract.plugins import RecoveryResult

    bench.robot.stuck = False
    return RecoveryResult(RecoveryOutcome.SUCCESS, "free")


def test_a_robot_that_is_held_raises_no_alarm_and_drives_on_when_released(make_bench, recoveries):
    bench = make_bench()
    options = TreeOptions(check_poses=False, second_planner_pause=0.0, progress_timeout=1.0, motor_timeout=1.0)
    executive = TreeExecutive(navigation_tree(options), bench.navigator)
    actions = {20: bench.server.pause_all, 120: bench.server.resume_all}
    executive.on_tick.append(lambda tick: actions.get(tick, lambda: None)())

    assert executive.run(GOAL).success
    assert recoveries(bench) == []
    assert bench.clock.now() > 100 * executive.period


def test_a_robot_that_turns_on_the_spot_oscillates(make_bench):
    bench = make_bench()
    bench.controller.play(drive(0.0, 0.2))
    options = TreeOptions(
        check_poses=False, progress_timeout=0.0, oscillation_timeout=2.0, control_retries=0, replans=0
    )
    result = run(bench, navigation_tree(options))
    assert result.mission.failure_code == ExePathOutcome.OSCILLATION


def test_motors_that_ignore_commands_raise_an_alarm(make_bench):
    bench = make_bench(cmd_vel_ignored_tolerance=0.0)
    bench.robot.stuck = True
    options = TreeOptions(check_poses=False, progress_timeout=0.0, motor_timeout=1.0, control_retries=0, replans=0)
    result = run(bench, navigation_tree(options))
    assert "motors" in result.message
    assert bench.robot.command.is_stopped()


def test_the_control_tree_drives_a_path_given_to_it(make_bench):
    bench = make_bench()
    bench.controller.play(COLLISION, bench.controller.follow)
    result = TreeExecutive(control_tree(OPTIONS), bench.navigator).run(path=bench.path_to(1.0))
    assert result.success
    assert plans(bench) == 0


def test_the_running_node_is_written_to_the_event_log(make_bench):
    bench = make_bench()
    run(bench, navigation_tree(OPTIONS))
    at_work = [event.data["new"] for event in bench.events(EventKind.STATE_CHANGED) if event.source == "tree"]
    assert at_work[:2] == ["get path", "follow path"]
