"""Pages of tables: what a sweep and a leaderboard are shown with."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from terrain.sweeps.statistics import Row
from terrain.viewer.reports.metric_names import in_words

STYLE = (
    "body{font:14px system-ui,sans-serif;color:#222;margin:2em}h1{font-size:1.6em}h2{font-size:1.25em}"
    "table{border-collapse:collapse;margin-bottom:2em;font-variant-numeric:tabular-nums}"
    "th,td{border:1px solid #bbb;padding:.2em .6em;text-align:right;vertical-align:top}"
    "td{white-space:nowrap}td.text,th.text{text-align:left}td.long{white-space:normal;min-width:30em}"
    ".wide{overflow-x:auto}svg{max-width:100%;height:auto}"
    "tr.success{background:#e6f4e9}tr.arrived{background:#fdf3d3}tr.failed{background:#fbe3e0}"
    "@media(max-width:600px){body{margin:1em}table{font-size:12px}}"
)
LONG = 80  # letters of a text that is wrapped
DIGITS = 4


def html_page(title: str, parts: Iterable[str]) -> str:
    """Return a page with a heading and parts that are HTML; it needs no other file."""
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style><h1>{html.escape(title)}</h1>{''.join(parts)}</html>\n"
    )


def html_table(rows: Sequence[Row]) -> str:
    """Return rows as a table, without columns that are empty in all of them.

    The ``level`` of a row is its colour, see ``STYLE``. Numbers of a column have the same decimals, but in a table of
    several metrics, one a row.
    """
    if not rows:
        return "<p>No runs yet.</p>"
    names = [name for name in rows[0] if name != "level" and any(row[name] not in ("", None) for row in rows)]
    head = "".join(_heading(name, rows) for name in names)
    decimals = {} if "metric" in rows[0] else {name: decimals_of([row[name] for row in rows]) for name in names}
    body = "".join(_line(row, names, decimals) for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def inline_svg(file: Path) -> str:
    """Return a figure that is an SVG file as a part of a page."""
    svg = file.read_text("utf-8")
    return f"<div>{svg[svg.index('<svg') :]}</div>"


def decimals_of(values: Iterable[object]) -> int:
    """Return the decimals that the numbers among the values need, fewer where the largest has its digits before them.

    >>> decimals_of([33.95, 34.0, "-"]), decimals_of([2.825, 161.0]), decimals_of([20557.5])
    (2, 1, 0)
    """
    numbers = [abs(value) for value in values if isinstance(value, float) and math.isfinite(value)]
    largest = max(numbers, default=0.0)
    most = max(0, DIGITS - 1 - math.floor(math.log10(largest))) if largest > 0.0 else 0
    needed = [len(f"{value:.{most}f}".rstrip("0").partition(".")[2]) for value in numbers]
    return max(needed, default=0)


def _heading(name: str, rows: Sequence[Row]) -> str:
    is_text = any(isinstance(row[name], str) and row[name] for row in rows)
    return f'<th class="{"text" if is_text else ""}">{html.escape(in_words(name))}</th>'


def _line(row: Row, names: Sequence[str], decimals: Mapping[str, int]) -> str:
    cells = "".join(_cell(name, row[name], decimals.get(name)) for name in names)
    return f'<tr class="{row.get("level", "")}">{cells}</tr>'


def _cell(name: str, value: object, decimals: int | None) -> str:
    if name == "folder" and value:
        address = html.escape(quote(f"{value}/replay.html"))
        return f'<td class="text"><a href="{address}">replay</a></td>'
    if isinstance(value, float):
        return f"<td>{value:.{DIGITS}g}</td>" if decimals is None else f"<td>{value:.{decimals}f}</td>"
    kind = "" if not isinstance(value, str) else "text long" if len(value) > LONG else "text"
    return f'<td class="{kind}">{html.escape(str(value))}</td>'
