"""Many runs of one scenario: every seed with every variant, in worker processes, each run exactly once.

Finished runs stand in ``runs.jsonl`` of the sweep's folder, so a sweep that was killed goes on where it was. Workers
run on this machine; each run is as deterministic as ``mbf run`` with the same seed and settings.
"""

from __future__ import annotations

import hashlib
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from terrain.scenario import Scenario
from terrain.worker_pool import run_in_workers


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
            name, message = type(error).__name__, str(error)
            return {"success": False, "verdict": f"{name}: {message}", "outcome": name, "message": message}
    return result.metrics


def run_all(jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Do all jobs in ``workers`` processes and yield each with its metrics as it finishes.

    Raises
    ------
    BrokenProcessPool
        Workers died again and again.
    """
    return run_in_workers(_run_job, jobs, workers)


def _run_job(job: Job) -> dict[str, Any]:
    return run_once(*job)
