"""Events read as sentences in reports, replays and the live view."""

import pytest

from mbf_abstract.events import Event, EventKind
from terrain.viewer.reports.event_lines import line_of


@pytest.mark.parametrize(
    ("kind", "data", "text"),
    [
        (EventKind.ROBOT_STOPPED, {"reason": "no command", "holder": ""}, "robot stopped: no command"),
        (EventKind.GATE_CLOSED, {"reason": "closed", "holder": "4"}, "gate closed: closed (holder: 4)"),
        (EventKind.RECOVERY, {"goal_id": "4", "plugin": "clear", "slot": 255}, "recovery: clear"),
        (EventKind.STUCK, {"place": [1.0, 2.0], "message": "stuck at (1.00, 2.00)"}, "stuck at (1.00, 2.00)"),
        (EventKind.FAULT, {"message": "left out", "traceback": "File ..."}, "fault: left out"),
        (EventKind.CUSTOM, {"what": "new goal", "x": 1.5}, "what: new goal, x: 1.5"),
        (EventKind.GOAL_PAUSED, {"goal_id": "7"}, "goal paused"),
    ],
)
def test_the_sentence_of_an_event_stands_before_the_rest_of_its_data(kind, data, text):
    assert line_of(Event(3.0, kind, "source", data)).text == text
