"""How much every shipped scenario can bear: successes of many seeds, as written and disturbed.

    python benchmarks/margins.py [--quick] [--json] [--scenarios switchback,...] [--seeds 0:100] [--workers N]
                                 [--results FILE]

A run counts as a success as in ``mbf run``: it arrived in truth and kept every limit of its scenario. "plain" is the
scenario as it ships; "perturbed" adds ``PERTURBED`` below, drawn from the run's seed: another start, friction and mass,
noisier ranges and poses, commands that arrive late. The bar is 99 of 100, on seeds that nobody has tuned with.

``--results`` keeps every finished run as a JSON line; a run that is in the file is not repeated as long as the
scenario and the source code are what they were.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from seeds import seed_list

from mbf_abstract.time.program_end import interruptible
from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.perturbation import Perturbation
from terrain.scenarios.scenario import Scenario, load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.sweeps.log import rows_of
from terrain.sweeps.sweep import hash_of

PACKAGES = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "terrain")
PERTURBED = Perturbation(
    start_position=0.05,
    start_yaw=3.0,
    friction=0.2,
    mass=0.1,
    range_noise=0.02,
    pose_position=0.03,
    pose_angle=1.0,
    command_delay=0.05,
)
VARIANTS = {"plain": None, "perturbed": PERTURBED}
QUICK_SCENARIOS = ("door_closes", "bridge")
KEPT = ("success", "outcome", "failures", "time_s", "max_tilt_deg", "verdict", "digest")

Job = tuple[str, str, int]  # scenario, variant, seed


def scenario_of(name: str, variant: str) -> Scenario:
    """A shipped scenario as it is, or with the perturbation."""
    scenario, perturb = load_scenario(name), VARIANTS[variant]
    return scenario if perturb is None else scenario.model_copy(update={"perturb": perturb})


def run_job(job: Job) -> dict[str, Any]:
    """Run one seed of one variant of a scenario, for its verdict only."""
    name, variant, seed = job
    with tempfile.TemporaryDirectory(prefix="mbf_margins_") as folder:
        result = run_scenario(scenario_of(name, variant), RunOptions(Path(folder), seed=seed))
    numbers = result.metrics
    return {"scenario": name, "variant": variant, "seed": seed} | {key: numbers.get(key) for key in KEPT}


def run_jobs(jobs: Iterable[Job], workers: int, results: Path) -> Iterator[dict[str, Any]]:
    """Yield the row of every job: first those that the file holds, then the others as they finish."""
    source = source_digest()
    hashes = {(name, variant): hash_of(scenario_of(name, variant)) for name, variant, _ in jobs}
    keys = {job: f"{source}/{hashes[job[:2]]}/{job[2]}" for job in jobs}
    yield from (row for _, row in rows_of(keys, results, run_job, workers))


def source_digest() -> str:
    """A short hash of all source code that decides how a run goes."""
    digest, root = hashlib.sha256(), Path(__file__).resolve().parents[1]
    for file in sorted(file for package in PACKAGES for file in (root / package).rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def summarise(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One line per scenario and variant: runs, successes, largest tilt [deg], and why the others failed."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["scenario"], row["variant"]), []).append(row)
    lines = []
    for (name, variant), runs in sorted(groups.items(), key=lambda item: (item[0][0], item[0][1] != "plain")):
        failed = [run for run in runs if not run["success"]]
        reasons = Counter(reason for run in failed for reason in reasons_of(run))
        lines.append(
            {
                "scenario": name,
                "variant": variant,
                "runs": len(runs),
                "successes": len(runs) - len(failed),
                "max_tilt_deg": round(max(run["max_tilt_deg"] for run in runs), 1),
                "failed_seeds": sorted(run["seed"] for run in failed),
                "reasons": dict(reasons.most_common()),
            }
        )
    return lines


def reasons_of(run: Mapping[str, Any]) -> list[str]:
    """Why a run has failed: what its verdict holds against it, by the first word, or else its outcome."""
    return [failure.split()[0] for failure in run["failures"]] or [str(run["outcome"])]


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two seeds of two scenarios")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--scenarios", default="", help="names, comma-separated; all that ship if not given")
    parser.add_argument("--variants", default=",".join(VARIANTS))
    parser.add_argument("--seeds", type=seed_list, default="0:100", help="first and one past the last seed, or a list")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--results", type=Path, help="file of finished runs")
    options = parser.parse_args()
    names = options.scenarios.split(",") if options.scenarios else list(shipped_scenarios())
    seeds = options.seeds
    if options.quick:
        names, seeds = list(QUICK_SCENARIOS), seeds[:2]
    jobs = [(name, variant, seed) for seed in seeds for name in names for variant in options.variants.split(",")]
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for row in run_jobs(jobs, options.workers, options.results or Path(folder) / "runs.jsonl"):
            rows.append(row)
            if not row["success"] and not options.json:
                print(f"  {row['scenario']} {row['variant']} seed {row['seed']}: {row['verdict']}", flush=True)
    lines = summarise(rows)
    if options.json:
        print(json.dumps(lines, indent=2))
        return
    print(f"{'scenario':18} {'variant':10} {'successes':>12} {'max tilt':>9}  reasons of failure")
    for line in lines:
        counted, reasons = f"{line['successes']} of {line['runs']}", line["reasons"]
        print(
            f"{line['scenario']:18} {line['variant']:10} {counted:>12} {line['max_tilt_deg']:7.1f} °  {reasons or ''}"
        )


if __name__ == "__main__":
    with interruptible():
        main()
