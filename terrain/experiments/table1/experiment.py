"""The experiment as steps: checks, main comparison, the other readings and ablations, and the result as one mapping.

The main run begins only if the checks that do not need it have passed; the three others are applied to the main run
itself, before its verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from terrain.experiments.table1.acceptance_checks import (
    Check,
    falls_along_the_list,
    no_more_hand_overs_than_plans,
    no_traffic,
    recoveries_add_up,
    same_drives,
)
from terrain.experiments.table1.campaign import Campaign, Job, parameters_of, tally_of
from terrain.experiments.table1.conditions import ABLATIONS, CONDITIONS, MAIN_A, MAIN_B, READINGS
from terrain.experiments.table1.counting import Tally
from terrain.experiments.table1.environments.outdoor_environment import OUTDOOR
from terrain.experiments.table1.statistics import (
    MEASURES,
    clear_share,
    compare,
    entropy,
    recovery_mix,
    time_split,
    wilcoxon_p,
)
from terrain.experiments.table1.verdict import judge, verdict

MAIN = (MAIN_A.name, MAIN_B.name)
REPEATED_SEEDS = 1  # of the given seeds are also run a second time
EMPTY_WORLD_SEEDS = 10
PLANNER_KEYS = ("main_ok", "main_failed", "second_ok", "second_failed")
CONTACT_KEYS = ("rack/we", "robot/we", "robot/they")

Rows = dict[Job, dict[str, Any]]
OnRow = Callable[[Job, Mapping[str, Any]], None]


class ChecksFailed(RuntimeError):
    """An acceptance check has failed; the text names it and what was found."""


def run_experiment(campaign: Campaign, seeds: Sequence[int], ablations: bool, on_row: OnRow) -> dict[str, Any]:
    """Do all runs that have not been done yet and return the contents of the result file.

    Raises
    ------
    ChecksFailed
        The runs without traffic or the repeated ones failed a check; the main run was not begun.
    """

    def run(jobs: Sequence[Job]) -> Rows:
        rows: Rows = {}
        for job, row in campaign.rows(jobs):
            rows[job] = row
            on_row(job, row)
        return {job: rows[job] for job in jobs}

    outdoor = campaign.world == OUTDOOR
    checks = [same_drives(*_digests(campaign, seeds, run))]
    if not outdoor:
        checks.insert(0, _check_of_empty_world(campaign, run))
    failed = [f"{check.name}: {check.found}" for check in checks if not check.passed]
    if failed:
        raise ChecksFailed("; ".join(failed))
    further = (*(() if outdoor else READINGS), *(ABLATIONS if ablations else ()))
    names = [*MAIN, *(condition.name for condition in further)]
    rows = {name: run([campaign.job(name, seed) for seed in seeds]) for name in names}
    tallies = {name: [tally_of(row) for row in of_condition.values()] for name, of_condition in rows.items()}
    checks += _checks_of_main_run(tallies, [row for name in MAIN for row in rows[name].values()])
    return _result(campaign, seeds, checks, tallies)


def tracks(campaign: Campaign, seeds: Sequence[int]) -> dict[str, list[Any]]:
    """Read the tracks of the main conditions back, all runs being done."""
    jobs = [campaign.job(name, seed) for name in MAIN for seed in seeds]
    rows = dict(campaign.rows(jobs))
    return {name: [rows[job]["track"] for job in jobs if job.condition == name] for name in MAIN}


def _check_of_empty_world(campaign: Campaign, run: Callable[[Sequence[Job]], Rows]) -> Check:
    rows = [run([campaign.job(name, seed, empty=True) for seed in range(EMPTY_WORLD_SEEDS)]) for name in MAIN]
    return no_traffic(*([tally_of(row) for row in of_condition.values()] for of_condition in rows))


def _digests(campaign: Campaign, seeds: Sequence[int], run: Callable[[Sequence[Job]], Rows]) -> list[list[str]]:
    """Return the digests of some runs, and of the same runs again."""
    twice = [(name, seed) for name in MAIN for seed in seeds[:REPEATED_SEEDS]]
    jobs = [[campaign.job(name, seed, again=again) for name, seed in twice] for again in (False, True)]
    return [[row["digest"] for row in run(of_one).values()] for of_one in jobs]


def _checks_of_main_run(tallies: Mapping[str, Sequence[Tally]], rows: Sequence[Mapping[str, Any]]) -> list[Check]:
    a, both = tallies[MAIN_A.name], [tally for name in MAIN for tally in tallies[name]]
    return [
        recoveries_add_up(both, [row["recovery_goals"] for row in rows]),
        no_more_hand_overs_than_plans(a),
        falls_along_the_list(a),
    ]


def _result(
    campaign: Campaign, seeds: Sequence[int], checks: Sequence[Check], tallies: Mapping[str, Sequence[Tally]]
) -> dict[str, Any]:
    a, b = (tallies[name] for name in MAIN)
    criteria, ratios = judge(a, b), compare(a, b)
    return {
        "parameters_hash": campaign.parameters_hash,
        "parameters": parameters_of(campaign.world),
        "seeds": list(seeds),
        "checks": [asdict(check) for check in checks],
        "conditions": {name: summary(name, of_condition) for name, of_condition in tallies.items()},
        "ratios": {name: asdict(ratio) for name, ratio in ratios.items()},
        "wilcoxon_p": wilcoxon_p([tally.time for tally in a], [tally.time for tally in b]),
        "criteria": [asdict(criterion) for criterion in criteria],
        "verdict": verdict(criteria, ratios["planner calls"].value),
    }


def summary(name: str, tallies: Sequence[Tally]) -> dict[str, Any]:
    """Sum up one condition: what the table shows, and every repetition's numbers."""
    mix = recovery_mix(tallies)
    planner = {key: sum(tally.planner_calls.get(key, 0) for tally in tallies) for key in PLANNER_KEYS}
    contacts = {key: sum(tally.contacts.get(key, 0) for tally in tallies) for key in CONTACT_KEYS}
    legs = [leg for tally in tallies for leg in tally.legs]
    return {
        "text": CONDITIONS[name].text,
        **{measure: sum(of(tally) for tally in tallies) for measure, of in MEASURES.items()},
        "planner": planner,
        "control cycles": sum(tally.control_cycles for tally in tallies),
        "recoveries": dict(sorted(mix.items())),
        "useless recoveries": sum(tally.useless for tally in tallies),
        "entropy": entropy(mix),
        "clear share": clear_share(mix),
        "split": time_split(tallies),
        "distance": sum(leg.distance for leg in legs),
        "contacts": contacts,
        "legs": {end: sum(leg.end == end for leg in legs) for end in ("reached", "aborted", "timed_out")},
        "repetitions": [{measure: of(tally) for measure, of in MEASURES.items()} for tally in tallies],
    }
