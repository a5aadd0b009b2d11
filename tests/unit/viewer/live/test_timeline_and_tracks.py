"""What the page draws of the last two minutes, of the running tree, and of tracked objects."""

from xml.etree import ElementTree

import numpy as np

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_drawing import svg_of
from mbf_abstract.executives.tree_events import NodeState
from terrain.recording.recorded_objects import COLUMNS, IS_MOVING, NUMBER, RADIUS, VX, X, Z
from terrain.viewer.live.log import MAX_TIMELINE, LiveLog, recent
from terrain.viewer.live.moving import CORNERS, tracked_segments
from terrain.viewer.reports.timeline import PANEL, timeline_svg


def goal(number, begin, end=None, action="move_base"):
    accepted = Event(begin, EventKind.GOAL_ACCEPTED, action, {"goal_id": number})
    ended = {"goal_id": number, "outcome": 0, "message": ""}
    return [accepted] if end is None else [accepted, Event(end, EventKind.GOAL_FINISHED, action, ended)]


def in_order(*goals):
    return sorted((event for one in goals for event in one), key=lambda event: event.time)


def test_the_timeline_keeps_what_is_recent_and_goals_that_still_run():
    events = in_order(goal(1, 0.0, 5.0), goal(2, 1.0), goal(3, 2.0, 130.0), goal(4, 125.0, 126.0))

    kept = recent(events, 120.0)

    assert [(event.data["goal_id"], event.time) for event in kept] == [
        (2, 1.0), (3, 2.0), (4, 125.0), (4, 126.0), (3, 130.0),
    ]  # fmt: skip


def test_bars_begin_and_end_within_the_picture():
    events = tuple(
        in_order(goal(1, 0.0, 15.0), goal(2, 12.0, 14.0, "get_path"), goal(3, 18.0, None, "follow_waypoints"))
    )

    drawn = list(ElementTree.fromstring(timeline_svg(events, 10.0, 20.0, PANEL)).iter())

    bars = [(float(one.attrib["x"]), float(one.attrib["width"])) for one in drawn if one.tag == "rect"]
    left, right = min(x for x, _ in bars), max(x + width for x, width in bars)
    assert right - left == max(width for _, width in bars) * 2.0, "the first five and the last two of ten seconds"
    assert right <= PANEL.width
    assert [one.text for one in drawn if one.tag == "text"][:3] == ["follow_waypoints", "move_base", "get_path"]


def test_without_events_there_is_a_text():
    assert "no goal" in timeline_svg((), 0.0, 5.0, PANEL)


def test_the_log_of_a_long_run_stays_small_and_keeps_the_newest():
    log = LiveLog()
    for number in range(2 * MAX_TIMELINE):
        for event in goal(number, 0.01 * number, 0.01 * number + 0.005):
            log.write(event)

    timeline = log.snapshot().timeline

    assert len(timeline) <= MAX_TIMELINE and timeline[-1].data["goal_id"] == 2 * MAX_TIMELINE - 1


def test_a_tree_is_drawn_with_a_line_to_every_child_and_what_runs_is_filled():
    nodes = [
        NodeState("root <1>", "Sequence", 0, "RUNNING"),
        NodeState("first", "GetPath", 1, "SUCCESS", "146 poses"),
        NodeState("second", "Fallback", 1, "RUNNING"),
        NodeState("leaf", "Leaf", 2, "RUNNING"),
    ]

    drawn = list(ElementTree.fromstring(svg_of(nodes)).iter())

    def named(tag):
        return [one for one in drawn if one.tag.endswith(tag)]

    assert [one.text for one in named("text")] == ["root <1>", "first", "second", "leaf"]
    assert len(named("path")) == 3
    filled = [one.attrib["fill"] == one.attrib["stroke"] for one in named("rect")]
    assert filled == [True, False, True, True]
    rights = [float(one.attrib["x"]) + float(one.attrib["width"]) for one in named("rect")]
    lefts = [float(one.attrib["x"]) for one in named("rect")]
    assert rights[0] < lefts[1] and rights[2] < lefts[3], "children stand to the right of their parents"
    assert [one.text for one in named("title")][1] == "GetPath: 146 poses"
    assert ElementTree.fromstring(svg_of([])) is not None


def test_a_tracked_object_has_a_circle_an_arrow_and_a_trail():
    rows = np.zeros((2, COLUMNS))
    rows[:, NUMBER], rows[:, RADIUS] = (4, 9), (0.3, 0.5)
    rows[:, X : Z + 1] = (1.0, 2.0, 0.0), (5.0, 5.0, 1.0)
    rows[0, VX], rows[0, IS_MOVING] = 0.8, 1.0
    trail = np.array([[0.0, 2.0, 0.1], [0.5, 2.0, 0.1], [1.0, 2.0, 0.1]])

    segments = tracked_segments(rows, [trail, trail[:1]])

    assert segments.shape == (3 + 2 * CORNERS + 2, 2, 3)
    np.testing.assert_allclose(segments[0, 1] - segments[0, 0], [0.8, 0.0, 0.0])
    for index, row in enumerate(rows):
        circle = segments[3 + index * CORNERS : 3 + (index + 1) * CORNERS, 0]
        np.testing.assert_allclose(np.hypot(*(circle - row[X : Z + 1])[:, :2].T), row[RADIUS])
    np.testing.assert_allclose(segments[-1], trail[1:])
    assert len(tracked_segments(rows[:0], [])) == 0
