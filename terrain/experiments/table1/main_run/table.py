"""Judges the rows of the main run: each condition against move_base on the same seeds, building by building.

A seed counts once all conditions have driven it. Ratios are those of sums over seeds, with a bootstrap over seeds;
below 1 the condition needs less than move_base. Times are also compared over the legs alone that both have reached,
because a lost leg can be short.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from terrain.experiments.table1.counting import Tally
from terrain.experiments.table1.main_run.buildings import WITHOUT, buildings
from terrain.experiments.table1.main_run.conditions import CONDITIONS, MOVE_BASE
from terrain.experiments.table1.main_run.run import Rows
from terrain.experiments.table1.main_run.trial import tally_of
from terrain.experiments.table1.statistics import Ratio, paired_ratio

MOST_LOST = 0.005  # share of legs
MOST_PLANNING = 0.25  # planner calls, of move_base's
MOST_TIME, MOST_TIME_WITH_WAYS = 0.87, 1.0  # of move_base's
CURVE = "full_tree"

Tallies = dict[str, list[Tally]]
"""Of each condition, one for each seed; the seeds are the same for all conditions."""


@dataclass(frozen=True)
class ConditionResult:
    """Sums of a condition over the seeds of a group, and its ratios to move_base."""

    legs: int
    lost: int
    contacts_we: int
    contacts_they: int
    planner_calls: int
    recoveries: int
    time: float
    planner_ratio: Ratio
    time_ratio: Ratio
    time_ratio_reached: Ratio


def grouped(rows: Rows, depot: Path | None) -> dict[str, Tallies]:
    """Tallies of the seeds that all conditions have driven, by building, with or without detours."""
    known = buildings(depot)
    by_place: dict[tuple[str, int], dict[str, Tally]] = {}
    for trial, row in rows.items():
        by_place.setdefault((trial.building, trial.seed), {})[trial.condition] = tally_of(row)
    groups: dict[str, Tallies] = {}
    for (building, seed), of_conditions in sorted(by_place.items()):
        if of_conditions.keys() == CONDITIONS.keys():
            group = groups.setdefault(known[building].group(seed), {condition: [] for condition in CONDITIONS})
            for condition, tally in of_conditions.items():
                group[condition].append(tally)
    return groups


def judge_condition(condition: Sequence[Tally], reference: Sequence[Tally]) -> ConditionResult:
    """Sum a condition up and compare it with the reference on the same seeds."""
    both = [_times_of_legs_both_reached(a, b) for a, b in zip(condition, reference, strict=True)]
    return ConditionResult(
        legs=sum(len(tally.legs) for tally in condition),
        lost=sum(tally.legs_lost for tally in condition),
        contacts_we=_contacts(condition, "/we"),
        contacts_they=_contacts(condition, "/they"),
        planner_calls=sum(tally.all_planner_calls for tally in condition),
        recoveries=sum(tally.all_recoveries for tally in condition),
        time=sum(tally.time for tally in condition),
        planner_ratio=paired_ratio(
            [tally.all_planner_calls for tally in condition], [tally.all_planner_calls for tally in reference]
        ),
        time_ratio=paired_ratio([tally.time for tally in condition], [tally.time for tally in reference]),
        time_ratio_reached=paired_ratio([a for a, _ in both], [b for _, b in both]),
    )


def _times_of_legs_both_reached(a: Tally, b: Tally) -> tuple[float, float]:
    pairs = [(x.time, y.time) for x, y in zip(a.legs, b.legs, strict=True) if x.end == y.end == "reached"]
    return sum(x for x, _ in pairs), sum(y for _, y in pairs)


def _contacts(tallies: Iterable[Tally], who_moved: str) -> int:
    return sum(count for tally in tallies for key, count in tally.contacts.items() if key.endswith(who_moved))


def result(groups: Mapping[str, Tallies]) -> dict[str, dict[str, ConditionResult]]:
    """Judge every condition of every group."""
    reference = MOVE_BASE.base.name
    return {
        group: {condition: judge_condition(tallies[condition], tallies[reference]) for condition in tallies}
        for group, tallies in groups.items()
    }


def learning_curve(tallies: Tallies, measure: str) -> list[Ratio]:
    """Ratio ``planner_ratio`` or ``time_ratio`` of ``CURVE`` after 1, 2, 3 ... seeds, in the order of the seeds."""
    reference = tallies[MOVE_BASE.base.name]
    own = tallies[CURVE]
    ratios = [judge_condition(own[:count], reference[:count]) for count in range(1, len(own) + 1)]
    return [getattr(judged, measure) for judged in ratios]


def bars(group: str, judged: ConditionResult) -> dict[str, bool]:
    """Whether the bars of the experiment are met: lost legs, contacts in which our robot moved, planner calls, time."""
    without = group.endswith(WITHOUT)
    time = judged.time_ratio
    in_time = time.value <= MOST_TIME and time.high < 1.0 if without else time.value <= MOST_TIME_WITH_WAYS
    return {
        "legs": judged.lost <= MOST_LOST * judged.legs,
        "contacts": judged.contacts_we == 0,
        "planning": judged.planner_ratio.value <= MOST_PLANNING,
        "time": in_time,
    }


def show(judged: Mapping[str, Mapping[str, ConditionResult]]) -> Table:
    """Make a table with a row for every condition in every group; what misses its bar has an exclamation mark."""
    names = ("", "condition", "legs", "lost", "contacts we / they", "planner calls", "recoveries", "time")
    table = Table(*names, "planner ratio", "time ratio", "where both arrive")
    for group, conditions in judged.items():
        for number, (condition, of_condition) in enumerate(conditions.items()):
            mark = {name: "" if met else " !" for name, met in bars(group, of_condition).items()}
            table.add_row(
                group if number == 0 else "",
                condition,
                str(of_condition.legs),
                f"{of_condition.lost}{mark['legs']}",
                f"{of_condition.contacts_we} / {of_condition.contacts_they}{mark['contacts']}",
                str(of_condition.planner_calls),
                str(of_condition.recoveries),
                f"{of_condition.time:.0f} s",
                *(
                    ("", "", "")
                    if condition == MOVE_BASE.base.name
                    else (
                        _text(of_condition.planner_ratio) + mark["planning"],
                        _text(of_condition.time_ratio) + mark["time"],
                        _text(of_condition.time_ratio_reached),
                    )
                ),
            )
    table.caption = "! = misses its bar"
    return table


def to_json(judged: Mapping[str, Mapping[str, ConditionResult]]) -> dict[str, Any]:
    """Return plain JSON values, with the bars."""
    return {
        group: {name: {**asdict(found), "bars": bars(group, found)} for name, found in conditions.items()}
        for group, conditions in judged.items()
    }


def _text(ratio: Ratio) -> str:
    return f"{ratio.value:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]"
