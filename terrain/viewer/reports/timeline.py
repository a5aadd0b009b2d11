"""A timeline as SVG: a row for each action and plugin with a bar for each goal and call, and a row of stops and faults.

A goal's bar reaches from its acceptance to its end, a planner's from call to answer; a controller is called too often
for that, so its bar is the whole control loop, with the number of its cycles. Colours show outcomes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.viewer.reports.event_lines import NOTABLE, colour_of, event_text

ACTIONS = ("follow_waypoints", "move_base", "get_path", "exe_path", "recovery", "refine_path")
MARKS_ROW = "incidents, stops"
GOOD, BAD, NEITHER = "#2da44e", "#cf222e", "#9aa4b2"


class Size(NamedTuple):
    """Sizes in pixels of a timeline: its width, a row, a bar, a letter of the labels; and how many ticks it has."""

    width: int
    row: int
    bar: int
    letter: float
    ticks: int


PAGE = Size(900, 30, 18, 7.5, 10)
PANEL = Size(290, 17, 10, 5.2, 4)


@dataclass(frozen=True)
class Bar:
    """One goal's or call's life in its row; times [s], the end is None for what was never finished."""

    row: str
    begin: float
    end: float | None
    outcome: int | None
    note: str = ""


def action_bars(events: tuple[Event, ...]) -> list[Bar]:
    """Pair each acceptance of a goal with its end."""
    ends = {event.data.get("goal_id"): event for event in events if event.kind is EventKind.GOAL_FINISHED}
    bars = []
    for event in events:
        if event.kind is EventKind.GOAL_ACCEPTED and event.source in ACTIONS:
            end = ends.get(event.data.get("goal_id"))
            bars.append(Bar(event.source, event.time, end.time if end is not None else None, _outcome(end)))
    return bars


def plugin_bars(events: tuple[Event, ...]) -> list[Bar]:
    """Pair the beginning of each plugin call with its end; a control loop is one bar."""
    open_calls: dict[tuple[object, ...], float] = {}
    bars = []
    for event in events:
        call = (event.source, event.data.get("goal_id"), event.data.get("method"))
        if event.kind is EventKind.PLUGIN_CALL_STARTED:
            open_calls[call] = event.time
        elif event.kind is EventKind.PLUGIN_CALL_ENDED and call in open_calls:
            bars.append(Bar(event.source, open_calls.pop(call), event.time, _outcome(event), str(call[2])))
        elif event.kind is EventKind.CONTROL_LOOP:
            note = f"{event.data['cycles']} cycles, {event.data['failed']} without a valid command"
            bars.append(Bar(event.source, float(str(event.data["began"])), event.time, None, note))
    bars += [Bar(str(call[0]), begin, None, None, f"{call[2]}, no answer") for call, begin in open_calls.items()]
    return bars


def timeline_svg(events: tuple[Event, ...], begin: float = 0.0, end: float | None = None, size: Size = PAGE) -> str:
    """Draw all rows from ``begin`` to ``end`` [s], by default to the last event; a short text without any goal."""
    end = max(event.time for event in events) if end is None and events else end or 0.0
    goals = [bar for bar in action_bars(events) if bar.end is None or bar.end >= begin]
    if not goals:
        return "<p>no goal was accepted</p>"
    bars = [*goals, *plugin_bars(events)]
    marks = [event for event in events if event.kind in NOTABLE and event.time >= begin]
    rows = [action for action in ACTIONS if any(bar.row == action for bar in bars)]
    rows += sorted({bar.row for bar in bars} - set(rows)) + ([MARKS_ROW] if marks else [])
    frame = _Frame(rows, begin, max(end, begin + 1e-3), size)
    parts = [*frame.labels(), *map(frame.bar, bars), *map(frame.mark, marks), *frame.ticks()]
    return f'<svg viewBox="0 0 {size.width} {frame.height}" width="{size.width}" role="img">{"".join(parts)}</svg>'


class _Frame:
    """Where rows and times are in the picture."""

    def __init__(self, rows: list[str], first: float, last: float, size: Size) -> None:
        self._rows, self._first, self._last, self._size = rows, first, last, size
        self._left = size.letter * max(map(len, rows)) + 10
        self._scale = (size.width - self._left - 20) / (last - first)
        self._bottom = size.row * len(rows)
        self.height = self._bottom + 24

    def labels(self) -> Iterator[str]:
        for index, row in enumerate(self._rows):
            middle = self._size.row * (index + 0.5) + 4
            yield f'<text x="0" y="{middle:g}" font-size="{round(1.74 * self._size.letter)}">{escape(row)}</text>'

    def bar(self, bar: Bar) -> str:
        begin, end = max(bar.begin, self._first), self._last if bar.end is None else bar.end
        outcome = "" if bar.outcome is None else outcome_name(bar.outcome)
        note = bar.note or ("not finished" if bar.end is None else "")
        title = escape(": ".join(part for part in (bar.row, outcome, note) if part))
        x, y = self._x(begin), self._y(bar.row) + (self._size.row - self._size.bar) // 2
        return (
            f'<rect x="{x:.1f}" y="{y}" width="{max(2.0, (end - begin) * self._scale):.1f}" '
            f'height="{self._size.bar}" rx="2" '
            f'fill="{_colour(bar.outcome)}" fill-opacity="0.75">'
            f"<title>{title}, {bar.begin:.2f} s to {end:.2f} s</title></rect>"
        )

    def mark(self, event: Event) -> str:
        """A diamond: red for a fault and what fails a run, amber for other incidents, else grey."""
        x, y = self._x(event.time), self._y(MARKS_ROW) + self._size.row // 2
        title = escape(f"{event.time:.2f} s: {event.source}: {event.kind.value}: {event_text(event)}")
        return f'<path d="M{x:.1f} {y - 7}l6 7l-6 7l-6 -7z" fill="{colour_of(event)}"><title>{title}</title></path>'

    def ticks(self) -> Iterator[str]:
        step = _round_step((self._last - self._first) / self._size.ticks)
        for index in range(math.ceil(self._first / step), int(self._last / step) + 1):
            x = self._x(step * index)
            yield f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{self._bottom}" stroke="#ddd"/>'
            yield (
                f'<text x="{x:.1f}" y="{self._bottom + 16}" font-size="11" text-anchor="middle" '
                f'fill="#555">{step * index:g} s</text>'
            )

    def _x(self, time: float) -> float:
        return self._left + (time - self._first) * self._scale

    def _y(self, row: str) -> int:
        return self._size.row * self._rows.index(row)


def _round_step(least: float) -> float:
    """The smallest of 1, 2, 5, 10, 20 ... (or 0.5, 0.2 ...) that is not below ``least``."""
    power = float(10.0 ** math.floor(math.log10(least)))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= least)


def _outcome(event: Event | None) -> int | None:
    code = event.data.get("outcome") if event is not None else None
    return code if isinstance(code, int) else None


def _colour(outcome: int | None) -> str:
    """Green and red for success and failure; a goal that was canceled or replaced is neither."""
    if outcome is None or outcome_name(outcome) == "CANCELED":
        return NEITHER
    return GOOD if is_success(outcome) else BAD
