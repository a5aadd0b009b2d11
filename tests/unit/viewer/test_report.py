"""The report says what happened, in one file that needs nothing else."""

import base64
import io
import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from PIL import Image

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Pose
from terrain.physics.robot_models import HUSKY
from terrain.recording.metrics import measure
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.run_picture import picture_png
from terrain.viewer.reports.page import MAX_ROWS, cell
from terrain.viewer.reports.report import report_html
from terrain.viewer.reports.timeline import Bar, action_bars, plugin_bars, timeline_svg


def report_of(recording):
    return report_html(recording, measure(recording).to_json())


def test_the_report_reports_outcome_metrics_and_stops(office_recording):
    page = report_of(office_recording)

    for words in ("BLOCKED_PATH: a box stands on the path", "max tilt [°]", "no command for 0.5 s", "turtlebot"):
        assert words in page


def test_the_report_is_one_file_without_script_and_links(hill_recording):
    page = report_html(hill_recording, measure(hill_recording).to_json())
    assert "<script" not in page
    assert re.findall(r'(?:src|href)="(?!data:|#)', page) == []
    assert page.count("<svg") == 2
    assert len(page) < 3e6


def test_the_same_run_has_the_same_report_every_time(hill_recording):
    assert report_of(hill_recording) == report_of(hill_recording)


def test_texts_of_a_run_cannot_break_the_page(hill_recording):
    evil = replace(hill_recording, verdict=Verdict(0, "<script>alert(1)</script>"), scenario="<b>")

    assert "<script" not in report_of(evil)


def test_long_lists_are_cut_and_say_so(hill_recording):
    stops = tuple(
        Event(float(k), EventKind.ROBOT_STOPPED, "velocity_gate", {"reason": "x"}) for k in range(MAX_ROWS + 7)
    )

    assert "and 7 more" in report_of(replace(hill_recording, events=stops))


def test_a_run_that_never_began_has_a_report_too():
    run = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))

    assert "FAILURE: no robot" in report_of(run)


def test_every_accepted_goal_is_one_bar_with_its_outcome(office_recording):
    assert action_bars(office_recording.events) == [
        Bar("move_base", 0.0, 15.4, 110),
        Bar("get_path", 0.0, 0.4, 0),
        Bar("exe_path", 0.4, 15.4, 110),
    ]


def test_plugins_have_a_bar_for_each_call_and_one_for_a_whole_control_loop(office_recording):
    hung = Event(9.0, EventKind.PLUGIN_CALL_STARTED, "theta", {"goal_id": 9, "method": "make_plan"})

    assert plugin_bars((*office_recording.events, hung)) == [
        Bar("dijkstra", 0.0, 0.4, 0, "make_plan"),
        Bar("follower", 0.4, 15.4, None, "500 cycles, 12 without a valid command"),
        Bar("theta", 9.0, None, None, "make_plan, no answer"),
    ]


@pytest.mark.parametrize("finished", [True, False])
def test_the_timeline_is_sound_svg_for_open_goals_too(office_recording, finished):
    kinds = () if finished else (EventKind.GOAL_FINISHED,)
    events = tuple(event for event in office_recording.events if event.kind not in kinds)

    nodes = list(ElementTree.fromstring(timeline_svg(events)).iter())
    titles = [node.text for node in nodes if node.tag == "title"]

    assert len([node for node in nodes if node.tag == "rect"]) == 5
    assert "move_base: BLOCKED_PATH, 0.00 s to 15.40 s" in titles or not finished
    assert "3.00 s: velocity_gate: robot_stopped: no command for 0.5 s" in titles


def test_the_pictures_of_a_report_are_smaller_than_the_picture_alone(hill_recording):
    drawn = picture_png(hill_recording)
    shown = [base64.b64decode(data) for data in re.findall(r"base64,([^\"]+)", report_of(hill_recording))]
    assert [Image.open(io.BytesIO(data)).size for data in shown] == [Image.open(io.BytesIO(drawn)).size]
    assert sum(map(len, shown)) < 0.5 * len(drawn)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.123456, "0.1235"),
        ([0.15, 17.188733853], "0.15, 17.19"),
        ([{"angle_deg": 3.9055440, "distance_m": 0.128872}, {"angle_deg": 1.0}],
         "angle 3.906 °, distance 0.1289 m; angle 1 °"),
        ([], "none"),
        (True, "yes"),
        (None, "-"),
        (20557.015, "20557"),
        ((0.5, True), "0.5, yes"),
    ],
)  # fmt: skip
def test_a_value_in_a_table_is_short_also_within_lists_and_names(value, text):
    assert cell(value) == text
