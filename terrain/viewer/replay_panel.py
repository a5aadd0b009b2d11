"""The text panel of a replay: verdict, events along the time bar, state of the behaviour tree, legend of colours.

The page of a replay is made by viser and shows the scene only. The panel is HTML and a few lines of script that read
the time from the time bar, and set it where an incident is clicked. Its data is in the page as JSON, so it works from
disk and without network.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_events import SYMBOLS
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.colours import ACTORS, DRIVEN, LEVELS, OBSTACLE, PLANNED, SCAN, Colour, slope_legend
from terrain.viewer.pictures.shading import FLAT_GROUND
from terrain.viewer.reports.event_lines import is_shown, line_of
from terrain.viewer.reports.tree_html import COLOURS, INDENT

Entry = tuple[str, Colour]

SHOWN_LINES = 8
MAX_LINES = 2000  # a run with more leaves out the oldest
MAX_MARKS = 200  # incidents on the time bar; a run with more leaves out the newest
LEAD = 1.0  # s before an incident, where a jump to it ends

ENTRY_STYLE = "display:inline-flex;align-items:center;gap:4px;margin-right:10px"
BOX = "width:10px;height:10px;border-radius:2px;background:rgb({},{},{})"

STYLE = """
#run { position: fixed; left: 10px; top: 10px; width: 300px; max-height: calc(100vh - 90px); overflow: auto;
  font: 12px/1.4 system-ui, sans-serif; background: rgba(255, 255, 255, 0.88); color: #444; padding: 6px 12px;
  border-radius: 6px; box-shadow: 0 1px 6px rgba(0, 0, 0, 0.2); z-index: 10; }
#run p { font-weight: 600; margin: 4px 0; }
#run-incidents button { display: block; width: 100%; text-align: left; background: none; border: 0; padding: 1px 0;
  font: inherit; cursor: pointer; }
#run-marks button { position: fixed; width: 8px; height: 12px; padding: 0; border: 1px solid white; border-radius: 2px;
  cursor: pointer; z-index: 10; }
