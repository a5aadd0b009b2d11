"""Every shipped scenario succeeds on its own backend."""

import os

import numpy as np
import pytest

from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario

RUN_ELSEWHERE = {"outdoor", "indoor", "two_couriers"}  # test_run_scenarios.py, test_run_several_robots.py
RUN_WHOLE = os.environ.get("MBF_SAME_BYTES") == "all"  # by tests/determinism, which asks whether they succeed

TIME_TO_NOTICE = 2.0  # s; a second until the map counts as stale, then the robot brakes

pytestmark = [pytest.mark.timeout(300), pytest.mark.usefixtures("one_core")]


def test_at_least_twelve_scenarios_ship_and_each_says_what_it_proves():
    loaded = {name: load_scenario(name) for name in shipped_scenarios()}
    assert len(loaded) >= 12
    assert all(name == scenario.name and scenario.proves.endswith(".") for name, scenario in loaded.items())


if not RUN_WHOLE:

    @pytest.mark.parametrize("name", sorted(set(shipped_scenarios()) - RUN_ELSEWHERE))
    def test_the_shipped_scenario_succeeds(name, shipped, tmp_path):
        result = run_scenario(shipped(name), RunOptions(tmp_path))
        assert result.success, result.verdict


def test_the_robot_stands_still_while_its_lidar_is_silent(shipped, tmp_path):
    scenario = shipped("sensor_blackout")
    blackout = scenario.faults[0]
    run_scenario(scenario, RunOptions(tmp_path))
    with np.load(tmp_path / "recording.npz") as recording:
        times, forward = recording["times"], recording["twists"][:, 0]
    silent = (times > blackout.start + TIME_TO_NOTICE) & (times < blackout.end)
    assert np.abs(forward[silent]).max() < 0.02
    assert np.abs(forward[times < blackout.start]).max() > 0.2
    assert np.abs(forward[times > blackout.end]).max() > 0.2
