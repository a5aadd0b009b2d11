"""The main run: plans drawn from seeds, rows that are kept, hashes that tell parameters apart, and what judges rows."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import ndimage

from terrain.experiments.table1.environments import traffic
from terrain.experiments.table1.environments.traffic import CARRIER, HALF_WIDTH, Box, make_traffic, run_ahead
from terrain.experiments.table1.main_run import buildings, conditions, table, trial
from terrain.experiments.table1.main_run.conditions import CONDITIONS
from terrain.experiments.table1.main_run.floor_plans import draw_world, has_detours
from terrain.experiments.table1.main_run.run import known_rows, run_missing, trials
from terrain.experiments.table1.main_run.trial import Trial, hash_of_parameters, tally_of
from terrain.sweeps import log

FROZEN = {"warehouse": "602b0892a9f9", "plans": "4a68ab9c427c"}  # commit 9288830
PLANS = [draw_world(seed) for seed in range(100, 112)]


def blocks(world):
    """Pieces of occupied cells that do not touch the outer walls: what a robot can drive around."""
    _, count = ndimage.label(world.grid().occupied)
    return count - 1


# ------------------------------------------------------------------------------------------------ floor plans
def test_only_the_ring_leads_around_in_odd_plans_and_every_rack_of_the_middle_in_even_ones():
    for seed, world in enumerate(PLANS, start=100):
        assert blocks(world) == (len(world.plan.furniture) // 3 if has_detours(seed) else 1)


def test_all_waypoints_and_routes_of_a_drawn_plan_are_free():
    for world in PLANS:
        grid = world.grid()
        clearance = ndimage.distance_transform_edt(~grid.occupied) * grid.resolution
        for x, y, _ in (world.start, *world.waypoints):
            assert clearance[int(y / 0.05), int(x / 0.05)] > CARRIER.circumscribed_radius + 0.1
        for route in world.routes:
            for a, b in pairwise([*route, route[0]]):
                points = np.linspace(a, b, 100)
                cells = (points / 0.05).astype(int)
                assert (clearance[cells[:, 1], cells[:, 0]] > HALF_WIDTH).all()


def test_the_robots_of_a_drawn_plan_start_clear_of_each_other():
    for seed, world in enumerate(PLANS, start=100):
        boxes = [shuttle.box for shuttle in make_traffic(world.routes, 5, True, np.random.default_rng(seed))]
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_a_seed_draws_the_same_plan_each_time_and_others_draw_others():
    assert draw_world(100) == PLANS[0]
    assert len({world.waypoints for world in PLANS}) == len(PLANS)
    assert {world.routes[0][0][0] < world.waypoints[2][0] for world in PLANS} == {True, False}  # mirrored and not


def test_two_seeds_drive_the_first_half_of_the_round_and_two_the_second():
    building = buildings.buildings(None)["warehouse"]
    halves = [building.half_round(seed) for seed in range(4)]
    assert [half.goals()[0] for half in halves] == [building.world(0).goals()[i] for i in (0, 0, 3, 3)]
    assert halves[2].start[:2] == building.world(0).waypoints[2][:2]


def test_the_others_have_driven_on_when_a_run_begins_and_do_not_touch_each_other():
    for seed in range(100, 108):
        half = buildings.buildings(None)["plans"].half_round(seed)
        shuttles = make_traffic(half.routes, 5, True, np.random.default_rng(seed))
        before = [shuttle.box for shuttle in shuttles]
        run_ahead(shuttles, buildings.head_start(seed), Box(*half.start))
        boxes = [shuttle.box for shuttle in shuttles]
        assert all(box != at_first for box, at_first in zip(boxes, before, strict=True))
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in [*boxes[:i], Box(*half.start)])


# ------------------------------------------------------------------------------------------------ rows
@pytest.fixture
def work(monkeypatch, tally):
    """Let the workers' pool do its jobs here, by a quick substitute, and return what was done."""
    done = []

    def run_all(do, jobs, workers):
        for job in jobs:
            done.append((job.building, job.seed, job.condition))
            yield job, json.loads(json.dumps(trial.row_of(tally(planner=job.seed))))

    monkeypatch.setattr(log, "run_in_workers", run_all)
    return done


def test_all_conditions_and_buildings_of_a_seed_come_before_the_next_seed(tmp_path, work):
    dict(run_missing(tmp_path / "rows.jsonl", trials([1, 2], None), 1))
    assert [seed for _, seed, _ in work] == [1] * 8 + [2] * 8
    assert len(set(work)) == 16 and {condition for _, _, condition in work} == set(CONDITIONS)


