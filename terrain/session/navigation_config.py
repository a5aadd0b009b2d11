"""The configuration of a run's server: the scenario's, with the files of its world and the numbers of its robot.

Errors about it, and about the scenario, name the files that somebody has written.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import yaml

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.yaml_source import YamlDocument, load_yaml, read_yaml
from terrain.description.placeholders import fill_in
from terrain.provenance.named_files import InputCopies, with_whole_folders
from terrain.scenarios.scenario import Scenario, load_scenario, robot_scenarios, scenario_file
from terrain.scenarios.settings import apply_settings
from terrain.urdf_robots.robot_choice import RobotChoice, description_of

WRITTEN = "navigation.yaml"


def write_navigation_config(
    source: Path,
    robot: RobotChoice,
    maps: Mapping[str, Path],
    folder: Path,
    settings: Mapping[str, str],
    inputs: InputCopies,
) -> Path:
    """Write a configuration with the world's map files and the robot's numbers; a run can be planned again from it.

    Parameters
    ----------
    source : Path
        The configuration. Files that it names, by paths from its own folder, are copied into ``inputs``.
    robot : str or UrdfRobot
        Whose numbers stand for ``$ROBOT_FOOTPRINT`` and others.
    maps : mapping of str to Path
        Placeholder of the configuration -> map file.
    """
    text = source.read_text()
    names = {file: os.path.relpath(file, folder) for file in maps.values()}
    for placeholder, file in maps.items():
        text = text.replace(placeholder, names[file])
    text = fill_in(text, str(source), partial(description_of, robot))
    target = folder / WRITTEN
    target.write_text(apply_settings(text, settings))
    document = read_yaml(target, [])  # what is wrong with it is reported when the server reads it
    if document is not None:
        renamed = inputs.renamed(document.data, source.parent, set(names.values()))
        renamed = with_whole_folders(renamed, source.parent)
        if renamed != document.data:
            target.write_text(yaml.safe_dump(renamed, sort_keys=False))
    return target


@contextmanager
def errors_in_source(source: Path, folder: Path, settings: Mapping[str, str]) -> Iterator[None]:
    """Let a ConfigError of the configuration written to ``folder`` name its source, and the lines of its keys there."""
    try:
        yield
    except ConfigError as error:
        document = read_yaml(source, []) or YamlDocument(source, {})
        raise ConfigError([_in_source(one, document, folder, settings) for one in error.findings]) from error


@contextmanager
def errors_in_scenario(given: Scenario | str) -> Iterator[Scenario]:
    """Yield a scenario, the one of a name or a file loaded; a ConfigError about it then names its file and lines."""
    if isinstance(given, Scenario):
        yield given
        return
    loaded = load_scenario(given)
    try:
        yield loaded
    except ConfigError as error:
        document = load_yaml(scenario_file(given))
        names = {"scenario", loaded.name, *(view.name for view in robot_scenarios(loaded).values())}
        located = [document.located(one) if one.file in names else one for one in error.findings]
        raise type(error)(located) from error


def _in_source(finding: Finding, source: YamlDocument, folder: Path, settings: Mapping[str, str]) -> Finding:
    if finding.file != str(folder / WRITTEN):
        return finding
    return replace(source.located(finding), file=f"{source.path}{' (with settings)' if settings else ''}")
