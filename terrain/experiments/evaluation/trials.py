"""Drives the trials of a protocol: every entry in every world once, in parallel, whatever a plugin does.

Finished runs stand in ``runs.jsonl`` of the evaluation's folder and are not repeated, so that a killed evaluation goes
on where it stopped; a run that hung or crashed is done again by the next command. A run is known by the hash of its
trial, its settings and the code of plugins of others.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from terrain.experiments.evaluation.protocol import Entry, Judge, Protocol, Trial
from terrain.recording.verdict import Level
from terrain.sweeps.guarded_workers import Lost, run_guarded
from terrain.sweeps.log import SweepLog
from terrain.sweeps.sweep import SweepRun, run_once

Row = dict[str, Any]

KEPT = (
    "success",
    "level",
    "outcome",
    "message",
    "verdict",
    "spl",
    "time_s",
    "path_length_m",
    "clearance_min_m",
    "planning_wall_median_ms",
    "energy_j",
    "slipped_m",
    "incidents",
    "collisions_while_moving",
    "near_misses",
    "digest",
)
LOST = "LOST"
FAILURES = ("planner", "controller", "contact", "physics", "error")
PHYSICS = {"tipped_over", "stuck", "high_centred"}
PLANNER_OUTCOMES = set(GetPathOutcome.__members__) - set(ExePathOutcome.__members__)


@dataclass(frozen=True)
class Task:
    """One run of an entry, or of the judge where there is none."""

    trial: Trial
    entry: Entry | None
    judge: Judge


def run_trials(
    protocol: Protocol,
    entries: Sequence[Entry],
    folder: Path,
    workers: int,
    time_limit: float,
    on_row: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """Do what the folder's log does not hold; return the rows of all runs, by trial and entry.

    Parameters
    ----------
    time_limit : float
        Wall time [s] of one run; see ``terrain.sweeps.guarded_workers``.
    on_row : callable
        Called with the row of each run that was done now.

    Raises
    ------
    ConfigError
        The log is no log.
    RuntimeError
        The judge itself was lost, such as for want of memory.
    """
    tasks = {
        task_key(protocol, trial, entry): Task(trial, entry, protocol.judge)
        for trial in protocol.trials
        for entry in (None, *entries)
    }
    with SweepLog(folder / "runs.jsonl") as log:
        for key in [key for key, row in log.rows.items() if row.get("outcome") == LOST]:
            log.forget(key)  # perhaps the machine was at fault
        left = {id(task): key for key, task in tasks.items() if key not in log.rows}
        todo = [task for key, task in tasks.items() if key not in log.rows]
        with closing(run_guarded(do_task, todo, workers, time_limit, runs_other_code)) as results:
            for task, result in results:
                row = lost_row(task, result) if isinstance(result, Lost) else result
                log.append(left[id(task)], row)
                if task.entry is not None:
                    on_row({**row, **_named(task.trial, task.entry)})
        return list(_rows(protocol, entries, log))


def _rows(protocol: Protocol, entries: Sequence[Entry], log: SweepLog) -> Iterator[Row]:
    for trial in protocol.trials:
        route = log.rows[task_key(protocol, trial, None)]["route"]
        for entry in entries:
            row = {key: value for key, value in log.rows[task_key(protocol, trial, entry)].items() if key != "key"}
            yield {"trial": protocol.trial_hash(trial), **_named(trial, entry), "route": route, **row}


def _named(trial: Trial, entry: Entry) -> Row:
    return {"world": trial.scenario.name, "seed": trial.seed, "entry": entry.name}


def task_key(protocol: Protocol, trial: Trial, entry: Entry | None) -> str:
    """Return what a run is known by; the name of its entry does not count."""
    of_entry = "route" if entry is None else [entry.backend, dict(entry.settings), entry.code]
    digest = hashlib.sha256(json.dumps(of_entry, sort_keys=True).encode()).hexdigest()[:16]
    return f"{protocol.trial_hash(trial)}/{digest}"


def runs_other_code(task: Task) -> bool:
    """Whether a run imports modules that are not of this project and may keep something from world to world."""
    return task.entry is not None and bool(task.entry.code)


def do_task(task: Task) -> Row:
    """Drive, or judge, one trial."""
    scenario, seed = task.trial.scenario, task.trial.seed
    if task.entry is None:
        return {"route": task.judge(scenario, seed)}
    metrics = run_once((scenario, SweepRun(seed, {**task.entry.settings, "backend": task.entry.backend})))
    return {**{name: metrics.get(name) for name in KEPT}, "failure": failure_of(metrics)}


def failure_of(metrics: Row) -> str:
    """Class of a failure, one of ``FAILURES``; empty for a success."""
    if metrics["success"]:
        return ""
    if "time_s" not in metrics:
        return "error"  # it could not even begin
    if PHYSICS & set(metrics["incidents"]):
        return "physics"
    if metrics["collisions_while_moving"]:
        return "contact"
    no_plan = metrics["plans"] == 0  # planner and controller share some codes, such as BLOCKED_GOAL
    return "planner" if no_plan or metrics["outcome"] in PLANNER_OUTCOMES else "controller"


def lost_row(task: Task, lost: Lost) -> Row:
    """Return the row of a run whose process hung or crashed."""
    if task.entry is None:
        raise RuntimeError(f"the judge of {task.trial.scenario.name}, seed {task.trial.seed}: {lost.reason}")
    row = dict.fromkeys(KEPT) | {"success": False, "level": Level.FAILED.value, "outcome": LOST, "spl": 0.0}
    return {**row, "message": lost.reason, "verdict": lost.reason, "incidents": [], "failure": "error"}