def test_a_run_that_is_stopped_in_a_row_goes_on_with_that_row(tmp_path, work, tally):
    file, asked = tmp_path / "rows.jsonl", trials([3], None)
    dict(run_missing(file, asked, 1))
    whole = file.read_bytes()
    file.write_bytes(whole[:-20])
    dict(run_missing(file, asked, 1))
    assert work[8:] == work[7:8]
    assert file.read_bytes() == whole
    assert [tally_of(row).planner_calls for row in known_rows(file, asked).values()] == [{"main_ok": 3}] * 8


def test_a_row_holds_its_hash_and_is_small(tmp_path, work):
    dict(run_missing(tmp_path / "rows.jsonl", trials([4], None), 1))
    lines = (tmp_path / "rows.jsonl").read_text().splitlines()
    for line, asked in zip(lines, trials([4], None), strict=True):
        assert json.loads(line)["key"].startswith(asked.parameters_hash) and len(line) < 600


def test_a_row_gives_back_the_legs_and_names_those_that_were_lost(tally):
    before = tally(planner=9, clear=2, contacts=1, lost=1)
    before.legs[0].message = "stuck at (1.00, 2.00)"
    row = json.loads(json.dumps(trial.row_of(before)))
    after = tally_of(row)
    assert row["lost"] == {"0": "stuck at (1.00, 2.00)"}
    assert (after.legs_lost, after.time, after.recoveries) == (1, pytest.approx(240.0), {"clear_costmaps": 2})


# ------------------------------------------------------------------------------------------------ parameters
@pytest.mark.parametrize(
    ("module", "name", "value"),
    [
        (traffic, "DWELL", 6.0),
        (trial, "CONDITIONS", {**CONDITIONS, "full_tree": replace(conditions.FULL_TREE, escalation=("give_way",))}),
        (buildings.floor_plans, "AISLE_WIDTH", (2.0, 2.5)),
    ],
)
def test_the_hash_changes_with_a_parameter(monkeypatch, module, name, value):
    before = hash_of_parameters("plans", None)
    assert hash_of_parameters("plans", None) == before != hash_of_parameters("warehouse", None)
    monkeypatch.setattr(module, name, value)
    assert hash_of_parameters("plans", None) != before


def test_the_parameters_are_those_that_were_frozen():
    """Rows of other parameters are another run: whoever means to change them says so here and in decision 0053."""
    assert {name: hash_of_parameters(name, None) for name in ("warehouse", "plans")} == FROZEN


# ------------------------------------------------------------------------------------------------ judging
def rows_of(tally, seeds, **by_condition):
    """Rows of the warehouse: each condition's tally as given, the others' as in a run without traffic."""
    return {
        Trial("warehouse", seed, condition, None, "h"): trial.row_of(tally(**by_condition.get(condition, {})))
        for seed in seeds
        for condition in CONDITIONS
    }


def test_a_condition_that_meets_every_bar_and_one_that_misses_all(tally):
    rows = rows_of(
        tally,
        range(3),
        move_base={"planner": 40, "time": 300.0},
        full_tree={"planner": 8, "time": 240.0},
        tree={"planner": 20, "time": 290.0, "lost": 1, "contacts": 1},
    )
    judged = table.result(table.grouped(rows, None))
    ((group, of_conditions),) = judged.items()
    assert group == "warehouse, without"
    assert set(table.bars(group, of_conditions["full_tree"]).values()) == {True}
    assert set(table.bars(group, of_conditions["tree"]).values()) == {False}
    assert of_conditions["full_tree"].planner_ratio.value == pytest.approx(0.2)
    assert of_conditions["tree"].time_ratio_reached.value == pytest.approx(290.0 / 300.0, abs=1e-3)


def test_a_seed_that_a_condition_has_not_driven_does_not_count(tally):
    rows = rows_of(tally, range(2))
    del rows[Trial("warehouse", 1, "tree", None, "h")]
    ((_, tallies),) = table.grouped(rows, None).items()
    assert {len(of_condition) for of_condition in tallies.values()} == {1}


def test_the_learning_curve_ends_at_the_result(tally):
    rows = rows_of(tally, range(4), move_base={"time": 300.0})
    tallies = table.grouped(rows, None)["warehouse, without"]
    curve = table.learning_curve(tallies, "time_ratio")
    assert len(curve) == 4
    assert curve[-1] == table.judge_condition(tallies["full_tree"], tallies["move_base"]).time_ratio
