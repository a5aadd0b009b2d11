"""The words beside a replay: what lies in the page, and that nothing in it can become part of the page."""

import json
import re
from dataclasses import replace
from html import escape

import numpy as np
import pytest

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_events import NodeState
from terrain.physics.incidents import IncidentKind
from terrain.recording.actor_track import ActorTrack
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.colours import BAD, GOOD, WARNING
from terrain.viewer.pictures.incident_marks import OTHER, mark_of
from terrain.viewer.replay.replay_page import replay_html
from terrain.viewer.replay.run_panel import MAX_MARKS, Entry, legend_html, legend_of, panel_html
from terrain.viewer.reports.tree_html import worth_showing

WELL = Verdict(0, "goal reached")
NODES = [{"name": "root", "type": "Sequence", "depth": 0}, {"name": "leaf", "type": "GetPath", "depth": 1}]


def tree(time, **data):
    return Event(time, EventKind.TREE, "tree", {"tree": "root", **data})


def contents(page):
    return json.loads(re.search(r"id='run-data'>(.*?)</script>", page).group(1))


def test_the_page_carries_each_run_of_a_tree_and_its_changes_with_their_times():
    events = [
        tree(1.0, nodes=NODES),
        tree(1.2, tick=1, changes=[[0, "RUNNING", ""], [1, "RUNNING", "pending"]]),
        tree(2.0, tick=9, changes=[[1, "FAILURE", "walled in"]]),
        tree(5.0, nodes=NODES),
    ]

    first, second = contents(panel_html(events))["trees"]

    assert first["nodes"] == [["root", 0], ["leaf", 1]]
    assert first["changes"] == [
        [1.2, 0, "RUNNING", ""],
        [1.2, 1, "RUNNING", "pending"],
        [2.0, 1, "FAILURE", "walled in"],
    ]
    assert (second["time"], second["changes"]) == (5.0, [])


def test_a_result_without_a_message_of_its_own_is_not_said_twice():
    ends = [{"outcome": 0, "message": "SUCCESS"}, {"outcome": 0, "message": "drove"}, {"outcome": 50, "message": ""}]
    events = [Event(1.0, EventKind.GOAL_FINISHED, "refine_path", end) for end in ends]

    lines = [line[1] for line in contents(panel_html(events))["lines"]]

    assert lines == ["refine_path SUCCESS", "refine_path SUCCESS: drove", "refine_path FAILURE"]


def incident(what, time=1.0):
    data = {"what": what, "x": 20.0, "y": 12.0, "z": 1.0, "robot_speed": 1.2, "moved": "robot"}
    return Event(time, EventKind.INCIDENT, "simulator", data)


def test_each_kind_of_incident_has_a_symbol_of_its_own_and_collisions_share_one():
    kinds = [kind.value for kind in IncidentKind]

    symbols = [entry[3] for entry in contents(panel_html(incident(kind) for kind in kinds))["incidents"]]

    of_kind = {
        "collision" if kind.startswith("collision") else kind: symbol
        for kind, symbol in zip(kinds, symbols, strict=True)
    }
    collisions = {symbol for kind, symbol in zip(kinds, symbols, strict=True) if kind.startswith("collision")}
    assert collisions == {of_kind["collision"]}
    assert len(set(of_kind.values())) == len(of_kind) == 6
    assert mark_of("on fire") is OTHER and OTHER.symbol not in of_kind.values()


def test_incidents_are_counted_before_those_that_are_too_many_are_left_out():
    few, many = (panel_html([incident("slipping", float(at)) for at in range(count)]) for count in (3, MAX_MARKS + 50))

    assert "<summary>Incidents (3)</summary>" in few
    assert f"<summary>Incidents ({MAX_MARKS + 50}, the first {MAX_MARKS} are shown)</summary>" in many
    assert len(contents(many)["incidents"]) == MAX_MARKS


def test_the_panel_has_no_tree_where_none_ran():
    page = panel_html([])

    assert "Behaviour tree" not in page
    assert "Behaviour tree" in panel_html([tree(0.0, nodes=NODES)])


@pytest.mark.parametrize(
    ("verdict", "colour"),
    [
        (WELL, GOOD),
        (replace(WELL, failures=("contacts <b>",)), WARNING),
        (replace(WELL, failures=("goal missed",), at_goals=False), BAD),
        (Verdict(110, "<script>blocked"), BAD),
    ],
)
def test_the_verdict_stands_above_everything_in_the_colour_of_its_level(verdict, colour, hill_recording):
    page = replay_html(replace(hill_recording, verdict=verdict))

    assert f'<p id="verdict" style="color:{colour}">{escape(str(verdict))}</p>' in page


def test_words_of_an_event_cannot_end_the_script():
    said = "</script><script>alert(1)</script>"
    page = panel_html([Event(0.0, EventKind.FAULT, "x", {"message": said})])

    assert "alert(1)</script>" not in page
    assert said in contents(page)["lines"][0][1]


def test_idle_nodes_are_shown_below_a_running_one_only():
    def node(name, depth, status):
        return NodeState(name, "T", depth, status)

    nodes = [
        node("root", 0, "RUNNING"),
        node("done", 1, "SUCCESS"),
        node("below done", 2, "INVALID"),
        node("failed below done", 2, "FAILURE"),
        node("waits", 1, "INVALID"),
        node("below what waits", 2, "INVALID"),
        node("works", 1, "RUNNING"),
        node("next", 2, "INVALID"),
    ]

    assert [node.name for node in worth_showing(nodes)] == [
        "root", "done", "failed below done", "waits", "works", "next"
    ]  # fmt: skip


def test_the_legend_shows_each_mark_as_it_is_drawn():
    box, line, dash = (legend_html([Entry("<name>", (1, 2, 3), mark)]) for mark in ("box", "line", "dash"))
    assert "background:rgb(1,2,3)" in box and "<svg>" not in box
    assert 'stroke="rgb(1,2,3)" stroke-width="3"/>' in line
    assert 'stroke="rgb(1,2,3)" stroke-width="6" stroke-dasharray="8 4"/>' in dash
    assert all("<span>&lt;name&gt;</span>" in shown for shown in (box, line, dash))


def test_the_legend_names_what_occurs_in_the_run_and_nothing_else(hill_recording, office_recording):
    nobody = np.zeros((0, 3))
    people = [ActorTrack("person", nobody, nobody.astype(np.int32), np.zeros((0, 7)))] * 2

    hill = [entry.name for entry in legend_of(hill_recording)]
    office = [entry.name for entry in legend_of(replace(office_recording, actors=people))]

    assert hill == ["plan", "driven track", "slope 0°", "slope 10°", "slope 20°", "slope 30°", "slope 45°"]
    assert office == ["plan", "driven track", "seen by a sensor", "on no map", "person"]
    page = panel_html([], legend_of(hill_recording))
    assert "rgb(25,90,220)" in page and ">plan<" in page
