"""Each check passes what is right and fails what is not."""

import pytest

from terrain.experiments.table1.acceptance_checks import (
    falls_along_the_list,
    no_more_hand_overs_than_plans,
    no_traffic,
    recoveries_add_up,
    same_drives,
)


@pytest.mark.parametrize(
    "changes", [{"planner": 7}, {"controller": 7}, {"clear": 1}, {"time": 246.0}, {"lost": 1}], ids=str
)
def test_the_empty_world_check_fails_for_anything_but_one_plan_a_leg_and_equal_times(tally, changes):
    assert no_traffic([tally()], [tally(time=242.0)]).passed
    assert not no_traffic([tally()], [tally(**changes)]).passed


def test_the_log_check_compares_run_by_run():
    assert same_drives(["a", "b"], ["a", "b"]).passed
    assert not same_drives(["a", "b"], ["b", "a"]).passed
    assert not same_drives([], []).passed


def test_the_sum_check_finds_a_recovery_that_was_counted_twice_or_is_unknown(tally):
    assert recoveries_add_up([tally(clear=2, other=1)], [3]).passed
    assert not recoveries_add_up([tally(clear=2, other=1)], [2]).passed
    strange = tally(clear=1)
    strange.recoveries["dance"] = 1
    assert not recoveries_add_up([strange], [2]).passed


def test_more_hand_overs_than_plans_fail_the_check(tally):
    assert no_more_hand_overs_than_plans([tally(planner=8, controller=8)]).passed
    assert not no_more_hand_overs_than_plans([tally(), tally(planner=8, controller=9)]).passed


def test_recoveries_that_rise_along_the_list_fail_the_check(tally):
    assert falls_along_the_list([tally(clear=3, other=3)]).passed
    assert not falls_along_the_list([tally(clear=3, other=4)]).passed
