"""Figures of a sweep: box plots of the metrics, difficulty curves, the tracks of all runs in one plan.

The same runs give the same bytes.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.whole_files import write_whole
from terrain.sweeps.difficulty import Curve, curves_of_settings
from terrain.sweeps.statistics import METRICS, Row, values_of
from terrain.sweeps.variants import short_names

TRACK = "track"
LEAST_HEIGHT, MOST_HEIGHT = 0.15, 1.0  # of the tracks' plan, in its widths
HEIGHT_OF_LINE = 0.18  # [inch], of a legend
WIDEST_OF_TWO = 40  # letters of names that stand in two columns
WIDTH_OF_LETTER = 0.055  # [inch], of the names at box plots
BESIDE = 0.25  # of the least step of a difficulty, for all curves together
FEWEST_STEPS = 8  # of an axis, for this distance
MOST_TICKS = 12  # values of a difficulty that are all named at its axis
MOST_NUMBERS = 4  # steps of a box plot's axis, whose numbers may have six digits
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#b8a800")
"""Distinct for colour-blind people, too (Okabe and Ito 2008); the last one darker, for white paper."""


def write_figures(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Write ``boxplots``, ``difficulty`` and ``tracks``, each as PDF and as SVG; returns the files.

    There are none without matplotlib, and none of a figure that would be empty, such as of the difficulty where no
    setting has several numbers.
    """
    variants = {name: [row for row in rows if row["variant"] == name] for name in sorted({r["variant"] for r in rows})}
    return [
        *_write("boxplots", folder, lambda figure: _draw_boxes(figure, variants)),
        *write_difficulty(curves_of_settings(rows), folder),
        *_write("tracks", folder, lambda figure: _draw_tracks(figure, variants)),
    ]


def write_difficulty(curves: Mapping[str, Sequence[Curve]], folder: Path) -> list[Path]:
    """Write the curves over each difficulty as ``difficulty``, PDF and SVG; returns the files, none without curves."""
    return _write("difficulty", folder, lambda figure: _draw_curves(figure, curves))


def _write(name: str, folder: Path, draw: Callable[[Any], bool]) -> list[Path]:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return []
    figure = Figure(layout="constrained")
    if not draw(figure):
        return []
    files = [folder / f"{name}.{suffix}" for suffix in ("pdf", "svg")]
    for file in files:
        write_whole(file, _bytes_of(figure, file.suffix[1:]))
    return files


def _draw_boxes(figure: Any, variants: Mapping[str, Sequence[Row]]) -> bool:
    """A panel for each metric that has values, a box for each variant: quartiles, median, every run as a dot."""
    shown = [metric for metric in METRICS if any(values_of(rows, metric) for rows in variants.values())]
    names = [_shown(name) for name in short_names(list(variants)).values()]
    if not shown:
        return False
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    longest = max(map(len, names))
    figure.set_size_inches(3.2 * columns + WIDTH_OF_LETTER * longest, (1.4 + 0.3 * len(variants)) * lines)
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
        panel.locator_params(axis="x", nbins=MOST_NUMBERS)
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


def _draw_curves(figure: Any, curves: Mapping[str, Sequence[Curve]]) -> bool:
    """Two panels for each difficulty: successes with Wilson's interval, and the mean SPL.

    Curves stand beside each other by a part of the least step, so that equal ones can be distinguished.
    """
    if not curves:
        return False
    figure.set_size_inches(max(4.8, 3.6 * len(curves)), 5.0)
    panels = figure.subplots(2, len(curves), squeeze=False, sharex="col", sharey=True)
    for (difficulty, of_difficulty), (upper, lower) in zip(curves.items(), panels.T, strict=True):
        values = sorted({point.value for curve in of_difficulty for point in curve.points})
        least = min([*np.diff(values).tolist(), (values[-1] - values[0]) / FEWEST_STEPS])
        step = BESIDE * least / len(of_difficulty)
        for number, (curve, colour) in enumerate(zip(of_difficulty, _colours(len(of_difficulty)), strict=True)):
            _draw_curve(upper, lower, curve, (number - (len(of_difficulty) - 1) / 2.0) * step, colour)
        lower.set_xlabel(_shown(difficulty))
        if len(values) <= MOST_TICKS:
            lower.set_xticks(values, [f"{value:g}" for value in values])
        for panel in (upper, lower):
            panel.spines[["top", "right"]].set_visible(False)
    panels[0, 0].set(ylabel="success", ylim=(-0.04, 1.04))
    panels[1, 0].set_ylabel("mean SPL")
    _draw_legend(figure, panels[1, 0])
    return True


def _draw_curve(upper: Any, lower: Any, curve: Curve, shift: float, colour: str) -> None:
    """Successes into the upper panel, the interval of each as a pale line, the SPL into the lower one."""
    values = [point.value + shift for point in curve.points]
    upper.vlines(
        values,
        [point.success.low for point in curve.points],
        [point.success.high for point in curve.points],
        color=colour,
        alpha=0.4,
        linewidth=1.0,
    )
    style = {"color": colour, "markersize": 3.5, "linewidth": 1.2}
    upper.plot(values, [point.success.share for point in curve.points], "o-", **style)
    spl = [math.nan if point.spl is None else point.spl for point in curve.points]
    lower.plot(values, spl, "o-", label=_shown(curve.name), **style)


def _draw_tracks(figure: Any, variants: Mapping[str, Sequence[Row]]) -> bool:
    """Every track from above; that of a run that is no success is dashed and ends in a cross."""
    points = [point for rows in variants.values() for row in rows for point in row.get(TRACK) or ()]
    if not points:
        return False
    width, height = np.ptp(points, axis=0).tolist()
    figure.set_size_inches(6.4, 1.0 + 5.4 * min(max(height / max(width, 1e-9), LEAST_HEIGHT), MOST_HEIGHT))
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
    _draw_legend(figure, panel)
    return True


def _draw_legend(figure: Any, panel: Any) -> None:
    """The names of a panel's lines above all panels; the figure grows by their height."""
    handles, names = panel.get_legend_handles_labels()
    columns = 2 if max(map(len, names)) < WIDEST_OF_TWO else 1
    figure.set_figheight(figure.get_figheight() + HEIGHT_OF_LINE * -(-len(names) // columns))
    figure.legend(handles, names, fontsize=8, frameon=False, loc="outside upper left", ncols=columns)


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
