"""The text beside a replay: what happened, incidents to jump to, the behaviour tree, the meaning of lines and colours.

Its data is in the page as JSON; ``page/panel.js`` shows of it what has happened until the time of the time bar.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from html import escape
from typing import Any, NamedTuple

import numpy as np

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_drawing import STATUS_COLOURS
from mbf_abstract.executives.tree_events import SYMBOLS
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import ACTORS, DRIVEN, OBSTACLE, PLANNED, SCAN, TRACKED, Colour, slope_legend
from terrain.viewer.pictures.incident_marks import mark_of
from terrain.viewer.pictures.shading import FLAT_GROUND
from terrain.viewer.reports.event_lines import is_shown, line_of
from terrain.viewer.reports.tree_html import INDENT

SHOWN_LINES = 8
MAX_LINES = 2000  # a run with more leaves out the oldest
MAX_MARKS = 200  # incidents on the time bar; a run with more leaves out the newest
LEAD = 1.0  # s before an incident, where a jump to it ends


class Entry(NamedTuple):
    """A line of the legend; its ``mark`` is a ``box``, a solid ``line`` or a wide ``dash``."""

    name: str
    colour: Colour
    mark: str = "box"


def panel_html(events: Iterable[Event], legend: Iterable[Entry] = (), begin: float = 0.0) -> str:
    """Return the panel; times in it count from ``begin`` [s]."""
    timed = tuple(replace(event, time=event.time - begin) for event in events)
    contents, incidents = _data(timed), sum(event.kind is EventKind.INCIDENT for event in timed)
    count = str(incidents) if incidents <= MAX_MARKS else f"{incidents}, the first {MAX_MARKS} are shown"
    tree = "<details open><summary>Behaviour tree</summary><div id='run-tree'></div></details>"
    shown = f"<details open><summary>Incidents ({count})</summary><div id='run-incidents'></div>"
    return (
        "<details open><summary>What happened</summary><div id='run-lines'></div></details>"
        f"{tree if contents['trees'] else ''}"
        f"{f'{shown}</details>' if contents['incidents'] else ''}"
        f"<details open><summary>Lines and colours</summary><div>{legend_html(legend)}</div></details>"
        f"<script type='application/json' id='run-data'>{json_text(contents)}</script>"
    )


def json_text(contents: Any) -> str:
    """JSON that cannot end the element of a page that it is in; half of a surrogate pair is spelled out."""
    return json.dumps(contents, separators=(",", ":")).replace("<", "\\u003c")


def _data(events: tuple[Event, ...]) -> dict[str, Any]:
    """What the script goes through: the runs of trees with their changes, and the lines, all by time [s]."""
    lines = [line_of(event) for event in events if is_shown(event)]
    incidents = [_incident(event) for event in events if event.kind is EventKind.INCIDENT]
    trees: list[dict[str, Any]] = []
    for event in events:
        if event.kind is EventKind.TREE:
            _take_tree_event(trees, event.time, dict(event.data))
    return {
        "trees": trees,
        "incidents": incidents[:MAX_MARKS],
        "lead": LEAD,
        "lines": [[line.time, f"{line.source} {line.text}", line.colour] for line in lines[-MAX_LINES:]],
        "symbols": SYMBOLS,
        "colours": STATUS_COLOURS,
        "indent": INDENT,
        "shown": SHOWN_LINES,
    }


def _incident(event: Event) -> tuple[float, str, str, str]:
    """Time [s], text, colour and the symbol on the time bar, which needs no colour to be read."""
    line = line_of(event)
    return line.time, line.text, line.colour, mark_of(str(event.data["what"])).symbol


def _take_tree_event(trees: list[dict[str, Any]], time: float, data: dict[str, Any]) -> None:
    if "nodes" in data:
        nodes = [[node["name"], node["depth"]] for node in data["nodes"]]
        trees.append({"time": time, "nodes": nodes, "changes": []})
    elif trees:
        trees[-1]["changes"] += [[time, *change] for change in data["changes"]]


def legend_of(recording: Recording, robots: Sequence[tuple[str, Colour]] = ()) -> list[Entry]:
    """Names and looks of lines, points and things, then of slopes where the ground is not flat.

    ``robots`` are the names and colours of several ones, whose tracks differ.
    """
    if robots:
        entries = [Entry(f"{name}: plan", colour, "dash") for name, colour in robots]
        entries += [Entry(f"{name}: driven track", colour, "line") for name, colour in robots]
    else:
        entries = [Entry("plan", PLANNED, "dash"), Entry("driven track", DRIVEN, "line")]
    if recording.scans:
        entries.append(Entry("seen by a sensor", SCAN))
    if recording.objects:
        entries.append(Entry("velocity that the robot knows", TRACKED, "line"))
    if recording.obstacles is not None:
        entries.append(Entry("on no map", OBSTACLE))
    entries += [Entry(thing, ACTORS[thing]) for thing in sorted({track.thing for track in recording.actors})]
    ground = recording.ground
    if ground is not None and np.ptp(ground.vertices[:, 2]) >= FLAT_GROUND:
        entries += [Entry(f"slope {angle}", colour) for angle, colour in slope_legend()]
    return entries


def legend_html(entries: Iterable[Entry]) -> str:
    """Return the entries, each with a sample of what it names."""
    return "".join(f'<span class="entry">{_sample(entry)}<span>{escape(entry.name)}</span></span>' for entry in entries)


def _sample(entry: Entry) -> str:
    colour = "rgb({},{},{})".format(*entry.colour)
    if entry.mark == "box":
        return f'<span class="box" style="background:{colour}"></span>'
    width, dashes = (6, ' stroke-dasharray="8 4"') if entry.mark == "dash" else (3, "")
    return f'<svg><path d="M0 5H22" stroke="{colour}" stroke-width="{width}"{dashes}/></svg>'
