"""The scenario in the documentation is a scenario, and the sweep beside it can be planned."""

import re
import shlex
from pathlib import Path

import pytest
import yaml

from terrain.scenarios.library import LIBRARY
from terrain.scenarios.scenario import load_scenario, robot_scenarios
from terrain.scenarios.settings import apply_world_settings
from terrain.session.runner import RunOptions, run_scenario
from terrain.sweeps.command import parse_seeds, parse_settings

PAGE = Path(__file__).resolve().parents[2] / "docs" / "write_a_scenario.md"


def blocks_of_the_page():
    return re.findall(r"```yml\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.fixture
def example(tmp_path):
    """The scenario of the page, as a reader would put it into a file."""
    text, _ = blocks_of_the_page()
    (tmp_path / "config").symlink_to(LIBRARY / "config")
    (tmp_path / "example.yaml").write_text(text)
    return load_scenario(tmp_path / "example.yaml")


@pytest.mark.timeout(300)
def test_the_scenario_of_the_page_succeeds(example, tmp_path):
    result = run_scenario(example, RunOptions(tmp_path / "run"))
    assert result.success, str(result.verdict)


def test_the_scenario_of_the_page_is_read_without_a_finding(example):
    assert (example.odometry, len(example.actors), len(example.faults)) == ("wheels", 1, 2)


def test_the_robots_of_the_page_take_the_place_of_one_robot_in_a_shipped_scenario(tmp_path):
    _, robots = blocks_of_the_page()
    kept = yaml.safe_load((LIBRARY / "two_couriers.yaml").read_text())
    (tmp_path / "config").symlink_to(LIBRARY / "config")
    (tmp_path / "robots.yaml").write_text(yaml.safe_dump(kept | yaml.safe_load(robots)))
    anna, ben = robot_scenarios(load_scenario(tmp_path / "robots.yaml")).values()
    assert (anna.robot, anna.start, ben.robot) == ("turtlebot", "reception", "husky")


def test_every_setting_of_the_sweep_on_the_page_fits_its_scenario():
    (line,) = re.findall(r"^mbf sweep .*$", PAGE.read_text(), re.MULTILINE)
    words = shlex.split(line)
    settings = parse_settings([words[i + 1] for i, word in enumerate(words) if word == "--set"])
    assert len(parse_seeds(words[words.index("--seeds") + 1])) == 50
    for key, values in settings.items():
        for value in values:
            scenario, _ = apply_world_settings(load_scenario(words[2]), {key: value})
    assert scenario.world.spacing == pytest.approx(0.5)
