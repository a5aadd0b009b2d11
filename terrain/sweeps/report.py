"""The results of a sweep as files: tables of runs, medians and tests, figures, a table for a paper, a page to read.

``sweep.csv`` (and ``sweep.parquet``, if pyarrow is installed) has a row per run, ``summary.csv`` one per variant and
metric, ``tests.csv`` one per test of two variants; ``sweep.tex`` is a table for a paper, ``boxplots``, ``difficulty``
and ``tracks`` are figures, as PDF and SVG. ``sweep.html`` shows everything, with a link to every run that was kept.
"""

from __future__ import annotations

import csv
import html
import importlib
import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from mbf_abstract.whole_files import replacing, write_whole
from terrain.recording.verdict import Level
from terrain.sweeps.figures import write_figures
from terrain.sweeps.html_tables import html_page, html_table, inline_svg
from terrain.sweeps.latex import latex_table
from terrain.sweeps.statistics import METRICS, Row, compare_variants, rate_of, spread_of, values_of
from terrain.sweeps.variants import AS_WRITTEN, common_settings, short_names

COLUMNS = (
    "variant",
    "seed",
    "success",
    "level",
    "outcome",
    "outcome_code",
    "time_s",
    "path_length_m",
    "planned_length_m",
    "geodesic_m",
    "path_over_geodesic",
    "spl",
    "max_roll_deg",
    "max_pitch_deg",
    "energy_j",
    "slipped_m",
    "collisions",
    "collisions_while_moving",
    "tip_overs",
    "near_misses",
    "incidents",
    "clearance_min_m",
    "clearance_median_m",
    "recoveries",
    "mean_command_acceleration",
    "mean_command_yaw_acceleration",
    "planning_wall_median_ms",
    "planning_wall_p95_ms",
    "wall_time_s",
    "verdict",
    "folder",
)
IN_THE_VERDICT = ("success", "outcome", "outcome_code")
TEST_COLUMNS = ("first", "second", "metric", "pairs", "difference", "p", "p_holm")


TESTS = (
    "Difference: second minus first, in the median, for success in the share. Success: McNemar's exact test; numbers: "
    "Wilcoxon's signed-rank test by changes of signs. p (Holm) is corrected for the number of all these tests (Holm)."
)


def write_tables(title: str, rows: Iterable[Row], folder: Path) -> list[Path]:
    """Write all tables of finished runs, sorted by variant and seed; return the files."""
    ordered = sorted(rows, key=lambda row: (row["variant"], row["seed"]))
    table, spreads, tests = [_flat(row) for row in ordered], spread_table(ordered), comparison_table(ordered)
    files = [folder / name for name in ("sweep.csv", "sweep.html", "summary.csv", "tests.csv", "sweep.tex")]
    for file, columns, lines in (
        (files[0], COLUMNS, table),
        (files[2], tuple(spreads[0]) if spreads else (), spreads),
        (files[3], TEST_COLUMNS, tests),
    ):
        _write_csv(file, columns, lines)
    write_whole(files[4], latex_table(ordered))
    figures = write_figures(ordered, folder)
    write_whole(files[1], _page(title, table, spreads, tests, [file for file in figures if file.suffix == ".svg"]))
    if importlib.util.find_spec("pyarrow") is not None:
        files.append(_write_parquet(table, folder / "sweep.parquet"))
    return [*files, *figures]


def spread_table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return a line per variant and metric: successes in percent, or median and quartiles, with the 95 % interval."""
    lines: list[dict[str, Any]] = []
    for variant in sorted({row["variant"] for row in rows}):
        of = [row for row in rows if row["variant"] == variant]
        rate = rate_of(of)
        shares = [round(100.0 * share, 1) for share in (rate.share, rate.low, rate.high)]
        lines.append(_spread_line(variant, "success [%]", rate.count, shares[0], "", "", shares[1], shares[2]))
        for metric in METRICS:
            found = spread_of(values_of(of, metric))
            if found is not None:
                numbers = (found.median, found.lower_quartile, found.upper_quartile, found.low, found.high)
                lines.append(_spread_line(variant, metric.title, found.count, *(round(value, 6) for value in numbers)))
    return lines


def _spread_line(variant: str, metric: str, runs: int, *numbers: Any) -> dict[str, Any]:
    names = ("median", "lower_quartile", "upper_quartile", "low_95", "high_95")
    return {
        "variant": variant or AS_WRITTEN,
        "metric": metric,
        "runs": runs,
        **dict(zip(names, numbers, strict=True)),
    }


def comparison_table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return a line per test of two variants, see ``terrain.sweeps.statistics``."""
    return [
        {
            "first": test.first or AS_WRITTEN,
            "second": test.second or AS_WRITTEN,
            "metric": test.metric,
            "pairs": test.pairs,
            "difference": round(test.difference, 6),
            "p": round(test.p, 6),
            "p_holm": round(test.corrected, 6),
        }
        for test in compare_variants(rows)
    ]


