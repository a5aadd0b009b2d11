"""Robots that are known by their URDF alone, made by others, arrive: outdoors, indoors, and on legs."""

from pathlib import Path

import pytest

from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "robots"


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", ["husky_outdoors", "racecar_indoors", "a1_indoors"])
def test_a_robot_of_others_arrives_and_breaks_no_limit(name, tmp_path):
    result = run_scenario(load_scenario(EXAMPLES / f"{name}.yaml"), RunOptions(tmp_path))
    assert result.success, str(result.verdict)
