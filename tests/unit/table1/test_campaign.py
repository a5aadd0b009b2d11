"""Runs are done once and kept; a change of parameters makes them anew."""

import json

import pytest

from mbf_abstract.config.findings import ConfigError
from terrain.experiments.table1.campaign import Campaign, hash_of_parameters, tally_of
from terrain.experiments.table1.environments.world import WAREHOUSE, load_world
from terrain.sweeps import log


@pytest.fixture
def work(monkeypatch, tally):
    """Let the workers' pool do its jobs here, by a quick substitute, and return the names of what was done."""
    done = []

    def run_all(do, jobs, workers):
        for job in jobs:
            done.append(job.name)
            made = tally(planner=6 + job.seed)
            yield job, {"tally": json.loads(json.dumps(made, default=vars)), "digest": job.name}

    monkeypatch.setattr(log, "run_in_workers", run_all)
    return done


def test_a_finished_run_is_not_done_again_and_comes_back_as_it_was(tmp_path, work, tally):
    first = Campaign(tmp_path, WAREHOUSE)
    jobs = [first.job("B", seed) for seed in range(3)]
    dict(first.rows(jobs[:2]))
    again = Campaign(tmp_path, WAREHOUSE)
    rows = dict(again.rows(jobs))
    assert work == ["B/0", "B/1", "B/2"]
    assert [tally_of(rows[job]) for job in jobs] == [tally(planner=6 + seed) for seed in range(3)]


def test_a_run_that_was_cut_off_in_the_middle_of_its_line_is_done_again(tmp_path, work):
    campaign = Campaign(tmp_path, WAREHOUSE)
    jobs = [campaign.job("B", seed) for seed in range(2)]
    dict(campaign.rows(jobs))
    log = tmp_path / "runs.jsonl"
    log.write_bytes(log.read_bytes()[:-20])
    dict(Campaign(tmp_path, WAREHOUSE).rows(jobs))
    assert work == ["B/0", "B/1", "B/1"]


def test_runs_of_other_parameters_do_not_count(tmp_path, work, monkeypatch):
    job = Campaign(tmp_path, WAREHOUSE).job("B", 0)
    dict(Campaign(tmp_path, WAREHOUSE).rows([job]))
    monkeypatch.setattr("terrain.experiments.table1.environments.traffic.DWELL", 6.0)
    dict(Campaign(tmp_path, WAREHOUSE).rows([job]))
    assert work == ["B/0", "B/0"]


def test_the_same_runs_with_and_without_traffic_and_repeated_are_kept_apart(tmp_path, work):
    campaign = Campaign(tmp_path, WAREHOUSE)
    jobs = [campaign.job("S1", 0), campaign.job("S1", 0, empty=True), campaign.job("S1", 0, again=True)]
    assert len(dict(campaign.rows(jobs))) == len(set(work)) == 3


def test_the_hash_does_not_depend_on_where_the_world_file_lies(tmp_path):
    for file in (WAREHOUSE, WAREHOUSE.with_name("warehouse.plan.yaml")):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    assert hash_of_parameters(tmp_path / WAREHOUSE.name) == hash_of_parameters(WAREHOUSE)


def test_a_world_with_mistakes_is_refused_with_all_of_them(tmp_path):
    file = tmp_path / "world.yaml"
    file.write_text("name: bad\nstart: [0, 0]\nroutes: []\n")
    with pytest.raises(ConfigError) as error:
        load_world(file)
    assert {finding.key for finding in error.value.findings} == {"start[2]", "waypoints"}
