"""``mbf run`` takes another planner, controller or value; ``mbf scenarios --copy`` gives a scenario to start from."""

import pytest
import typer
import yaml
from typer.testing import CliRunner

from mbf_abstract.config.findings import ConfigError
from terrain.commands.run import register, settings_of
from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.scenario import copy_scenario, load_scenario
from terrain.scenarios.settings import apply_settings


def mbf(*arguments):
    app = typer.Typer(pretty_exceptions_enable=False)
    register(app)
    return CliRunner(env={"COLUMNS": "200"}).invoke(app, [str(argument) for argument in arguments])


def test_options_and_settings_become_one_set_of_settings():
    chosen = settings_of(["world.size=[3, 4]", "a.b=c=d"], planner="cvp", controller="")

    assert chosen == {"planner": "cvp", "world.size": "[3, 4]", "a.b": "c=d"}


def test_they_change_the_configuration_that_is_run():
    text = load_scenario("indoor").navigation["costmap"].read_text()
    controller = yaml.safe_load(text)["controllers"][-1]["name"]

    changed = yaml.safe_load(apply_settings(text, settings_of(["planner_patience=7.5"], controller=controller)))

    assert (changed["controllers"][0]["name"], changed["planner_patience"]) == (controller, 7.5)


@pytest.mark.parametrize("text", ["planner", "=1", "planner=", ""])
def test_a_setting_without_key_or_value_is_exit_code_2(text, tmp_path):
    result = mbf("run", "indoor", "--set", text, "--out", tmp_path / "run")

    assert result.exit_code == 2 and "KEY=VALUE" in result.output
    assert not (tmp_path / "run").exists()


def test_a_key_that_is_set_twice_is_exit_code_2(tmp_path):
    result = mbf("run", "indoor", "--planner", "astar", "--set", "planner=dijkstra", "--out", tmp_path / "run")

    assert result.exit_code == 2 and "planner is set twice" in result.output


@pytest.mark.parametrize("name", shipped_scenarios())
def test_a_copied_scenario_is_the_same_scenario(name, tmp_path):
    first, *configurations = copy_scenario(name, tmp_path)

    copied, shipped = load_scenario(first), load_scenario(name)
    assert copied.model_dump(exclude={"navigation"}) == shipped.model_dump(exclude={"navigation"})
    assert {key: file.read_bytes() for key, file in copied.navigation.items()} == {
        key: file.read_bytes() for key, file in shipped.navigation.items()
    }
    assert all(tmp_path in file.resolve().parents for file in copied.navigation.values())
    assert len(configurations) == len(shipped.navigation)


def test_a_copy_overwrites_nothing(tmp_path):
    (tmp_path / "config").mkdir()
    mine = tmp_path / copy_scenario("indoor", tmp_path / "other")[1].relative_to(tmp_path / "other")
    mine.write_text("mine")

    with pytest.raises(ConfigError, match="a file that does not exist yet"):
        copy_scenario("indoor", tmp_path)

    assert mine.read_text() == "mine" and not (tmp_path / "indoor.yaml").exists()


def test_the_command_prints_what_it_has_copied_and_names_what_it_knows(tmp_path):
    result = mbf("scenarios", "--copy", "indoor", "--to", tmp_path)

    assert result.stdout.splitlines()[0] == str(tmp_path / "indoor.yaml")
    unknown = mbf("scenarios", "--copy", "moon")
    assert unknown.exit_code == 2 and "outdoor" in unknown.output
