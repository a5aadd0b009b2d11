"""What ``mbf check`` knows of scenarios, and of configurations that get their maps from a scenario's world."""

from __future__ import annotations

from pathlib import Path

import typer

from mbf_abstract.commands.check import Checked
from mbf_abstract.config.bounded_files import is_there
from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.yaml_source import YamlDocument, read_yaml

YAML_SUFFIXES = {".yaml", ".yml"}
OF_SCENARIOS_ONLY = ("world", "navigation")
PLACEHOLDER, OF_A_ROBOT = "$WORLD_", "$ROBOT_"


def check(file: Path, load: bool) -> Checked | None:
    """Check a scenario, or a configuration that names ``$WORLD_MESH`` or ``$WORLD_MAP``; None for anything else.

    Raises
    ------
    ConfigError
        All that is wrong with it, its configurations, its world and its plugins.
    """
    if file.suffix not in YAML_SUFFIXES:
        if is_there(file):
            return None
        from terrain.scenarios.scenario import scenario_file

        file = scenario_file(str(file))
    document = read_yaml(file, [])
    if document is None:
        return None  # whoever reads it next reports why
    if any(key in document.data for key in OF_SCENARIOS_ONLY):
        return _check_scenario(document, load)
    text = file.read_text(encoding="utf-8-sig")
    if OF_A_ROBOT in text:
        return _check_with_stand_in_robot(file)
    return _check_with_stand_in(file, load) if PLACEHOLDER in text else None


def _check_scenario(document: YamlDocument, load: bool) -> Checked:
    from terrain.scenarios.scenario import robot_scenarios
    from terrain.session.scenario_check import check_scenario

    report = check_scenario(document, load=load)
    if report.findings or report.scenario is None:
        for note in report.notes:  # what was assumed of the robot may be the cause
            typer.echo(f"note: {note}", err=True)
        raise ConfigError(report.findings)
    scenario = report.scenario
    views = robot_scenarios(scenario).values()
    backends = dict.fromkeys(backend for view in views for backend in view.navigation)
    robots = f", {len(views)} robots" if scenario.robots else ""
    goals = sum(len(view.goals) for view in views)
    plural = "" if goals == 1 else "s"
    summary = f"world {scenario.world.type}, backends {', '.join(backends)}{robots}, {goals} goal{plural}"
    return Checked(summary, report.notes)


def _check_with_stand_in(file: Path, load: bool) -> Checked:
    from mbf_abstract.commands.check import check_config
    from terrain.session.scenario_check import check_on_level_ground

    checked = check_config(file, load=False)
    if not load:
        return checked
    findings = check_on_level_ground(file)
    if findings:
        raise ConfigError(findings)
    return Checked(checked.summary, ("level ground stands in for the maps that a scenario's world gives",))


def _check_with_stand_in_robot(file: Path) -> Checked:
    """Check a configuration that takes the numbers of a robot, which are not known without a scenario."""
    from terrain.session.scenario_check import check_on_level_ground

    findings = check_on_level_ground(file)
    if findings:
        raise ConfigError(findings)
    return Checked("checked for a Husky", ("a Husky on level ground stands in for the robot and world of a scenario",))
