"""The leaderboard of an evaluation: a line per entry, best first, as a table for a terminal and as a page.

Entries are ranked by the share of worlds with a route in which they succeed, then by their mean SPL (success weighted
by path length, Anderson et al. 2018). An entry that has not driven all worlds has no rank.
"""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from mbf_abstract.event_values import well_formed
from terrain.sweeps.html_tables import html_page, html_table
from terrain.sweeps.statistics import rate_of

Row = dict[str, Any]

WIDEST_NAME = 19  # characters of a name that leave room for the other columns in a terminal of 80
MOST_FAILURES = 200  # lines of the page's list of failed runs


@dataclass(frozen=True)
class Standing:
    """One entry's line.

    Attributes
    ----------
    rank : int or None
        From 1; entries that are equal share one. None without all runs.
    arrived, with_route, runs : int
        Successes in worlds with a route, those worlds, and all that were driven.
    low, high : float
        95 % interval of the share of successes (Wilson).
    spl : float
        Mean over the worlds with a route; a failure is 0.
    time_s, planning_ms : float or None
        Medians: of the successes, and of all runs.
    contacts, near_misses : int or None
        Sums of contacts in which the robot moved, and of near misses; None where a run has no such numbers.
    failures : dict of str to int
        In worlds with a route, by class.
    reason : str
        The most frequent message of a failure.
    """

    entry: str
    rank: int | None
    arrived: int
    with_route: int
    runs: int
    share: float
    low: float
    high: float
    spl: float
    time_s: float | None
    planning_ms: float | None
    arrived_without_route: int
    contacts: int | None
    near_misses: int | None
    failures: dict[str, int]
    reason: str


def standings(rows: Sequence[Row], trials: int) -> list[Standing]:
    """Return the lines of all entries, the best first, those that have not driven all ``trials`` worlds last."""
    found = [_standing(name, [row for row in rows if row["entry"] == name]) for name in _names(rows)]
    found.sort(key=lambda one: (one.runs < trials, -one.share, -one.spl, one.entry))
    ranked: list[Standing] = []
    for number, one in enumerate(found, start=1):
        before = ranked[-1] if ranked else None
        same = before is not None and (before.share, before.spl) == (one.share, one.spl)
        rank = before.rank if same and before is not None else number
        ranked.append(_with_rank(one, rank if one.runs == trials else None))
    return ranked


def _with_rank(standing: Standing, rank: int | None) -> Standing:
    return Standing(**{**vars(standing), "rank": rank})


def _names(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["entry"] for row in rows))


def _standing(name: str, rows: Sequence[Row]) -> Standing:
    routed = [row for row in rows if row["route"]]
    arrived = [row for row in routed if row["success"]]
    failed = [row for row in routed if not row["success"]]
    rate = rate_of(routed) if routed else None
    times = [row["time_s"] for row in arrived]
    planning = [row["planning_wall_median_ms"] for row in rows if row.get("planning_wall_median_ms") is not None]
    messages = Counter(row["message"] for row in failed)
    return Standing(
        name,
        None,
        len(arrived),
        len(routed),
        len(rows),
        round(rate.share, 6) if rate else 0.0,
        round(rate.low, 6) if rate else 0.0,
        round(rate.high, 6) if rate else 1.0,
        round(float(np.mean([row["spl"] or 0.0 for row in routed])), 6) if routed else 0.0,
        round(float(np.median(times)), 3) if times else None,
        round(float(np.median(planning)), 3) if planning else None,
        sum(bool(row["success"]) for row in rows if not row["route"]),
        _sum(rows, "collisions_while_moving"),
        _sum(rows, "near_misses"),
        dict(sorted(Counter(row["failure"] for row in failed).items())),
        messages.most_common(1)[0][0] if messages else "",
    )


def _sum(rows: Sequence[Row], name: str) -> int | None:
    """Over the runs that began; None if one of them has no such number, as in results of older versions."""
    counts = [row.get(name) for row in rows if row["failure"] != "error"]
    known = [count for count in counts if count is not None]
    return sum(known) if len(known) == len(counts) else None


