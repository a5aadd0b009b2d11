"""A timeline as SVG: a row for each action and plugin with a bar for each goal and call, and a row of stops and faults.

A goal's bar reaches from its acceptance to its end, a planner's from call to answer; a controller is called too often
for that, so its bar is the whole control loop, with the number of its cycles. Colours show outcomes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.viewer.reports.event_lines import NOTABLE, colour_of, event_text

ACTIONS = ("move_base", "get_path", "exe_path", "recovery", "refine_path")
MARKS_ROW = "incidents, stops"
WIDTH, ROW, BAR = 900, 30, 18
LETTER = 7.5  # pixels; labels are wide enough for the longest name
GOOD, BAD, NEITHER = "#2da44e", "#cf222e", "#9aa4b2"
MAX_TICKS = 10


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


def timeline_svg(events: tuple[Event, ...]) -> str:
    """Draw all rows; a short text where no goal was accepted."""
    goals = action_bars(events)
    if not goals:
        return "<p>no goal was accepted</p>"
    bars = [*goals, *plugin_bars(events)]
    marks = [event for event in events if event.kind in NOTABLE]
    rows = [action for action in ACTIONS if any(bar.row == action for bar in bars)]
    rows += sorted({bar.row for bar in bars} - set(rows)) + ([MARKS_ROW] if marks else [])
    frame = _Frame(rows, max(max(event.time for event in events), 1e-3))
    parts = [*frame.labels(), *map(frame.bar, bars), *map(frame.mark, marks), *frame.ticks()]
    return f'<svg viewBox="0 0 {WIDTH} {frame.height}" width="{WIDTH}" role="img">{"".join(parts)}</svg>'


class _Frame:
    """Where rows and times are in the picture."""

    def __init__(self, rows: list[str], last: float) -> None:
        self._rows, self._last = rows, last
        self._left = LETTER * max(map(len, rows)) + 10
        self._scale = (WIDTH - self._left - 20) / last
        self._bottom = ROW * len(rows)
        self.height = self._bottom + 24

    def labels(self) -> Iterator[str]:
        for index, row in enumerate(self._rows):
            yield f'<text x="0" y="{ROW * index + 19}" font-size="13">{escape(row)}</text>'

    def bar(self, bar: Bar) -> str:
        end = self._last if bar.end is None else bar.end
        outcome = "" if bar.outcome is None else outcome_name(bar.outcome)
        note = bar.note or ("not finished" if bar.end is None else "")
        title = escape(": ".join(part for part in (bar.row, outcome, note) if part))
        x, y = self._x(bar.begin), self._y(bar.row) + (ROW - BAR) // 2
        return (
            f'<rect x="{x:.1f}" y="{y}" width="{max(2.0, (end - bar.begin) * self._scale):.1f}" height="{BAR}" rx="2" '
            f'fill="{_colour(bar.outcome)}" fill-opacity="0.75">'
            f"<title>{title}, {bar.begin:.2f} s to {end:.2f} s</title></rect>"
        )

    def mark(self, event: Event) -> str:
        """A diamond: red for a fault and what fails a run, amber for other incidents, else grey."""
        x, y = self._x(event.time), self._y(MARKS_ROW) + ROW // 2
        title = escape(f"{event.time:.2f} s: {event.source}: {event.kind.value}: {event_text(event)}")
        return f'<path d="M{x:.1f} {y - 7}l6 7l-6 7l-6 -7z" fill="{colour_of(event)}"><title>{title}</title></path>'

    def ticks(self) -> Iterator[str]:
        step = _round_step(self._last / MAX_TICKS)
        for index in range(int(self._last / step) + 1):
            x = self._x(step * index)
            yield f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{self._bottom}" stroke="#ddd"/>'
            yield (
                f'<text x="{x:.1f}" y="{self._bottom + 16}" font-size="11" text-anchor="middle" '
                f'fill="#555">{step * index:g} s</text>'
            )

    def _x(self, time: float) -> float:
        return self._left + time * self._scale

    def _y(self, row: str) -> int:
        return ROW * self._rows.index(row)


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
