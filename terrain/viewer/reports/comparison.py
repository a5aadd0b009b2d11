"""Runs side by side: one HTML file, made of the parts of the report, and the rows of a table for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from terrain.recording.recording import Recording
from terrain.viewer.reports import report
from terrain.viewer.reports.metric_names import in_words
from terrain.viewer.reports.page import beside, cell, number, page, table
from terrain.viewer.reports.timeline import timeline_svg

WIDTH = 850  # pixels of a run's column

Run = tuple[Recording, Mapping[str, Any]]


def comparison_html(names: Sequence[str], runs: Sequence[Run]) -> str:
    """Return the page's text: ``names`` identify the runs, a run is its recording and its metrics.

    Raises ViewerMissing without matplotlib.
    """
    recordings, metrics = [run[0] for run in runs], [run[1] for run in runs]
    heads = [f"<p>{escape(name)}</p>{report.summary(run)}" for name, run in zip(names, recordings, strict=True)]
    parts = [
        beside(*heads),
        beside(*map(report.picture, recordings)),
        f"<h2>Metrics</h2><p>{escape(compare_digests(names, metrics))}</p>"
        + table(metrics_header(names), compare_metrics(metrics)),
        "<h2>Over time</h2>" + beside(*(report.plots_svg(run) if len(run.times) else "" for run in recordings)),
        f"<h2>Actions and plugins</h2><p>{report.TIMELINE_TEXT}</p>"
        + beside(*(timeline_svg(run.events) for run in recordings)),
        "<h2>Results of the goals, in order</h2>" + beside(*map(report.goals_table, recordings)),
        "<h2>Incidents, faults, stops and recoveries</h2>" + beside(*map(report.notable_table, recordings)),
    ]
    return page(" and ".join(names), parts, WIDTH * len(runs))


def metrics_header(names: Sequence[str]) -> tuple[str, ...]:
    """Titles of the columns of ``compare_metrics``."""
    return ("metric", *names, *["difference"] * (len(names) == 2))


def compare_metrics(metrics: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Rows of name and value in each run, of two runs also second minus first; a metric that a run lacks is a dash."""
    rows: list[tuple[str, ...]] = []
    for name in dict.fromkeys(name for run in metrics for name in run):
        difference = [_difference(*(run.get(name) for run in metrics))] if len(metrics) == 2 else []
        rows.append((in_words(name), *(_shown(run, name) for run in metrics), *difference))
    return rows


def compare_digests(names: Sequence[str], metrics: Sequence[Mapping[str, Any]]) -> str:
    """Return which runs are the same drive, bit for bit; equal numbers in the table do not prove it."""
    digests = [run.get("digest") for run in metrics]
    if None in digests:
        return "digest: at least one run has none, so whether they are the same drive is not known"
    named = list(zip(names, digests, strict=True))
    groups = [[name for name, of in named if of == digest] for digest in dict.fromkeys(digests)]
    if len(groups) == 1:
        return "digest: equal; poses, commands and events of the runs are the same, bit for bit"
    same = "; ".join(", ".join(group) for group in groups if len(group) > 1)
    return f"digest: differs; {f'only these are the same drive: {same}' if same else 'no two are the same drive'}"


def _shown(metrics: Mapping[str, Any], name: str) -> str:
    return cell(metrics[name]) if metrics.get(name) is not None else "-"


def _difference(left: Any, right: Any) -> str:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in (left, right)):
        return number(right - left, "+") if right != left else "0"
    return "" if left == right else "differs"
