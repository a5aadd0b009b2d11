"""The live line: what it says, and that it keeps quiet where nobody looks."""

import io
import math
from datetime import datetime

from rich.console import Console

from terrain.cli import new_run_folder
from terrain.live_line import LiveLine, progress_text
from terrain.runner import Progress

DRIVING = Progress(time=12.0, wall_time=3.0, distance_left=34.56, speed=0.8, tilt=math.radians(7.0), state="active")


def test_the_line_tells_time_factor_state_distance_speed_and_tilt():
    text = progress_text(DRIVING)

    for part in ("12.0 s", "4.0 x", "active", "34.6 m left", "0.80 m/s", "7.0°"):
        assert part in text


def test_an_unknown_distance_is_shown_as_dashes():
    waiting = Progress(time=0.0, wall_time=0.0, distance_left=math.nan, speed=0.0, tilt=0.0, state="starting")

    assert "nan" not in progress_text(waiting)


def test_without_a_terminal_only_the_steps_are_told():
    text = io.StringIO()
    with LiveLine(console=Console(file=text, force_terminal=False)) as live:
        live.step("building the world")
        live.progress(DRIVING)

    assert text.getvalue() == "building the world\n"


def test_a_quiet_run_prints_nothing():
    text = io.StringIO()
    with LiveLine(show=False, console=Console(file=text, force_terminal=True)) as live:
        live.step("building the world")
        live.progress(DRIVING)

    assert text.getvalue() == ""


def test_on_a_terminal_the_line_is_shown():
    text = io.StringIO()
    with LiveLine(console=Console(file=text, force_terminal=True, width=120)) as live:
        live.progress(DRIVING)

    assert "34.6 m left" in text.getvalue()


def test_run_folders_of_the_same_second_get_different_names(tmp_path):
    now = datetime(2030, 1, 2, 3, 4, 5)
    first = new_run_folder(tmp_path, now)
    first.mkdir()

    assert first.name == "2030-01-02_03-04-05"
    assert new_run_folder(tmp_path, now).name == "2030-01-02_03-04-05_2"
