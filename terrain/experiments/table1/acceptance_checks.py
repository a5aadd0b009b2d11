"""The five acceptance checks: the result of the main run counts only if all of them pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from terrain.experiments.table1.conditions import RECOVERIES
from terrain.experiments.table1.counting import Tally
from terrain.experiments.table1.statistics import recovery_mix

EQUAL_TIMES = 0.01


@dataclass(frozen=True)
class Check:
    """One check: its name, whether it has passed, and what was found."""

    name: str
    passed: bool
    found: str


def no_traffic(a: Sequence[Tally], b: Sequence[Tally]) -> Check:
    """Check 1: in an empty world both conditions plan and hand over once a leg, never recover, and are equally fast."""
    counts = [
        (tally.all_planner_calls, tally.controller_calls, tally.all_recoveries, len(tally.legs), tally.legs_lost)
        for tally in (*a, *b)
    ]
    plain = all(
        planner == legs == plans and recoveries == lost == 0 for planner, plans, recoveries, legs, lost in counts
    )
    times = [sum(tally.time for tally in tallies) for tallies in (a, b)]
    equal = abs(times[0] - times[1]) <= EQUAL_TIMES * max(times)
    sums = [
        f"{sum(t.all_planner_calls for t in tallies)} planner calls, {sum(t.controller_calls for t in tallies)} "
        f"controller calls, {sum(t.all_recoveries for t in tallies)} recoveries, {time:.1f} s"
        for tallies, time in zip((a, b), times, strict=True)
    ]
    return Check("1 no traffic: one plan a leg, no recovery, times equal within 1 %", plain and equal, " | ".join(sums))


def same_drives(first: Sequence[str], again: Sequence[str]) -> Check:
    """Check 2: the same conditions and seeds, run twice, were the same drives (given their digests)."""
    equal = len(first) == len(again) > 0 and all(x == y for x, y in zip(first, again, strict=True))
    return Check(
        "2 same seed twice: identical drives", equal, f"{len(first)} runs, {len(set(first) & set(again))} found again"
    )


def recoveries_add_up(tallies: Sequence[Tally], totals: Sequence[int]) -> Check:
    """Check 3: the five behaviours' calls add up to the number of recovery goals in the log."""
    counted = [tally.all_recoveries for tally in tallies]
    known = all(set(tally.recoveries) <= set(RECOVERIES) for tally in tallies)
    equal = known and counted == list(totals)
    return Check("3 recoveries add up to their total", equal, f"{sum(counted)} calls, {sum(totals)} goals")


def no_more_hand_overs_than_plans(a: Sequence[Tally]) -> Check:
    """Check 4: condition A hands over no more plans than it has asked for."""
    worst = max(tally.controller_calls - tally.all_planner_calls for tally in a)
    return Check("4 controller calls <= planner calls in condition A", worst <= 0, f"largest difference {worst}")


def falls_along_the_list(a: Sequence[Tally]) -> Check:
    """Check 5: condition A runs no behaviour more often than the one before it in its list."""
    mix = recovery_mix(a)
    counts = [mix[name] for name in RECOVERIES]
    falls = all(first >= second for first, second in pairwise(counts))
    return Check("5 condition A's recoveries do not rise along its list", falls, " >= ".join(map(str, counts)))
