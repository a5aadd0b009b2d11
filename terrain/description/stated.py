"""What a user states of a robot on the command line: a URDF, and keys with values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument
from terrain.description.parameters import UrdfRobot


def stated_robot(urdf: str, settings: list[str]) -> UrdfRobot:
    """Make a robot's parameters from ``KEY=VALUE`` texts, whose values are YAML.

    Raises
    ------
    ConfigError
        A text is no such pair, a key is unknown, or a value is not legal; all findings.
    """
    data: dict[str, Any] = {"urdf": urdf}
    findings: list[Finding] = []
    for text in settings:
        key, _, value = text.partition("=")
        if not key or not value or key == "urdf":
            findings.append(Finding("--set", 1, "", "KEY=VALUE with a key of a scenario's robot", repr(text)))
            continue
        try:
            data[key] = yaml.safe_load(value)
        except yaml.YAMLError:
            findings.append(Finding("--set", 1, key, "a value as in a YAML file", repr(value)))
    robot = validate(UrdfRobot, data, YamlDocument(Path("--set"), data), (), findings)
    if robot is None or findings:
        raise ConfigError(findings)
    return robot
