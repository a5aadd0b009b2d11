"""Every shipped scenario succeeds on its own backend."""

import pytest

from terrain.runner import RunOptions, run_scenario
from terrain.scenario import load_scenario, shipped_scenarios

RUN_ELSEWHERE = {"outdoor", "indoor"}  # test_run_scenarios.py

pytestmark = pytest.mark.timeout(300)


def test_at_least_twelve_scenarios_ship_and_each_says_what_it_proves():
    loaded = {name: load_scenario(name) for name in shipped_scenarios()}
    assert len(loaded) >= 12
    assert all(name == scenario.name and scenario.proves.endswith(".") for name, scenario in loaded.items())


@pytest.mark.parametrize("name", sorted(set(shipped_scenarios()) - RUN_ELSEWHERE))
def test_the_shipped_scenario_succeeds(name, shipped, tmp_path):
    result = run_scenario(shipped(name), RunOptions(tmp_path, draw=False))
    assert result.success, result.message
