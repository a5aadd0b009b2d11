"""A timeline of actions as SVG: one row an action, one bar a goal from acceptance to end, coloured by its outcome."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import is_success, outcome_name

ACTIONS = ("move_base", "get_path", "exe_path", "recovery", "refine_path")
LEFT, WIDTH, ROW, BAR = 90, 900, 30, 18
GOOD, BAD, NEITHER = "#2da44e", "#cf222e", "#9aa4b2"
TICKS = 8


@dataclass(frozen=True)
class Bar:
    """One goal's life; times [s], the end is None for a goal that was never finished."""

    action: str
    begin: float
    end: float | None
    outcome: int | None


def bars_of(events: tuple[Event, ...]) -> list[Bar]:
    """Pair each acceptance of a goal with its end."""
    ends = {event.data.get("goal_id"): event for event in events if event.kind is EventKind.GOAL_FINISHED}
    bars = []
    for event in events:
        if event.kind is EventKind.GOAL_ACCEPTED and event.source in ACTIONS:
            end = ends.get(event.data.get("goal_id"))
            code = end.data.get("outcome") if end is not None else None
            outcome = code if isinstance(code, int) else None
            bars.append(Bar(event.source, event.time, end.time if end is not None else None, outcome))
    return bars


def timeline_svg(events: tuple[Event, ...]) -> str:
    """Draw the goals of all actions; a short text where there were none."""
    bars = bars_of(events)
    if not bars:
        return "<p>no goal was accepted</p>"
    last = max(max(event.time for event in events), 1e-3)
    rows = [action for action in ACTIONS if any(bar.action == action for bar in bars)]
    scale = (WIDTH - LEFT - 10) / last
    parts = [f'<text x="0" y="{ROW * k + 19}" font-size="13">{action}</text>' for k, action in enumerate(rows)]
    parts += [_bar(bar, rows.index(bar.action), scale, last) for bar in bars]
    parts += [_tick(last * k / TICKS, scale, ROW * len(rows)) for k in range(TICKS + 1)]
    height = ROW * len(rows) + 24
    return f'<svg viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" role="img">{"".join(parts)}</svg>'


def _bar(bar: Bar, row: int, scale: float, last: float) -> str:
    end = last if bar.end is None else bar.end
    outcome = "not finished" if bar.outcome is None else outcome_name(bar.outcome)
    title = escape(f"{bar.action}: {outcome}, {bar.begin:.2f} s to {end:.2f} s")
    x, width = LEFT + bar.begin * scale, max(2.0, (end - bar.begin) * scale)
    return (
        f'<rect x="{x:.1f}" y="{ROW * row + (ROW - BAR) // 2}" width="{width:.1f}" height="{BAR}" rx="2" '
        f'fill="{_colour(bar.outcome)}" fill-opacity="0.75"><title>{title}</title></rect>'
    )


def _colour(outcome: int | None) -> str:
    """Green and red for success and failure; a goal that was canceled or replaced is neither."""
    if outcome is None or outcome_name(outcome) == "CANCELED":
        return NEITHER
    return GOOD if is_success(outcome) else BAD


def _tick(time: float, scale: float, bottom: int) -> str:
    x = LEFT + time * scale
    return (
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{bottom}" stroke="#ddd"/>'
        f'<text x="{x:.1f}" y="{bottom + 16}" font-size="11" text-anchor="middle" fill="#555">{time:.0f} s</text>'
    )
