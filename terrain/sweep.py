"""Many runs of one scenario: every seed with every variant, in worker processes, each run exactly once.

Finished runs stand in ``runs.jsonl`` of the sweep's folder, so a sweep that was killed goes on where it was. Workers
run on this machine; each run is as deterministic as ``mbf run`` with the same seed and settings.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import signal
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from types import FrameType
from typing import Any

from terrain.scenario import Scenario

PARENT_CHECK = 1.0  # s between two looks of a worker whether the sweep still lives
MAX_POOLS = 5  # pools that are started anew after a worker died, before the sweep gives up


@dataclass(frozen=True)
class SweepRun:
    """One run of a sweep: a seed and the settings of a variant (``backend`` is one of them)."""

    seed: int
    settings: Mapping[str, str] = field(default_factory=dict)

    @property
    def variant(self) -> str:
        """The settings as a text, such as ``backend=mesh planner=cvp``."""
        return " ".join(f"{key}={value}" for key, value in sorted(self.settings.items()))

    def key(self, scenario_hash: str) -> str:
        """Return what tells this run from all others."""
        return f"{scenario_hash}/{self.seed}/{self.variant}"


Job = tuple[Scenario, SweepRun]


def hash_of(scenario: Scenario) -> str:
    """Return a short hash of everything a scenario's files say."""
    digest = hashlib.sha256(scenario.model_dump_json(exclude={"navigation"}).encode())
    for backend, file in sorted(scenario.navigation.items()):
        digest.update(backend.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def plan_sweep(seeds: Sequence[int], settings: Mapping[str, Sequence[str]]) -> list[SweepRun]:
    """Return every seed with every combination of the settings' values."""
    variants = [dict(zip(settings, values, strict=True)) for values in itertools.product(*settings.values())]
    return [SweepRun(seed, variant) for seed in seeds for variant in variants]


def run_once(scenario: Scenario, run: SweepRun) -> dict[str, Any]:
    """Run a scenario and return its metrics; a run that cannot even begin has the outcome of its error."""
    from terrain.runner import RunOptions, run_scenario

    settings = dict(run.settings)
    backend = settings.pop("backend", None)
    with tempfile.TemporaryDirectory(prefix="mbf_sweep_") as folder:
        options = RunOptions(Path(folder), backend, run.seed, draw=False, settings=settings, geodesic=True)
        try:
            result = run_scenario(scenario, options)
        except Exception as error:  # one impossible variant must not end the sweep
            return {"success": False, "outcome": type(error).__name__, "message": str(error)}
    return {**result.metrics, "outcome_code": result.outcome, "message": result.message}


def run_all(jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Do all jobs in ``workers`` processes and yield each with its metrics as it finishes.

    Raises
    ------
    BrokenProcessPool
        Workers died again and again.
    """
    left = list(jobs)
    for attempt in range(MAX_POOLS):
        try:
            for job, metrics in _run_in_pool(tuple(left), workers):
                left.remove(job)
                yield job, metrics
            return
        except BrokenProcessPool:
            if attempt == MAX_POOLS - 1:
                raise


def _run_in_pool(jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Keep a pool busy; no more runs are handed out than it can work on, so that a stop is quick."""
    waiting, running = iter(jobs), dict[Future[dict[str, Any]], Job]()
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _end_with_the_sweep, (os.getpid(),))
    try:
        for job in itertools.islice(waiting, workers):
            running[pool.submit(run_once, *job)] = job
        while running:
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(done), done.result()
                for job in itertools.islice(waiting, 1):
                    running[pool.submit(run_once, *job)] = job
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _end_with_the_sweep(sweep_process: int) -> None:
    """Let a worker end soon after the sweep was killed; it would wait for work for ever."""

    def check(number: int, frame: FrameType | None) -> None:
        if os.getppid() != sweep_process:
            os._exit(1)

    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, check)
        signal.setitimer(signal.ITIMER_REAL, PARENT_CHECK, PARENT_CHECK)
