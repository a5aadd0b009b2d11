"""The status texts of the page as HTML: state of every action, results of goals, events."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from mbf_abstract.outcomes import outcome_text
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from terrain.session.goal_sequence import GoalSequence
from terrain.viewer.live.log import Snapshot
from terrain.viewer.pictures.colours import BAD, GOOD, NEITHER
from terrain.viewer.reports.event_lines import Line

BUSY = "#1f6feb"
SHOWN_LINES = 12
SMALL = "font-size:0.8em;line-height:1.35;padding:0 0.8em"


def actions_html(server: AbstractNavigationServer, snapshot: Snapshot) -> str:
    """One row for each action: the state of its running goals, else how its last goal has ended."""
    rows = []
    for action in server.actions:
        running = action.unfinished
        end = snapshot.ends.get(action.name)
        if running:
            state = _coloured(", ".join(goal.status.value for goal in running), BUSY)
        elif end is not None:
            state = _coloured(end.text, end.colour)
        else:
            state = _coloured("no goal yet", NEITHER)
        rows.append(f'<tr><td style="padding-right:0.8em;vertical-align:top">{action.name}</td><td>{state}</td></tr>')
    return f'<table style="{SMALL}">{"".join(rows)}</table>'


def headline_html(time: float, sequence: GoalSequence) -> str:
    """Simulated time [s], and the goal the robot goes to, or how the last one has ended."""
    if sequence.target is not None:
        x, y, z = sequence.target.position
        text = _coloured(f"going to {x:.1f}, {y:.1f}, {z:.1f} m", BUSY)
    elif sequence.last_result is not None:
        result = sequence.last_result
        text = _coloured(outcome_text(result.outcome, result.message), GOOD if result.success else BAD)
    else:
        text = _coloured("not started yet", NEITHER)
    return f'<div style="{SMALL};font-weight:600">{time:.0f} s · {text}</div>'


def lines_html(lines: Sequence[Line]) -> str:
    """What has happened, newest first."""
    rows = "".join(
        f'<div style="color:{line.colour}">{line.time:.1f} s <b>{escape(line.source)}</b> {escape(line.text)}</div>'
        for line in lines[:SHOWN_LINES]
    )
    return f'<div style="{SMALL}">{rows}</div>'


def _coloured(text: str, colour: str) -> str:
    return f'<span style="color:{colour}">{escape(text)}</span>'
