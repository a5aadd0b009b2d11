"""Two runs side by side: one HTML file, made of the parts of the report, and the rows of a table for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from terrain.recording.recording import Recording
from terrain.viewer.reports import report
from terrain.viewer.reports.page import beside, cell, page, table
from terrain.viewer.reports.timeline import timeline_svg

WIDTH = 1700  # pixels

Run = tuple[Recording, Mapping[str, Any]]


def comparison_html(names: tuple[str, str], left: Run, right: Run) -> str:
    """Return the page's text: ``names`` identify the runs, a run is its recording and its metrics.

    Raises ViewerMissing without matplotlib.
    """
    runs = (left[0], right[0])
    heads = [f"<p>{escape(name)}</p>{report.summary(run)}" for name, run in zip(names, runs, strict=True)]
    parts = [
        beside(heads[0], heads[1]),
        beside(*map(report.picture, runs)),
        f"<h2>Metrics</h2><p>{compare_digests(left[1], right[1])}</p>"
        + table(("name", *names, "difference"), compare_metrics(left[1], right[1])),
        "<h2>Over time</h2>" + beside(*(report.plots_svg(run) if len(run.times) else "" for run in runs)),
        "<h2>Actions and plugins</h2>" + beside(*(timeline_svg(run.events) for run in runs)),
        "<h2>Results of the goals, in order</h2>" + beside(*map(report.goals_table, runs)),
        "<h2>Incidents, faults, stops and recoveries</h2>" + beside(*map(report.notable_table, runs)),
    ]
    return page(f"{names[0]} and {names[1]}", parts, WIDTH)


def compare_metrics(left: Mapping[str, Any], right: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Rows of name, left, right and right minus left; a metric that one run lacks is a dash."""
    names = [*left, *(name for name in right if name not in left)]
    return [
        (name, _shown(left, name), _shown(right, name), _difference(left.get(name), right.get(name))) for name in names
    ]


def compare_digests(left: Mapping[str, Any], right: Mapping[str, Any]) -> str:
    """Return whether two runs are the same drive, bit for bit; equal numbers in the table do not prove it."""
    digests = left.get("digest"), right.get("digest")
    if None in digests:
        return "digest: at least one run has none, so whether they are the same drive is not known"
    if digests[0] == digests[1]:
        return "digest: equal; poses, commands and events of the two runs are the same, bit for bit"
    return "digest: differs; the two runs are not the same drive"


def _shown(metrics: Mapping[str, Any], name: str) -> str:
    return cell(metrics[name]) if metrics.get(name) is not None else "-"


def _difference(left: Any, right: Any) -> str:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in (left, right)):
        return f"{right - left:+.4g}" if right != left else "0"
    return "" if left == right else "differs"
