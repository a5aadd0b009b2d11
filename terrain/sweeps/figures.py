"""Figures of a sweep: box plots of the metrics, and the tracks of all runs in one plan; the same bytes each time."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.whole_files import write_whole
from terrain.sweeps.statistics import METRICS, Row, values_of
from terrain.sweeps.variants import short_names

TRACK = "track"
LEAST_HEIGHT, MOST_HEIGHT = 0.15, 1.0  # of the tracks' plan, in its widths
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#b8a800")
"""Distinct for colour-blind people, too (Okabe and Ito 2008); the last one darker, for white paper."""


def write_figures(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Write ``boxplots`` and ``tracks``, each as PDF and as SVG; returns the files, none without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return []
    files = []
    variants = {name: [row for row in rows if row["variant"] == name] for name in sorted({r["variant"] for r in rows})}
    for name, draw in (("boxplots", _draw_boxes), ("tracks", _draw_tracks)):
        figure = Figure(layout="constrained")
        if draw(figure, variants):
            for suffix in ("pdf", "svg"):
                write_whole(folder / f"{name}.{suffix}", _bytes_of(figure, suffix))
                files.append(folder / f"{name}.{suffix}")
    return files


def _draw_boxes(figure: Any, variants: Mapping[str, Sequence[Row]]) -> bool:
    """A panel for each metric that has values, a box for each variant: quartiles, median, every run as a dot."""
    shown = [metric for metric in METRICS if any(values_of(rows, metric) for rows in variants.values())]
    names = [_shown(name) for name in short_names(list(variants)).values()]
    if not shown:
        return False
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure.set_size_inches(3.2 * columns, (1.4 + 0.3 * len(variants)) * lines)
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for panel in panels[len(shown) :]:
        panel.remove()
    for number, (panel, metric) in enumerate(zip(panels, shown, strict=False)):
        values = [values_of(rows, metric) for rows in variants.values()]
        places = range(len(values), 0, -1)
        panel.use_sticky_edges = False  # else a box of no width lies on the panel's edge
        for place, of_variant, colour in zip(places, values, _colours(len(values)), strict=True):
            if of_variant:
                _draw_box(panel, place, of_variant, colour)
        panel.set_yticks(list(places), names if number % columns == 0 else [""] * len(names), fontsize=7)
        panel.set_xlabel(metric.title)
        panel.spines[["top", "right"]].set_visible(False)
    return True


def _draw_box(panel: Any, place: int, values: Sequence[float], colour: str) -> None:
    """A lying box of the quartiles, whiskers to the last values within 1.5 of its lengths (Tukey), and all values."""
    array = np.asarray(values)
    lower, median, upper = np.quantile(array, [0.25, 0.5, 0.75]).tolist()
    reach = 1.5 * (upper - lower)
    inside = array[(array >= lower - reach) & (array <= upper + reach)]
    panel.barh(place, upper - lower, 0.6, lower, facecolor="none", edgecolor="black")
    panel.plot([median, median], [place - 0.3, place + 0.3], color="black", linewidth=2.0)
    for end, side in ((float(inside.min()), lower), (float(inside.max()), upper)):
        panel.plot([end, side], [place, place], color="black", linewidth=1.0)
    panel.plot(values, [place] * len(values), "o", color=colour, alpha=0.6, markersize=3)


def _draw_tracks(figure: Any, variants: Mapping[str, Sequence[Row]]) -> bool:
    """Every track from above; that of a run that is no success is dashed and ends in a cross."""
    points = [point for rows in variants.values() for row in rows for point in row.get(TRACK) or ()]
    if not points:
        return False
    width, height = np.ptp(points, axis=0).tolist()
    figure.set_size_inches(6.4, 1.2 + 5.4 * min(max(height / max(width, 1e-9), LEAST_HEIGHT), MOST_HEIGHT))
    panel = figure.subplots()
    names = short_names(list(variants))
    for (variant, rows), colour in zip(variants.items(), _colours(len(variants)), strict=True):
        label: str | None = _shown(names[variant])
        for row in rows:
            if not row.get(TRACK):
                continue
            x, y = zip(*row[TRACK], strict=True)
            panel.plot(x, y, "-" if row["success"] else "--", color=colour, alpha=0.6, linewidth=1.0, label=label)
            label = None
            if not row["success"]:
                panel.plot(x[-1], y[-1], "x", color=colour)
    panel.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    figure.legend(fontsize=8, frameon=False, loc="outside upper left", ncols=2)
    return True


def _colours(count: int) -> list[str]:
    return [COLOURS[index % len(COLOURS)] for index in range(count)]


def _shown(variant: str) -> str:
    return variant.replace("$", r"\$")


def _bytes_of(figure: Any, suffix: str) -> bytes:
    """A figure without the date and the random names that matplotlib puts into files."""
    from matplotlib import rc_context

    buffer, date = io.BytesIO(), "Date" if suffix == "svg" else "CreationDate"
    with rc_context({"svg.hashsalt": "mbf", "pdf.fonttype": 42}):
        figure.savefig(buffer, format=suffix, metadata={date: None})
    return buffer.getvalue()
