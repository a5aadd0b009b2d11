"""Short real runs of the experiment: one leg in the warehouse, both conditions; and the same log twice."""

from dataclasses import replace
from pathlib import Path

import pytest

from terrain.experiments.table1.conditions import CONDITIONS, without_traffic
from terrain.experiments.table1.environments.outdoor_environment import OUTDOOR
from terrain.experiments.table1.environments.world import WAREHOUSE
from terrain.experiments.table1.main_run import buildings
from terrain.experiments.table1.main_run.trial import Trial, run_trial, tally_of
from terrain.experiments.table1.repetition import run_repetition

pytestmark = [  # a leg takes some ten seconds of processor time
    pytest.mark.timeout(300),
    pytest.mark.usefixtures("one_core"),
]
DEPOT = Path(__file__).with_name("table1_depot.yaml")


@pytest.mark.parametrize("condition", ["S1", "B"])
def test_an_empty_world_costs_one_plan_one_hand_over_and_no_recovery(condition):
    run = run_repetition(without_traffic(CONDITIONS[condition]), WAREHOUSE, seed=100, legs=1)
    tally = run.tally
    assert (tally.all_planner_calls, tally.controller_calls, tally.all_recoveries) == (1, 1, 0)
    leg = tally.legs[0]
    assert leg.end == "reached"
    assert sum(leg.split.values()) == pytest.approx(leg.time)
    assert leg.distance > 15.0
    assert tally.control_cycles > 15.0 / 0.6 * 20.0


def test_both_conditions_meet_the_same_traffic_and_a_run_repeats_bit_for_bit():
    crowded = replace(CONDITIONS["B"], surroundings=replace(CONDITIONS["B"].surroundings, robots=10))
    first, again = (run_repetition(crowded, WAREHOUSE, seed=101, legs=1) for _ in range(2))
    assert first.digest == again.digest
    assert (first.track == again.track).all()


def test_the_outdoor_environment_drives_a_leg_on_the_mesh():
    run = run_repetition(CONDITIONS["B"], OUTDOOR, seed=100, legs=1)
    assert run.tally.legs[0].end == "reached"
    assert run.tally.planner_calls["main_ok"] >= 1


def test_the_experiment_runs_in_another_building():
    run = run_repetition(CONDITIONS["B"], DEPOT, seed=100, legs=1)
    assert run.tally.legs[0].end == "reached"
    assert not run.tally.contacts


def test_a_trial_of_the_main_run_drives_in_a_drawn_plan_and_leaves_its_row(monkeypatch):
    monkeypatch.setattr(buildings, "LEGS", 1)
    row = run_trial(Trial("plans", 101, "full_tree", None, "hash"))
    tally = tally_of(row)
    assert [leg.end for leg in tally.legs] == ["reached"]
    assert tally.planner_calls["main_ok"] >= 1 and not tally.contacts and "lost" not in row
