"""The conformance suite itself: a backend that does one thing wrong fails the situations about that, and no others."""

from dataclasses import replace

import pytest

from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import PluginKind, RefineResult
from mbf_abstract.testing import check_map_backend
from mbf_abstract.testing.conformance import SITUATIONS, ContractBroken


def ignores_silence(server):
    server.map_problem = lambda: ""


def takes_clearing_for_news(server):
    problem = server.map_problem
    server.map_problem = lambda: "" if "since it was cleared" in problem() else problem()


def plans_on_cleared_maps(server):
    server.awaits_scan = lambda: False


class NeverStale:
    """A map that is never stale, and else as the one it stands for."""

    def __init__(self, navigation_map):
        self._map = navigation_map

    def __getattr__(self, name):
        return getattr(self._map, name)

    def stale_reason(self, now):
        return ""


def drives_recoveries_on_silent_maps(server):
    for name in ("rotate", "back_up"):
        behavior = server.plugins.find(PluginKind.RECOVERY, name).instance
        behavior.navigation_map = NeverStale(behavior.navigation_map)


def swallows_unknown_sources(server):
    take_scan = server.take_scan
    server.take_scan = lambda scan: take_scan(scan) if scan.source == "lidar" else None


def places_scans_by_the_newest_transform(server):
    take_scan, clock = server.take_scan, server.runtime.clock
    server.take_scan = lambda scan: take_scan(replace(scan, stamp=clock.now()))


def fails_when_time_is_over(server):
    def failing(run_behavior, request):
        result = run_behavior(request)
        late = result.outcome == RecoveryOutcome.PAT_EXCEEDED
        return replace(result, outcome=RecoveryOutcome.FAILURE) if late else result

    for name in ("rotate", "back_up"):
        behavior = server.plugins.find(PluginKind.RECOVERY, name).instance
        behavior.run_behavior = lambda request, run=behavior.run_behavior: failing(run, request)


def arrives_wherever_it_is_near(server):
    for plugin in server.plugins.all_of(PluginKind.CONTROLLER):
        follower = plugin.instance
        follower.is_goal_reached = lambda pose, distance, _, own=follower: (
            pose.distance_to(own.tracker.path[-1]) <= distance
        )


def changing_refined_paths(change):
    """A fault: what every refiner gives is changed, its ``apply_refinement`` aside."""

    def fault(server):
        for plugin in server.plugins.all_of(PluginKind.REFINER):
            refiner = plugin.instance
            refiner.refine = lambda path, token, refine=refiner.refine: change(refine(path, token), path)

    return fault


def refines_by_cutting_the_end(server):
    def shorter(result, path):
        refined = result.path if isinstance(result, RefineResult) else result
        return refined[: len(refined) // 2]

    changing_refined_paths(shorter)(server)


def refines_by_straight_lines(server):
    def straight(result, path):
        return Path.from_poses([path[0], path[-1]])

    changing_refined_paths(straight)(server)


def plans_beside_blocked_goals(server):
    planner = server.plugins.all_of(PluginKind.PLANNER)[0].instance
    make_plan = planner.make_plan
    planner.make_plan = lambda request: make_plan(replace(request, dist_tolerance=max(request.dist_tolerance, 0.6)))


def keeps_the_radius_of_its_layers(server):
    server.set_footprint = lambda footprint: None


def believes_its_planners(server):
    server.path_problem = lambda path: ""


FAULTS = {
    keeps_the_radius_of_its_layers: {
        "a_robot_that_grows_no_longer_fits",
        "a_bad_change_changes_nothing",
        "a_bad_change_is_named",
    },
    believes_its_planners: {"a_planned_path_off_the_map_is_refused", "a_refined_path_off_the_map_is_refused"},
    ignores_silence: {
        "a_silent_sensor_holds_the_robot_while_it_drives",
        "a_sensor_that_stays_silent_ends_the_path_with_map_error",
        "a_cleared_map_is_not_driven_on_until_it_sees_again",
        "a_stamp_from_the_future_is_no_sign_of_life",
        "a_scan_of_nothing_but_nan_is_ignored",
    },
    plans_beside_blocked_goals: {
        "a_blocked_goal_is_named",
        "a_goal_where_the_robot_would_touch_something_is_blocked",
        "a_tolerance_reaches_past_the_border",
        "a_tolerance_that_does_not_help_is_named",
    },
    refines_by_cutting_the_end: {
        "a_refined_path_keeps_its_ends_and_is_no_longer",
        "a_refined_path_stays_in_its_frame",
    },
    refines_by_straight_lines: {"a_refined_path_costs_no_more"},
    takes_clearing_for_news: {"a_cleared_map_is_not_driven_on_until_it_sees_again"},
    plans_on_cleared_maps: {"a_plan_after_a_clearing_knows_what_is_seen"},
    drives_recoveries_on_silent_maps: {"a_silent_sensor_holds_a_recovery"},
    swallows_unknown_sources: {"an_unknown_source_is_reported_once"},
    places_scans_by_the_newest_transform: {
        "a_scan_is_placed_by_the_transform_of_its_stamp",
        "a_scan_from_nowhere_or_never_is_refused",
        "a_scan_before_all_transforms_is_refused",
    },
    fails_when_time_is_over: {"a_recovery_out_of_time_ends_with_pat_exceeded"},
    arrives_wherever_it_is_near: {
        "a_loop_is_driven_whole",
        "a_path_out_and_back_is_driven_whole",
        "a_figure_of_eight_is_driven_in_order",
    },
}


def broken_situations(make_server, fault, modules):
    """Names of the situations of some modules that a server with a fault breaks."""

    def make_broken(rig, **parameters):
        server = make_server(rig, **parameters)
        fault(server)
        return server

    for name, situation in SITUATIONS.items():
        if situation.check.__module__ in modules:
            try:
                check_map_backend(make_broken, [name])
            except ContractBroken:
                yield name


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_backend_with_one_fault_breaks_the_situations_about_it(backends, fault):
    modules = {SITUATIONS[name].check.__module__ for name in FAULTS[fault]}

    assert set(broken_situations(backends["costmap"], fault, modules)) == FAULTS[fault]


def test_the_report_names_the_situation_its_rule_and_what_happened(backends):
    def deaf(rig, **parameters):
        server = backends["costmap"](rig, **parameters)
        swallows_unknown_sources(server)
        return server

    with pytest.raises(ContractBroken) as broken:
        check_map_backend(deaf, ["an_unknown_source_is_reported_once", "a_bad_change_changes_nothing"])
    assert "an_unknown_source_is_reported_once breaks the contract of map backends" in str(broken.value)
    assert "expected one report of the unknown source, got 0" in str(broken.value)
    assert "a_bad_change" not in str(broken.value)


def test_every_situation_states_its_rule_in_a_sentence():
    assert all(len(situation.sentence.split()) > 5 for situation in SITUATIONS.values())
