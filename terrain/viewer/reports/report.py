"""The report of a run: one HTML file with outcome, picture, plots over time, a timeline, events, and metrics.

Made for reading on any machine and for attaching to an issue: no script, no network, no other file. For
motion see ``terrain.viewer.replay``.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import FloatArray
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.recording.metrics import cross_track_errors
from terrain.recording.recording import Recording
from terrain.viewer.pictures.layer_picture import has_layers, layer_picture_png
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.pictures.run_picture import picture_png
from terrain.viewer.reports.event_lines import NOTABLE, event_text
from terrain.viewer.reports.metric_names import in_words
from terrain.viewer.reports.page import image, page, table
from terrain.viewer.reports.timeline import timeline_svg

LAYERS_TEXT = (
    "As the map was when the first plan came: from pale green for 0 to dark red for the end of the layer's own scale, "
    "grey for what it forbids. The line is the last plan."
)

TIMELINE_TEXT = (
    "Green succeeded, red failed; grey was canceled or replaced, or is a control loop; point at a bar for more."
)
LEAST_TILT_SCALE = 5.0  # degrees; else a hundredth of a degree on a floor looks like a hill


def report_html(recording: Recording, metrics: Mapping[str, Any], drawn: bytes | None = None) -> str:
    """Return the page's text; raises ViewerMissing without matplotlib.

    Parameters
    ----------
    drawn : bytes, optional
        What ``picture_png`` gave for this recording, if it has been drawn already.
    """
    parts = [
        summary(recording),
        picture(recording, drawn),
        layers(recording),
        "<h2>Over time</h2>" + plots_svg(recording) if len(recording.times) else "",
        f"<h2>Actions and plugins</h2><p>{TIMELINE_TEXT}</p>{timeline_svg(recording.events)}",
        "<h2>Metrics</h2>" + table(("metric", "value"), ((in_words(name), value) for name, value in metrics.items())),
        "<h2>Results of the goals, in order</h2>" + goals_table(recording),
        "<h2>Incidents, faults, stops and recoveries</h2>" + notable_table(recording),
    ]
    return page(title_of(recording), parts)


def title_of(recording: Recording) -> str:
    """What was run, in a line."""
    return f"{recording.scenario} on {recording.backend}"


def summary(recording: Recording) -> str:
    """Title, outcome, and what was asked."""
    return (
        f"<h1>{escape(title_of(recording))}</h1>"
        f'<p class="outcome {recording.verdict.level.value}">{escape(str(recording.verdict))}</p>'
        f"<p>{escape(_asked(recording))}</p>"
    )


def picture(recording: Recording, drawn: bytes | None = None) -> str:
    """The run from above; ``drawn`` as in ``report_html``."""
    return image("map, plan and driven track from above", drawn or picture_png(recording))


def layers(recording: Recording) -> str:
    """What each layer of a mesh map said; nothing where that was not recorded."""
    if not has_layers(recording):
        return ""
    drawn = image("costs of each layer from above", layer_picture_png(recording))
    return f"<h2>Costs by layer</h2><p>{LAYERS_TEXT}</p>{drawn}"


def goals_table(recording: Recording) -> str:
    """How every goal ended, in order."""
    return table(("time", "action", "outcome", "text"), _goals(recording))


def notable_table(recording: Recording) -> str:
    """Incidents, faults, gate events and recoveries."""
    return table(("time", "what", "who", "text"), _notable(recording))


def plots_svg(recording: Recording) -> str:
    """Speed, yaw rate, tilt and cross-track error over time, as an inline SVG."""
    try:
        from matplotlib import rc_context
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ViewerMissing(f"reports need matplotlib: pip install 'mbf-flex[sim]' ({error})") from error
    figure = Figure(figsize=(10.0, 7.5), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots(4, 1, sharex=True)
    for panel, (label, lines) in zip(axes, _curves(recording).items(), strict=True):
        _draw_panel(panel, label, recording.times, lines)
    axes[2].set_ylim(top=max(axes[2].get_ylim()[1], LEAST_TILT_SCALE))
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels(axes)
    buffer = io.StringIO()
    with rc_context({"svg.hashsalt": "mbf-flex"}):  # else the names of its parts are random
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _curves(recording: Recording) -> dict[str, dict[str, FloatArray]]:
    """Values over time (n,) by the names of their lines, by the labels of their panels."""
    commands, twists = recording.commands, recording.twists
    return {
        "speed [m/s]": {"commanded": commands[:, 0], "measured": twists[:, 0]},
        "yaw rate [rad/s]": {"commanded": commands[:, 2], "measured": twists[:, 2]},
        "tilt [°]": {"tilt": np.degrees(recording.tilt)},
        "off the plan [m]": {"cross-track error": cross_track_errors(recording)},
    }


def _draw_panel(panel: Any, label: str, times: FloatArray, lines: Mapping[str, FloatArray]) -> None:
    for name, values in lines.items():
        colour, width = ("#9db8e8", 3.0) if name == "commanded" else ("#e1550a", 1.2)
        panel.plot(times, values, label=name, color=colour, linewidth=width)
    panel.set_ylabel(label)
    panel.grid(alpha=0.3)
    panel.spines[["top", "right"]].set_visible(False)
    if len(lines) > 1:
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, fontsize=8, frameon=False)


def _asked(recording: Recording) -> str:
    goals = ", then ".join(f"({goal.x:.1f}, {goal.y:.1f}) m" for goal in recording.goals) or "nowhere"
    start = recording.start
    return f"Asked: robot {recording.robot.name} from ({start.x:.1f}, {start.y:.1f}) m to {goals}."


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
            yield f"{event.time:.2f} s", event.kind.value, event.source, event_text(event)
