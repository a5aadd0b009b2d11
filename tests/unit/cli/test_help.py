"""What ``--help`` shows of every command."""

import re

import pytest
import typer
from typer.testing import CliRunner

from mbf_abstract.cli import make_app


def commands(command, words=()):
    yield words, command
    for name, child in getattr(command, "commands", {}).items():
        yield from commands(child, (*words, name))


@pytest.mark.parametrize(("words", "command"), commands(typer.main.get_command(make_app())))
def test_the_help_of_a_command_keeps_the_units_of_its_options(words, command):
    shown = CliRunner().invoke(make_app(), [*words, "--help"], env={"COLUMNS": "200"}).output
    for option in command.params:
        for unit in re.findall(r"\[.*?\]", getattr(option, "help", None) or ""):
            assert unit.replace(" ", "") in re.sub(r"\s", "", shown)
    for child in getattr(command, "commands", {}).values():
        assert child.get_short_help_str(1000) in re.sub(r"\s+", " ", shown), "what a command does is not cut"