def terminal_table(lines: Sequence[Standing], title: str) -> Table:
    """Return the leaderboard for a terminal of 80 columns."""
    table = Table(box=SIMPLE, title=escape(title), title_justify="left")
    table.add_column("", justify="right")
    longest = max((len(line.entry) for line in lines), default=0)
    table.add_column("entry", overflow="fold", min_width=min(longest, WIDEST_NAME))
    for name in ("arrived", "SPL", "time\n[s]", "plan\n[ms]"):
        table.add_column(escape(name), justify="right")
    counts = _counts(lines)
    for name in counts:
        table.add_column(name.replace(" ", "\n"), justify="right")
    table.add_column("failures", overflow="fold")
    for line in lines:
        table.add_row(
            "-" if line.rank is None else str(line.rank),
            escape(well_formed(line.entry)),
            f"{line.arrived} of {line.with_route}",
            f"{line.spl:.3f}",
            "-" if line.time_s is None else f"{line.time_s:.1f}",
            "-" if line.planning_ms is None else f"{line.planning_ms:.1f}",
            *("-" if count is None else str(count) for count in (getattr(line, key) for key in counts.values())),
            escape(failures_text(line)),
        )
    return table


def _counts(lines: Sequence[Standing]) -> dict[str, str]:
    """Headings and attributes of the counts that are not 0, or unknown, in every line."""
    names = {"contacts": "contacts", "near misses": "near_misses"}
    return {title: name for title, name in names.items() if any(getattr(line, name) for line in lines)}


def failures_text(line: Standing) -> str:
    """Return failures by class, such as ``3 planner, 1 physics``."""
    return ", ".join(f"{count} {name}" for name, count in line.failures.items())


def page(
    title: str,
    about: Sequence[str],
    rows: Sequence[Row],
    lines: Sequence[Standing],
    entrants: set[str],
    entries: Mapping[str, Mapping[str, Any]],
    curves: str = "",
) -> str:
    """Return the leaderboard as a page that needs no other file.

    Parameters
    ----------
    about : sequence of str
        Paragraphs: what was driven, how it was judged, where the rows come from.
    entrants : set of str
        Whose line is marked, and whose failures are listed.
    entries : mapping
        Map and settings of every line.
    curves : str
        The figure of difficulty curves as SVG; empty for none.
    """
    parts = [f"<p>{html.escape(text)}</p>" for text in about]
    parts += [html_table([page_line(line, line.entry in entrants, _counts(lines)) for line in lines])]
    parts += ["<h2>Arrived, by world</h2>", curves, html_table(_by_world(rows, lines))]
    settings = [
        {"entry": line.entry, "map": entries[line.entry]["backend"], "settings": settings_text(entries[line.entry])}
        for line in lines
    ]
    parts += ["<h2>Settings</h2>", html_table(settings)]
    failed = [row for row in rows if row["entry"] in entrants and not row["success"]]
    if failed:
        parts += ["<h2>Runs that failed</h2>", html_table([_failed_line(row) for row in failed[:MOST_FAILURES]])]
    return html_page(title, parts)


def settings_text(entry: Mapping[str, Any]) -> str:
    """Return what an entry changes in the protocol's configuration, as it would be given to ``--set``."""
    return " ".join(f"{key}={value}" for key, value in sorted(entry["settings"].items()))


def page_line(line: Standing, is_entrant: bool, counts: Mapping[str, str]) -> Row:
    """Return an entry's line by the titles of its columns; ``counts`` are titles and attributes of those to show."""
    return {
        "": "▶" if is_entrant else "",
        "rank": "" if line.rank is None else line.rank,
        "entry": line.entry,
        "arrived": f"{line.arrived} of {line.with_route}",
        "arrived [%]": round(100.0 * line.share, 1),
        "95 % interval": f"{100.0 * line.low:.1f} to {100.0 * line.high:.1f}",
        "SPL": round(line.spl, 3),
        "time [s]": "" if line.time_s is None else line.time_s,
        "planning [ms]": "" if line.planning_ms is None else line.planning_ms,
        **{title: "" if (count := getattr(line, name)) is None else count for title, name in counts.items()},
        "failures": failures_text(line),
        "most frequent reason": line.reason,
    }


def _by_world(rows: Sequence[Row], lines: Sequence[Standing]) -> list[Row]:
    worlds = list(dict.fromkeys(row["world"] for row in rows))
    table = []
    for line in lines:
        cells = {}
        for world in worlds:
            here = [row for row in rows if (row["entry"], row["world"]) == (line.entry, world) and row["route"]]
            cells[world] = f"{sum(bool(row['success']) for row in here)} of {len(here)}" if here else ""
        table.append({"entry": line.entry, **cells})
    return table


def _failed_line(row: Row) -> Row:
    return {
        "entry": row["entry"],
        "world": row["world"],
        "seed": row["seed"],
        "route": "yes" if row["route"] else "no",
        "failure": row["failure"],
        "outcome": row["outcome"],
        "verdict": row["verdict"],
    }
