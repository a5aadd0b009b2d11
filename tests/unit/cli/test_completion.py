"""What the shell offers when the tab key is pressed."""

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app


def offered(typed):
    """What bash is given for a command line whose last word is still being typed."""
    environment = {"_MBF_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    return CliRunner().invoke(make_app(), env=environment, prog_name="mbf").stdout.split()


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("mbf run out", ["outdoor"]),
        ("mbf sweep cr", ["crater_rim", "crowded_corridor"]),
        ("mbf run outdoor --planner any", ["any_angle"]),
        ("mbf run outdoor --planner mesh.an", ["mesh.any_angle"]),
        ("mbf run outdoor --controller follow", ["follow_path"]),
        ("mbf run outdoor --backend me", ["mesh"]),
        ("mbf pl", ["plan", "plugins"]),
    ],
)
def test_what_begins_as_typed_is_offered(typed, words):
    assert offered(typed) == words


def test_a_file_of_ones_own_is_left_to_the_shell(monkeypatch):
    monkeypatch.setattr("shellingham.detect_shell", lambda *_: ("bash", "/bin/bash"))  # below cron there is none
    assert offered("mbf run my_world") == []
    assert "complete -o default" in CliRunner().invoke(make_app(), ["--show-completion"], prog_name="mbf").stdout
