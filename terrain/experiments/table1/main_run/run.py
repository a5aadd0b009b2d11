"""Runs the trials that a file of rows does not hold yet, and reads the file: seeds outermost, one JSON line a trial.

The file can be stopped at any time and continued; a change of any parameter makes other keys, so rows of different
parameters never mix.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from terrain.experiments.table1.main_run.buildings import buildings
from terrain.experiments.table1.main_run.conditions import CONDITIONS
from terrain.experiments.table1.main_run.trial import Trial, hash_of_parameters, run_trial
from terrain.provenance.code import commit_of
from terrain.sweeps.log import SweepLog, rows_of

Rows = dict[Trial, dict[str, Any]]


def trials(seeds: Sequence[int], depot: Path | None) -> list[Trial]:
    """All conditions in all buildings on these seeds, so that all of them advance together."""
    hashes = {name: hash_of_parameters(name, depot) for name in buildings(depot)}
    return [
        Trial(building, seed, condition, depot, parameters_hash)
        for seed in seeds
        for building, parameters_hash in hashes.items()
        for condition in CONDITIONS
    ]


def known_rows(file: Path, asked: Sequence[Trial]) -> Rows:
    """The trials that the file holds; raises ConfigError where a line is no row."""
    with SweepLog(file) as log:
        return {trial: log.rows[trial.key] for trial in asked if trial.key in log.rows}


def run_missing(file: Path, asked: Sequence[Trial], workers: int) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Run what the file does not hold and append each row as it is done."""
    known = known_rows(file, asked)
    missing = {trial: trial.key for trial in asked if trial not in known}
    return rows_of(missing, file, run_trial, workers, commit=commit_of(Path(__file__))[:10])