#run summary { font-weight: 600; cursor: pointer; color: #222; margin: 4px 0; }
"""

SCRIPT = """
const run = JSON.parse(document.getElementById('run-data').textContent);
const add = (parent, text, style) => {
  const line = document.createElement('div');
  line.textContent = text; line.style.cssText = style; parent.append(line);
};
function showTree(time) {
  const begun = run.trees.filter(tree => tree.time <= time), tree = begun[begun.length - 1];
  const place = document.getElementById('run-tree');
  place.replaceChildren();
  if (!tree) return;
  const now = tree.nodes.map(() => ['INVALID', '']);
  for (const [at, index, status, message] of tree.changes) { if (at > time) break; now[index] = [status, message]; }
  const branch = [];
  tree.nodes.forEach(([name, depth], index) => {
    const [status, message] = now[index];
    branch[depth] = status;
    if (status === 'INVALID' && depth > 0 && branch[depth - 1] !== 'RUNNING') return;
    const failed = status === 'FAILURE' && message ? '  ' + message : '';
    add(place, run.symbols[status] + ' ' + name + failed, 'padding-left:' + depth * run.indent + 'px;color:' +
      run.colours[status] + (status === 'RUNNING' ? ';font-weight:600' : ''));
  });
}
function jump(time) {
  const bar = document.querySelector('input');
  Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(bar, Math.max(0, time - run.lead));
  bar.dispatchEvent(new Event('input', {bubbles: true}));
}
function markBar() {
  const thumb = document.querySelector('[role=slider]'), place = document.getElementById('run-marks');
  if (!thumb) return;
  const box = thumb.parentElement.getBoundingClientRect(), end = Number(thumb.getAttribute('aria-valuemax'));
  [...place.children].forEach((mark, index) => {
    mark.style.left = box.left + box.width * run.incidents[index][0] / end - 4 + 'px';
    mark.style.top = box.top - 9 + 'px';
  });
}
function addJumps() {
  run.incidents.forEach(([at, text, colour]) => {
    for (const [place, label] of [['run-marks', ''], ['run-incidents', at.toFixed(1) + ' s  ' + text]]) {
      const button = document.createElement('button');
      button.textContent = label; button.title = at.toFixed(1) + ' s  ' + text;
      button.style[label ? 'color' : 'background'] = colour;
      button.addEventListener('click', () => { jump(at); button.blur(); });
      document.getElementById(place).append(button);
    }
  });
}
addJumps();
function showLines(time) {
  const place = document.getElementById('run-lines');
  place.replaceChildren();
  const past = run.lines.filter(line => line[0] <= time);
  past.slice(-run.shown).reverse().forEach(([at, text, colour]) => add(place, at.toFixed(1) + ' s  ' + text,
    'color:' + colour));
}
let shown = null;
setInterval(() => {
  markBar();
  const bar = document.querySelector('input'), time = bar ? Number(bar.value) : 0;
  if (time === shown) return;
  shown = time; showLines(time);
  if (run.trees.length) showTree(time);
}, 100);
"""


def with_panel(page: str, verdict: Verdict, events: Iterable[Event], legend: Iterable[Entry] = ()) -> str:
    """Put the panel into the text of a page, before the end of its body."""
    contents = _data(tuple(events))
    data = json.dumps(contents, separators=(",", ":")).replace("<", "\\u003c")
    tree = "<details open><summary>Behaviour tree</summary><div id='run-tree'></div></details>"
    tree = tree if contents["trees"] else ""
    shown = f"<details open><summary>Incidents ({len(contents['incidents'])})</summary><div id='run-incidents'></div>"
    incidents = f"{shown}</details>" if contents["incidents"] else "<div id='run-incidents'></div>"
    panel = (
        f"<style>{STYLE}</style><div id='run'>"
        f"<p style='color:{LEVELS[verdict.level]}'>{escape(str(verdict))}</p>"
        "<details open><summary>What happened</summary>"
        f"<div id='run-lines'></div></details>{tree}"
        f"{incidents}<details open><summary>Colours</summary><div>{legend_html(legend)}</div></details></div>"
        "<div id='run-marks'></div>"
        f"<script type='application/json' id='run-data'>{data}</script><script>{SCRIPT}</script>"
    )
    head, end, tail = page.rpartition("</body>")
    return head + panel + end + tail if end else page + panel


def _data(events: tuple[Event, ...]) -> dict[str, Any]:
    """What the script goes through: the runs of trees with their changes, and the lines, all by time [s]."""
    lines = [line_of(event) for event in events if is_shown(event)]
    incidents = [line_of(event) for event in events if event.kind is EventKind.INCIDENT]
    trees: list[dict[str, Any]] = []
    for event in events:
        if event.kind is EventKind.TREE:
            _take_tree_event(trees, event.time, dict(event.data))
    return {
        "trees": trees,
        "incidents": [[line.time, line.text, line.colour] for line in incidents[:MAX_MARKS]],
        "lead": LEAD,
        "lines": [[line.time, f"{line.source} {line.text}", line.colour] for line in lines[-MAX_LINES:]],
        "symbols": SYMBOLS,
        "colours": COLOURS,
        "indent": INDENT,
        "shown": SHOWN_LINES,
    }


def _take_tree_event(trees: list[dict[str, Any]], time: float, data: dict[str, Any]) -> None:
    if "nodes" in data:
        nodes = [[node["name"], node["depth"]] for node in data["nodes"]]
        trees.append({"time": time, "nodes": nodes, "changes": []})
    elif trees:
        trees[-1]["changes"] += [[time, *change] for change in data["changes"]]


def legend_of(recording: Recording) -> list[Entry]:
    """Names and colours of lines, points and things, then of slopes where the ground is not flat."""
    entries = [("plan", PLANNED), ("driven", DRIVEN)]
    if recording.scans:
        entries.append(("seen by a sensor", SCAN))
    if recording.obstacles is not None:
        entries.append(("on no map", OBSTACLE))
    entries += [(thing, ACTORS[thing]) for thing in sorted({track.thing for track in recording.actors})]
    ground = recording.ground
    if ground is not None and np.ptp(ground.vertices[:, 2]) >= FLAT_GROUND:
        entries += [(f"slope {angle}", colour) for angle, colour in slope_legend()]
    return entries


def legend_html(entries: Iterable[Entry]) -> str:
    """Return a line of small boxes, each with its name."""
    items = (
        f'<span style="{ENTRY_STYLE}"><span style="{BOX.format(*colour)}"></span><span>{name}</span></span>'
        for name, colour in entries
    )
    return "".join(items)
