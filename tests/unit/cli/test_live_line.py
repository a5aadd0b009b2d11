"""The live line: what it says, and that it keeps quiet where nobody looks."""

import io
import math
from dataclasses import replace
from datetime import datetime

import pytest
from rich.console import Console

from mbf_abstract.commands.waiting import waiting
from terrain.commands.live_line import LiveLine, progress_text
from terrain.commands.new_run import new_run_folder
from terrain.session.runner import Progress

DRIVING = Progress(time=12.0, wall_time=3.0, distance_left=34.56, speed=0.8, tilt=math.radians(7.0), state="active")


def test_the_line_shows_time_factor_state_distance_speed_and_tilt():
    text = progress_text(DRIVING)

    for part in ("12.0 s", "4.0 x", "active", "34.6 m left", "0.80 m/s", "7.0°"):
        assert part in text


def test_an_unknown_distance_is_shown_as_dashes():
    waiting = Progress(time=0.0, wall_time=0.0, distance_left=math.nan, speed=0.0, tilt=0.0, state="starting")

    assert "nan" not in progress_text(waiting)


def shown(show=True, terminal=True, **calls):
    """What a live line leaves in the terminal's stream; ``calls`` are its methods with their argument."""
    text = io.StringIO()
    with LiveLine(show, Console(file=text, force_terminal=terminal, width=140)) as live:
        for method, argument in calls.items():
            getattr(live, method)(argument)
    return text.getvalue()


def test_on_a_terminal_steps_and_the_drive_are_shown():
    assert "building the world" in shown(step="building the world")
    assert "34.6 m left" in shown(step="building the world", progress=DRIVING)


@pytest.mark.parametrize(("show", "terminal"), [(True, False), (False, True)])
def test_without_a_terminal_and_when_asked_to_be_quiet_only_notes_are_printed(show, terminal):
    text = shown(show, terminal, step="building the world", progress=DRIVING, note="matplotlib is missing")

    assert text == "matplotlib is missing\n"


@pytest.mark.parametrize(
    ("step", "finished", "total"),
    [("warming up planner cvp (2 of 5)", 2, 5), ("building the world", 0, None)],
)
def test_a_step_that_reports_how_many_there_are_fills_the_bar(step, finished, total):
    live = LiveLine(console=Console(file=io.StringIO()))
    for text in ("warming up planner astar (1 of 7)", step):
        live.step(text)

    (task,) = live._bar.tasks
    assert (task.completed, task.total) == (finished, total)


def test_the_bar_of_a_drive_is_the_part_of_the_way_that_is_done():
    live = LiveLine(console=Console(file=io.StringIO()))
    for left in (math.nan, 40.0, 50.0, 20.0):
        live.progress(replace(DRIVING, distance_left=left))

    (task,) = live._bar.tasks
    assert (task.completed, task.total) == (30.0, 50.0)


@pytest.mark.parametrize("terminal", [True, False])
def test_waiting_is_shown_on_terminals_only(terminal):
    text = io.StringIO()
    with waiting("planning", Console(file=text, force_terminal=terminal)):
        pass

    assert ("planning" in text.getvalue()) is terminal


def test_run_folders_of_the_same_second_get_different_names(tmp_path):
    now = datetime(2030, 1, 2, 3, 4, 5)
    first = new_run_folder(tmp_path, now)
    first.mkdir()

    assert first.name == "2030-01-02_03-04-05"
    assert new_run_folder(tmp_path, now).name == "2030-01-02_03-04-05_2"
