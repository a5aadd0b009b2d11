"""What ``--help`` shows of every command."""

import re

import pytest
import typer
from typer.testing import CliRunner

from mbf_abstract.cli import keep_parameters_of, make_app


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


@pytest.mark.parametrize("wanted", ["", "run", "map"])
def test_only_the_command_that_is_called_has_its_parameters_and_all_have_their_text(wanted):
    whole, app = typer.main.get_command(make_app()), make_app()
    keep_parameters_of(app, wanted)
    lean = typer.main.get_command(app)

    assert CliRunner().invoke(app, ["--help"]).output == CliRunner().invoke(make_app(), ["--help"]).output
    assert lean.commands.keys() == whole.commands.keys()
    for (words, command), (_, before) in zip(commands(lean), commands(whole), strict=True):
        if len(words) > 0 and words[0] == wanted:
            assert [one.name for one in command.params] == [one.name for one in before.params]
            assert type(command) is type(before)
        elif len(words) > 0:
            assert [one.name for one in command.params] == ["help"] * any(one.name == "help" for one in command.params)
            assert command.help == before.help
    if wanted:
        shown = [CliRunner().invoke(one, [wanted, "--help"]).output for one in (app, make_app())]
        assert shown[0] == shown[1]
