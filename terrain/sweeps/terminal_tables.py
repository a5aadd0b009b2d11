"""The tables of a sweep in a terminal; variants are named by a letter, so that they fit 80 columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from terrain.sweeps.statistics import (
    METRICS,
    Row,
    compare_variants,
    decimals_for,
    pairs_needed,
    quartiles_of,
    rate_of,
    values_of,
)

SHOWN = ("spl", "time_s", "path_length_m", "clearance_min_m", "planning_wall_median_ms")
SIGNIFICANT = 0.05


def letters_of(rows: Sequence[Row]) -> dict[str, str]:
    """Return a letter for each variant, A, B, ..., Z, AA, ...; in the order of their names."""
    names = sorted({row["variant"] for row in rows})
    return {name: _letter(index) for index, name in enumerate(names)}


def _letter(index: int) -> str:
    before = _letter(index // 26 - 1) if index >= 26 else ""
    return before + chr(ord("A") + index % 26)


def summary_table(rows: Sequence[Row]) -> Table:
    """Return a table with a line per variant: successes, and medians of the metrics."""
    metrics = [metric for metric in METRICS if metric.name in SHOWN]
    table = _table("medians; quartiles and intervals are in sweep.html")
    for title in ("success", *(metric.title for metric in metrics)):
        table.add_column(escape(title.replace(" [", "\n[")), justify="right")
    letters = letters_of(rows)
    of_variant = {variant: [row for row in rows if row["variant"] == variant] for variant in letters}
    decimals = [decimals_for([values_of(of, metric) for of in of_variant.values()]) for metric in metrics]
    for variant, letter in letters.items():
        of = of_variant[variant]
        columns = zip((values_of(of, metric) for metric in metrics), decimals, strict=True)
        medians = (f"{quartiles_of(values)[1]:.{digits}f}" if values else "-" for values, digits in columns)
        rate = rate_of(of)
        table.add_row(letter, f"{rate.successes} of {rate.count}", *medians)
    return table


def comparison_table(rows: Sequence[Row]) -> Table | str | None:
    """Return a table of the tests whose corrected p is below 0.05, a line if none is, None without two variants."""
    tests, letters = compare_variants(rows), letters_of(rows)
    if not tests:
        return None
    clear = [test for test in tests if test.corrected < SIGNIFICANT]
    title = f"corrected p below {SIGNIFICANT:g}: {len(clear)} of {len(tests)} tests, see tests.csv"
    if not clear:
        few = max(test.pairs for test in tests) < (needed := pairs_needed(len(tests), SIGNIFICANT))
        return f"{title}; with fewer than {needed} seeds there can be none" if few else title
    table = _table(title)
    table.add_column("metric")
    for name in ("pairs", "difference", "p (Holm)"):
        table.add_column(name, justify="right")
    for test in clear:
        numbers = (str(test.pairs), f"{test.difference:+.3g}", f"{test.corrected:.2g}")
        table.add_row(f"{letters[test.second]} - {letters[test.first]}", escape(test.metric), *numbers)
    return table


def _table(title: str) -> Table:
    table = Table(box=SIMPLE, title=title, title_justify="left")
    table.add_column("variant")
    return table
