"""Each gate opens for what is right and closes for what is not."""

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
def test_the_empty_world_gate_closes_for_anything_but_one_plan_a_leg_and_equal_times(tally, changes):
    assert no_traffic([tally()], [tally(time=242.0)]).open
    assert not no_traffic([tally()], [tally(**changes)]).open


def test_the_log_gate_compares_run_by_run():
    assert same_drives(["a", "b"], ["a", "b"]).open
    assert not same_drives(["a", "b"], ["b", "a"]).open
    assert not same_drives([], []).open


def test_the_sum_gate_finds_a_recovery_that_was_counted_twice_or_is_unknown(tally):
    assert recoveries_add_up([tally(clear=2, other=1)], [3]).open
    assert not recoveries_add_up([tally(clear=2, other=1)], [2]).open
    strange = tally(clear=1)
    strange.recoveries["dance"] = 1
    assert not recoveries_add_up([strange], [2]).open


def test_more_hand_overs_than_plans_close_a_gate(tally):
    assert no_more_hand_overs_than_plans([tally(planner=8, controller=8)]).open
    assert not no_more_hand_overs_than_plans([tally(), tally(planner=8, controller=9)]).open


def test_recoveries_that_rise_along_the_list_close_a_gate(tally):
    assert falls_along_the_list([tally(clear=3, other=3)]).open
    assert not falls_along_the_list([tally(clear=3, other=4)]).open
