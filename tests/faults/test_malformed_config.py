"""Fault table, rows 21, 29 and 30: malformed, huge and hostile configurations."""

import random

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.reading import load_config, validate_config
from mbf_abstract.config.registry import PluginRegistry

GOOD = """\
backend: none
planner_patience: 5.0
controller_frequency: 20
planners:
  - {name: planner, type: 'mbf_abstract.testing.scripted:ScriptedPlanner'}
controllers:
  - name: controller
    type: mbf_abstract.testing.scripted:ScriptedController
planner: {}
"""


def check(path):
    raw = load_config(path)
    return validate_config(raw, {}, PluginRegistry("none", allow_module_types=raw.allow_module_types))


def refused(folder, text):
    path = folder / "robot.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        check(path)
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (GOOD + "planer_patience: 3\n", ":10: planer_patience: expected a known key"),
        (GOOD.replace("5.0", "soon"), ":2: planner_patience: expected a number >= 0 and <= 100 s, got 'soon'"),
        (GOOD.replace("5.0", "500"), ":2: planner_patience: expected a number >= 0 and <= 100 s, got 500"),
        (GOOD.replace("5.0", ".nan"), ":2: planner_patience: expected a finite number"),
        (GOOD.replace("5.0", "-.inf"), ":2: planner_patience: expected a finite number"),
        ("", ":1: expected a mapping of keys to values, got an empty file"),
        ("- backend: none\n", ":1: expected a mapping of keys to values, got a list of 1 items"),
        (GOOD + "planner_patience: 3\n", ":10: planner_patience: expected each key once"),
        ("a: " + "{b: " * 60 + "1" + "}" * 60, "levels of nesting"),
        ("a: &a [1]\n" + "".join(f"b{i}: *a\n" for i in range(200)), ":102: expected at most 100 aliases"),
        ("a: b: c\n", ":1: expected YAML"),
        (GOOD.replace("planner: {}", "planner: [1]"), ":9: planner: expected a block of keys"),
        (GOOD + "x: " + "y" * 10_000_000, ":1: expected at most 1000000 bytes, got a larger file"),
    ],
)
def test_a_malformed_configuration_is_refused_with_file_and_line(tmp_path, text, expected):
    message = refused(tmp_path, text)
    assert f"{tmp_path / 'robot.yaml'}" in message
    assert expected in message


@pytest.mark.parametrize(
    "tag", ["!!python/object/apply:os.mkdir", "!!python/object/new:os.mkdir", "!!python/name:os.x"]
)
def test_a_configuration_can_run_nothing(tmp_path, tag):
    victim = tmp_path / "made_by_yaml"
    assert "expected a plain value" in refused(tmp_path, f"{GOOD}x: {tag} ['{victim}']\n")
    assert not victim.exists()


def test_module_types_can_be_forbidden(tmp_path):
    message = refused(tmp_path, GOOD + "allow_module_types: false\n")
    assert message.count("switched off (allow_module_types)") == 2


def mutate(text, rng):
    """Damage a text as a tired user would: drop, double or swap lines, change characters, move the indentation."""
    lines = text.splitlines()
    for _ in range(rng.randint(1, 4)):
        index, kind = rng.randrange(len(lines)), rng.randrange(6)
        if kind == 0 and len(lines) > 1:
            del lines[index]
        elif kind == 1:
            lines.insert(index, lines[index])
        elif kind == 2:
            lines[index] = " " * rng.randint(1, 3) + lines[index]
        elif kind == 3:
            at = rng.randrange(len(lines[index]) + 1)
            lines[index] = lines[index][:at] + rng.choice("{}[]:,'\"&*!|>-#%@\t\0\\ é0") + lines[index][at:]
        elif kind == 4:
            lines[index] = lines[index].replace(": ", rng.choice([":", ": [", ": {", ": &a ", ": *a ", ": -", ": ~ #"]))
        else:
            lines[index] = lines[index][: rng.randrange(len(lines[index]) + 1)]
        if not lines:
            return ""
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("block", range(4))
def test_any_damage_gives_a_configuration_or_findings_with_lines(tmp_path, block):
    path, refusals = tmp_path / "robot.yaml", 0
    for seed in range(block * 150, (block + 1) * 150):
        path.write_text(mutate(GOOD, random.Random(seed)), encoding="utf-8")
        try:
            check(path)
        except ConfigError as error:
            refusals += 1
            assert error.findings
            assert all(finding.line >= 1 and finding.expected for finding in error.findings)
    assert refusals > 75