def _write_csv(file: Path, columns: Sequence[str], lines: Sequence[Row]) -> None:
    with replacing(file) as part, part.open("w", newline="", encoding="utf-8", errors="backslashreplace") as out:
        writer = csv.DictWriter(out, columns)
        writer.writeheader()
        writer.writerows(lines)


def summarise(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return one line per variant: runs, share of successes in percent, medians of the successful runs, incidents."""
    lines = []
    for variant in sorted({row["variant"] for row in rows}):
        runs = [row for row in rows if row["variant"] == variant]
        arrived = [row for row in runs if row["success"]]
        clearances, spl = _numbers(runs, "clearance_min_m"), _numbers(runs, "spl")
        ratios = [row["path_over_geodesic"] for row in arrived if row.get("path_over_geodesic")]
        lines.append(
            {
                "variant": variant or AS_WRITTEN,
                "runs": len(runs),
                "success_percent": round(100.0 * len(arrived) / len(runs), 1),
                "arrived_with_failures": sum(row["level"] == Level.ARRIVED.value for row in runs),
                "median_time_s": round(median(row["time_s"] for row in arrived), 1) if arrived else "",
                "median_length_m": round(median(row["path_length_m"] for row in arrived), 1) if arrived else "",
                "median_path_over_geodesic": round(median(ratios), 3) if ratios else "",
                "median_clearance_m": round(median(clearances), 2) if clearances else "",
                "mean_spl": round(sum(spl) / len(spl), 3) if spl else "",
                "collisions": sum(row.get("collisions") or 0 for row in runs),
                "tip_overs": sum(row.get("tip_overs") or 0 for row in runs),
                "runs_with_incidents": sum(bool(row.get("incidents")) for row in runs),
            }
        )
    return lines


def _numbers(rows: Sequence[Row], name: str) -> list[float]:
    """The values of a column, without the rows that have none."""
    return [row[name] for row in rows if isinstance(row.get(name), int | float)]


def _flat(row: Row) -> dict[str, Any]:
    """One row of the table; what a failed start did not measure stays empty."""
    values = {name: row.get(name, "") for name in COLUMNS}
    values["incidents"] = " ".join(row.get("incidents", ()))
    return values


def _write_parquet(table: Sequence[Row], file: Path) -> Path:
    arrow, parquet = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    columns = {name: [None if row[name] == "" else row[name] for row in table] for name in COLUMNS}
    with replacing(file) as part:
        parquet.write_table(arrow.table(columns), part)
    return file


def _page(
    title: str, table: Sequence[Row], spreads: Sequence[Row], tests: Sequence[Row], figures: Sequence[Path]
) -> str:
    names = short_names(sorted({row["variant"] for row in table}))
    shared = ", ".join(common_settings(list(names)))
    parts = [f"<p>All variants have {html.escape(shared)}.</p>" if shared else ""]
    parts += [html_table(_named(summarise(table), names)) if table else ""]
    parts += [inline_svg(figure) for figure in figures]
    if spreads:
        parts += ["<h2>Medians, quartiles and 95 % intervals</h2>", html_table(_named(spreads, names))]
    if tests:
        parts += ["<h2>Tests of two variants, seed by seed</h2>", f"<p>{TESTS}</p>", html_table(_named(tests, names))]
    parts += ["<h2>All runs</h2>", html_table(_named([_reordered(row) for row in table], names))]
    return html_page(title, parts)


def _named(lines: Sequence[Row], names: Mapping[str, str]) -> list[dict[str, Any]]:
    """Lines with the short names of variants."""
    return [
        {
            key: names.get(value, value) if key in ("variant", "first", "second") else value
            for key, value in line.items()
        }
        for line in lines
    ]


def _reordered(row: Row) -> dict[str, Any]:
    """A row as a reader wants it: link and verdict first, without what the verdict and the colour say already."""
    first = ("variant", "seed", "folder", "verdict")  # at the end of a wide table they are not found
    return {**{name: row[name] for name in first}, **{name: row[name] for name in row if name not in IN_THE_VERDICT}}
