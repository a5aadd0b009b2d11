"""What the counter reads from an event log."""

from collections import Counter

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from terrain.experiments.table1.counting import ACTIVITIES, count


def one_leg(log, end="reached", begin=10.0, finish=30.0):
    """Frame what is already in the log by the events of one leg."""
    inside = list(log)
    log.clear()
    log.own(begin, "leg_started", leg=0)
    log.extend(inside)
    log.own(finish, "leg_ended", leg=0, end=end, distance=12.5, message="")
    return count(log)


def test_calls_of_both_planners_are_counted_apart_with_their_failures(log):
    log.call(11.0, 11.4, "main", "make_plan")
    log.call(12.0, 12.4, "main", "make_plan", outcome=56)
    log.call(13.0, 13.4, "second", "make_plan", outcome=56)
    tally = one_leg(log)
    assert tally.planner_calls == {"main_ok": 1, "main_failed": 1, "second_failed": 1}
    assert tally.all_planner_calls == 3


def test_each_moment_of_a_leg_is_one_activity(log):
    # 10 plan 11 wait 12 drive 15 recover (still rolling) 17 drive 20 wait 30
    log.call(10.0, 11.0, "main", "make_plan")
    log.own(12.0, "motion", moves=True)
    log.call(15.0, 17.0, "out_of_collision", "run_behavior")
    log.own(20.0, "motion", moves=False)
    leg = one_leg(log).legs[0]
    assert leg.split == pytest.approx({"planning": 1.0, "driving": 6.0, "recovering": 2.0, "waiting": 11.0})
    assert sum(leg.split.values()) == pytest.approx(leg.time) == pytest.approx(20.0)


def test_the_second_planner_does_not_count_as_planning_time(log):
    log.call(10.0, 15.0, "second", "make_plan")
    assert one_leg(log).legs[0].split["planning"] == 0.0


@pytest.mark.parametrize(("comes_back_after", "code", "useless"), [(4.0, 110, 1), (6.0, 110, 0), (4.0, 104, 0)])
def test_a_recovery_was_useless_if_the_same_failure_comes_back_within_five_seconds(
    log, comes_back_after, code, useless
):
    log.add(11.0, EventKind.GOAL_FINISHED, "exe_path", outcome=110)
    log.call(12.0, 13.0, "clear_costmaps", "run_behavior")
    log.add(13.0 + comes_back_after, EventKind.GOAL_FINISHED, "exe_path", outcome=code)
    tally = one_leg(log)
    assert tally.recoveries == {"clear_costmaps": 1}
    assert tally.useless == useless


def test_lost_legs_and_contacts_are_distinguished(log):
    log.own(11.0, "contact", touched="robot", moved="they")
    log.own(15.0, "contact", touched="rack", moved="we")
    tally = one_leg(log, end="timed_out")
    assert tally.contacts == {"robot/they": 1, "rack/we": 1}
    assert tally.legs_lost == 1
    assert tally.legs[0].distance == 12.5


def test_a_random_log_is_counted_as_a_naive_reader_counts_it(log):
    rng = np.random.default_rng(3)
    names, expected, time = ["main", "second"], Counter(), 10.0
    for _ in range(200):
        time += float(rng.uniform(0.0, 0.2))
        choice = int(rng.integers(4))
        if choice == 0:
            plugin, outcome = names[int(rng.integers(2))], int(rng.choice([0, 56]))
            log.call(time, time, plugin, "make_plan", outcome=outcome)
            expected[f"{plugin}_{'ok' if outcome == 0 else 'failed'}"] += 1
        elif choice == 1:
            log.own(time, "set_plan")
            expected["set_plan"] += 1
        elif choice == 2:
            log.own(time, "cycle", outcome=0)
            expected["cycle"] += 1
        else:
            log.call(time, time, "escape_distance", "run_behavior")
            expected["escape_distance"] += 1
    tally = one_leg(log, finish=time + 1.0)
    found = Counter({**tally.planner_calls, **tally.recoveries})
    found.update({"set_plan": tally.controller_calls, "cycle": tally.control_cycles})
    assert found == expected
    assert set(tally.legs[0].split) == set(ACTIVITIES)
