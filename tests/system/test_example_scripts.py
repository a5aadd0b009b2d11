"""The scripts of ``examples`` that take a scenario and a backend: their help, and what they say of a wrong call."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SCRIPTS = ("go_there", "navigation_tree", "waypoints_state_machine")


def called(script, *words):
    """Run a script of the examples."""
    command = [sys.executable, str(EXAMPLES / f"{script}.py"), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("script", SCRIPTS)
def test_help_is_no_failure(script):
    done = called(script, "-h")
    assert done.returncode == 0 and not done.stderr
    assert f"python examples/{script}.py" in done.stdout


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("nowhere", "mesh"), "nowhere:1: expected a file, or one of bridge, "),
        (("indoor", "typo"), "indoor:1: navigation: expected one of mesh, costmap, got 'typo'"),
    ],
)
def test_an_unknown_scenario_or_backend_is_one_line(script, words, text):
    done = called(script, *words)
    assert done.returncode == 2
    assert done.stderr.startswith(text) and done.stderr.count("\n") == 1, done.stderr


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_missing_argument_is_named(script):
    done = called(script, "indoor")
    assert done.returncode == 2 and "required: backend" in done.stderr
