"""Many runs of one scenario: every seed with every variant, each run exactly once.

Finished runs are kept in ``runs.jsonl`` of the sweep's folder, so a killed sweep continues where it stopped. Each run
is as deterministic as ``mbf run`` with the same seed and settings.
"""

from __future__ import annotations

import hashlib
import itertools
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mbf_abstract.config.findings import ConfigError
from terrain.provenance.named_files import hash_with_named_files, named_files
from terrain.recording.recording import Recording
from terrain.recording.verdict import Level
from terrain.scenarios.perturbation import DrawnError
from terrain.scenarios.scenario import Scenario


@dataclass(frozen=True)
class SweepRun:
    """One run of a sweep: a seed and the settings of a variant (``backend`` is one of them)."""

    seed: int
    settings: Mapping[str, str] = field(default_factory=dict)

    @property
    def variant(self) -> str:
        """The settings as a text, such as ``backend=mesh planner=cvp``."""
        return " ".join(f"{key}={value}" for key, value in sorted(self.settings.items()))

    @property
    def folder(self) -> str:
        """Where the run is kept in the folder of its sweep, such as ``runs/planner=cvp_1a2b3c/seed_4``."""
        name = re.sub(r"[^\w.=-]+", "_", self.variant)[:MAX_NAME] or "as_written"
        return f"runs/{name}_{hashlib.sha256(self.variant.encode()).hexdigest()[:6]}/seed_{self.seed}"

    def key(self, scenario_hash: str) -> str:
        """Return the key of this run; a file that a setting names counts with its contents."""
        named = named_files(list(self.settings.values()), Path())
        files = [hash_with_named_files(file).hex()[:16] for file in named.values()]
        return "/".join([scenario_hash, str(self.seed), self.variant, *files])


Job = tuple[Scenario, SweepRun]
Row = Mapping[str, Any]

MAX_NAME = 60  # characters of a variant in the name of its folder
MAX_TRACK = 200  # points of a track in the log, for figures


def hash_of(scenario: Scenario) -> str:
    """Return a short hash of the contents of a scenario's files, with maps, meshes, images and the files they name."""
    contents = scenario.model_dump_json(exclude={"navigation": True, "robots": {"__all__": {"navigation"}}})
    digest = hashlib.sha256(contents.encode())
    for files in (scenario.navigation, *(robot.navigation or {} for robot in scenario.robots)):
        for backend, file in sorted(files.items()):
            digest.update(backend.encode() + hash_with_named_files(file))
    for file in named_files(scenario.model_dump(mode="json", exclude={"navigation"}), Path("/")).values():
        digest.update(hash_with_named_files(file))
    return digest.hexdigest()[:16]


def plan_sweep(seeds: Sequence[int], settings: Mapping[str, Sequence[str]]) -> list[SweepRun]:
    """Return every seed with every combination of the settings' values."""
    variants = [dict(zip(settings, values, strict=True)) for values in itertools.product(*settings.values())]
    return [SweepRun(seed, variant) for seed in seeds for variant in variants]


def is_done(row: Mapping[str, Any] | None, keep: bool) -> bool:
    """Whether a run need not be done: it was, and its folder is kept if that is asked for and it has one.

    A run that could not begin has no track and no folder, and would not begin now.
    """
    return row is not None and not (keep and "track" in row and "folder" not in row)


def run_unless_refused(
    jobs: Sequence[Job], known: Sequence[Row], spread: Callable[..., Iterator[tuple[Job, Row]]]
) -> Iterator[tuple[Job, Row]]:
    """Yield each job with its row as it finishes; the first refusal of settings stands for all their other runs.

    Parameters
    ----------
    known : sequence of dict
        Rows of runs that were done before.
    spread : callable
        Does the jobs it is given as far as they are ``wanted``, see ``run_in_workers``.
    """
    refused, left = {row["variant"]: row for row in known if row.get("refused")}, list(jobs)
    for job, row in spread(jobs=jobs, wanted=lambda job: job[1].variant not in refused):
        left.remove(job)
        if row.get("refused"):
            refused.setdefault(job[1].variant, row)
        yield job, row
    yield from ((job, refused[job[1].variant]) for job in left)


def run_once(job: Job, keep_in: Path | None = None, command: str = "") -> dict[str, Any]:
    """Run a scenario and return its metrics and its track; one that cannot even begin has the outcome of its error.

    Parameters
    ----------
    keep_in : Path, optional
        Folder of the sweep, if the run's own folder is to be kept in it, with all views; ``folder`` of the result is
        its path from there.
    command : str
        The command line that the run's folder records.
    """
    from terrain.session.runner import RunOptions, run_scenario
    from terrain.viewer.results import write_joint_results, write_results

    scenario, run = job
    settings = dict(run.settings)
    backend = settings.pop("backend", None)
    tracks: list[list[list[float]]] = []

    def write_views(folder: Path, recording: Recording, metrics: Mapping[str, Any]) -> Sequence[str]:
        tracks.append(thinned_track(recording))
        return () if keep_in is None else write_results(folder, recording, metrics)

    with tempfile.TemporaryDirectory(prefix="mbf_sweep_") as temporary:
        folder = Path(temporary) if keep_in is None else keep_in / run.folder
        options = RunOptions(
            folder, backend, run.seed, settings=settings, geodesic=True, command=command, write_views=write_views
        )
        if keep_in is not None:
            options = replace(options, write_joint_views=write_joint_results)
        try:
            result = run_scenario(scenario, options)
        except Exception as error:  # one impossible variant must not end the sweep
            return _not_begun(error, folder)
    return {**result.metrics, "track": tracks[0], **({} if keep_in is None else {"folder": run.folder})}


def _not_begun(error: Exception, folder: Path) -> dict[str, Any]:
    """The row of a run that could not begin; ``refused`` if no other one with its settings can, whatever its seed."""
    # The folder has another name each time; the same runs give the same bytes.
    name, message = type(error).__name__, str(error).replace(f"{folder}/", "")
    refused = isinstance(error, ConfigError) and not isinstance(error, DrawnError)
    return {
        "success": False,
        "level": Level.FAILED.value,
        "verdict": f"refused with every seed: {message}" if refused else f"{name}: {message}",
        "outcome": name,
        "message": message,
        "refused": refused,
        "spl": 0.0,
    }


def thinned_track(recording: Recording) -> list[list[float]]:
    """Return x and y [m] of a track, to the millimetre, at no more than ``MAX_TRACK`` samples, the ends among them."""
    count = len(recording.poses)
    indices = sorted({round(step * (count - 1) / (MAX_TRACK - 1)) for step in range(MAX_TRACK)}) if count else []
    return [[round(x, 3), round(y, 3)] for x, y in recording.poses[indices, :2].tolist()]
