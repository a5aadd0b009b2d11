"""The count of successes over seeds: what counts as a failure, and that finished runs are not repeated."""

import json
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from terrain.sweeps import log

SOURCE = Path(__file__).resolve().parents[3] / "benchmarks" / "margins.py"
SPEC = spec_from_file_location("margins", SOURCE)
margins = sys.modules["margins"] = module_from_spec(SPEC)
SPEC.loader.exec_module(margins)


def row(scenario, variant, seed, *failures, outcome="SUCCESS", tilt=1.0):
    good = not failures and outcome == "SUCCESS"
    kept = {"success": good, "outcome": outcome, "failures": list(failures), "max_tilt_deg": tilt, "verdict": ""}
    return {"scenario": scenario, "variant": variant, "seed": seed, **kept}


def test_each_scenario_and_variant_is_counted_with_its_reasons():
    rows = [
        row("bridge", "perturbed", 4, "tilt of 40 degrees", tilt=40.04),
        row("bridge", "plain", 3),
        row("bridge", "perturbed", 2, outcome="NO_PATH_FOUND"),
        row("bridge", "perturbed", 3, tilt=7.0),
    ]
    plain, perturbed = margins.summarise(rows)
    assert (plain["variant"], plain["runs"], plain["successes"], plain["failed_seeds"]) == ("plain", 1, 1, [])
    assert (perturbed["runs"], perturbed["successes"], perturbed["failed_seeds"]) == (3, 1, [2, 4])
    assert perturbed["reasons"] == {"tilt": 1, "NO_PATH_FOUND": 1} and perturbed["max_tilt_deg"] == 40.0


def test_the_perturbed_variant_is_the_shipped_scenario_with_all_disturbances():
    assert margins.scenario_of("bridge", "plain") == margins.load_scenario("bridge")
    assert margins.scenario_of("bridge", "perturbed").perturb == margins.PERTURBED


@pytest.fixture
def run_once(monkeypatch):
    """Count jobs instead of running them."""
    done = []

    def run(_, jobs, workers):
        for job in jobs:
            done.append(job)
            yield job, row(*job)

    monkeypatch.setattr(log, "run_in_workers", run)
    return done


def test_runs_that_the_file_holds_are_not_repeated_until_the_source_changes(run_once, tmp_path, monkeypatch):
    file = tmp_path / "runs.jsonl"
    first = [("bridge", "plain", 1), ("bridge", "perturbed", 1)]
    assert len(list(margins.run_jobs(first, 1, file))) == 2
    more = [*first, ("bridge", "plain", 2)]
    assert [one["seed"] for one in margins.run_jobs(more, 1, file)] == [1, 1, 2]
    assert run_once == more and len(file.read_text().splitlines()) == 3
    assert {json.loads(line)["scenario"] for line in file.read_text().splitlines()} == {"bridge"}
    monkeypatch.setattr(margins, "source_digest", lambda: "changed")
    list(margins.run_jobs(first, 1, file))
    assert run_once == [*more, *first]
