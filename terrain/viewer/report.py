"""The report of a run: one HTML file with outcome, picture, plots over time, a timeline of actions, and metrics.

Made for reading on any machine and for attaching to an issue: no script, no network, nothing beside the file. For
motion see ``terrain.viewer.replay``.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.events import EventKind
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.metrics import cross_track_errors
from terrain.recording import Recording
from terrain.viewer.event_text import NOTABLE, words
from terrain.viewer.picture import ViewerMissing, picture_png
from terrain.viewer.timeline import timeline_svg

FloatArray = NDArray[np.float64]

MAX_ROWS = 200

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 1000px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: 0; } h2 { font-size: 1.15em; margin-top: 2em; }
.outcome { font-size: 1.15em; font-weight: 600; } .good { color: #1a7f37; } .bad { color: #b42318; }
table { border-collapse: collapse; } td, th { text-align: left; padding: 2px 14px 2px 0; vertical-align: top; }
th { color: #555; font-weight: 600; border-bottom: 1px solid #ccc; } td:first-child { white-space: nowrap; }
img, svg { max-width: 100%; height: auto; }
"""


def write_report(file: str | Path, recording: Recording, metrics: Mapping[str, Any]) -> None:
    """Write the report; raises ViewerMissing without matplotlib."""
    Path(file).write_text(report_html(recording, metrics), encoding="utf-8")


def report_html(recording: Recording, metrics: Mapping[str, Any]) -> str:
    """Return the page's text; raises ViewerMissing without matplotlib."""
    picture = base64.b64encode(picture_png(recording)).decode("ascii")
    title = f"{recording.scenario} on {recording.backend}"
    quality = "good" if recording.success else "bad"
    return "\n".join(
        [
            "<!doctype html>",
            f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style></head>',
            f"<body><h1>{escape(title)}</h1>",
            f'<p class="outcome {quality}">{escape(recording.outcome)}: {escape(recording.message)}</p>',
            f"<p>{escape(_asked(recording))}</p>",
            f'<img alt="map, plan and driven track from above" src="data:image/png;base64,{picture}">',
            "<h2>Over time</h2>" + plots_svg(recording) if len(recording.times) else "",
            f"<h2>Actions</h2>{timeline_svg(recording.events)}",
            "<h2>Metrics</h2>" + _table(("name", "value"), metrics.items()),
            "<h2>Results of the goals, in order</h2>"
            + _table(("time", "action", "outcome", "text"), _goals(recording)),
            "<h2>Faults, stops and recoveries</h2>" + _table(("time", "what", "who", "text"), _notable(recording)),
            "</body></html>",
        ]
    )


def plots_svg(recording: Recording) -> str:
    """Speed, yaw rate, tilt and cross-track error over time, as an inline SVG."""
    try:
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ViewerMissing(f"reports need matplotlib: pip install 'mbf-flex[sim]' ({error})") from error
    figure = Figure(figsize=(10.0, 7.5))
    FigureCanvasSVG(figure)
    axes = figure.subplots(4, 1, sharex=True)
    times = recording.times
    curves: list[tuple[str, list[tuple[str, FloatArray]]]] = [
        ("speed [m/s]", [("commanded", recording.commands[:, 0]), ("measured", recording.twists[:, 0])]),
        ("yaw rate [rad/s]", [("commanded", recording.commands[:, 2]), ("measured", recording.twists[:, 2])]),
        ("tilt [°]", [("tilt", np.degrees(recording.tilt))]),
        ("off the plan [m]", [("cross-track error", cross_track_errors(recording))]),
    ]
    for panel, (label, lines) in zip(axes, curves, strict=True):
        for name, values in lines:
            colour = "#9aa4b2" if name == "commanded" else "#e1550a"
            panel.plot(times, values, label=name, color=colour, linewidth=1.2)
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
        panel.spines[["top", "right"]].set_visible(False)
        if len(lines) > 1:
            panel.legend(loc="upper right", fontsize=8, frameon=False)
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels(axes)
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _asked(recording: Recording) -> str:
    goals = ", then ".join(f"({goal.x:.1f}, {goal.y:.1f})" for goal in recording.goals) or "nowhere"
    start = recording.start
    return f"Asked: robot {recording.robot.name} from ({start.x:.1f}, {start.y:.1f}) to {goals}."


def _goals(recording: Recording) -> Iterable[tuple[str, ...]]:
    for event in recording.events:
        if event.kind is EventKind.GOAL_FINISHED:
            code = event.data.get("outcome")
            name = outcome_name(code) if isinstance(code, int) else str(code)
            mark = "" if name == "CANCELED" or (isinstance(code, int) and is_success(code)) else " ✗"
            yield f"{event.time:.2f} s", event.source, name + mark, str(event.data.get("message", ""))


def _notable(recording: Recording) -> Iterable[tuple[str, ...]]:
    for event in recording.events:
        if event.kind in NOTABLE:
            yield f"{event.time:.2f} s", event.kind.value, event.source, words(event)


def _table(header: tuple[str, ...], rows: Iterable[tuple[Any, ...]]) -> str:
    """An HTML table of at most ``MAX_ROWS`` rows; what was left out is said."""
    listed = list(rows)
    if not listed:
        return "<p>none</p>"
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(_cell(value))}</td>" for value in row) + "</tr>" for row in listed[:MAX_ROWS]
    )
    more = f"<p>and {len(listed) - MAX_ROWS} more, see events.jsonl</p>" if len(listed) > MAX_ROWS else ""
    return f"<table><tr>{head}</tr>{body}</table>{more}"


def _cell(value: Any) -> str:
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:.4g}"
    return ", ".join(map(str, value)) or "none" if isinstance(value, list) else str(value)
