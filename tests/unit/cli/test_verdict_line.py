"""The verdict in a terminal has the colour of its level."""

import pytest
import typer
from typer.testing import CliRunner

from terrain.commands.verdict_line import print_verdict
from terrain.recording.verdict import Verdict

GREEN, YELLOW, RED = "\x1b[32m", "\x1b[33m", "\x1b[31m"


@pytest.mark.parametrize(
    ("verdict", "colour"),
    [
        (Verdict(0, "goal reached"), GREEN),
        (Verdict(0, "goal reached", ("the robot tipped over",)), YELLOW),
        (Verdict(110, "blocked", ("the robot tipped over",)), RED),
    ],
)
def test_the_line_is_green_yellow_or_red_in_a_terminal_and_plain_text_in_a_file(verdict, colour):
    app = typer.Typer()
    app.command()(lambda: print_verdict(verdict, "left: "))

    assert CliRunner().invoke(app, color=True).stdout == f"{colour}left: {verdict}\x1b[0m\n"
    assert CliRunner().invoke(app).stdout == f"left: {verdict}\n"


def test_a_message_that_no_terminal_can_print_is_printed_nevertheless():
    app = typer.Typer()
    app.command()(lambda: print_verdict(Verdict(0, "\ud800")))

    assert CliRunner().invoke(app).exit_code == 0
