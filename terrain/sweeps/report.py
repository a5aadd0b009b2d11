"""The tables of a sweep: one csv (and parquet, if pyarrow is installed) with a row per run, one HTML file to read."""

from __future__ import annotations

import csv
import html
import importlib
import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from terrain.recording.verdict import Level
from terrain.recording.whole_files import replacing, write_whole

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
)
STYLE = (
    "body{font:14px sans-serif;margin:2em}table{border-collapse:collapse;margin-bottom:2em}"
    "th,td{border:1px solid #bbb;padding:.2em .6em;text-align:right}td.text{text-align:left}"
    "tr.success{background:#e6f4e9}tr.arrived{background:#fdf3d3}tr.failed{background:#fbe3e0}"
)

Row = Mapping[str, Any]


def write_tables(title: str, rows: Iterable[Row], folder: Path) -> list[Path]:
    """Write all tables of finished runs, sorted by variant and seed; return the files."""
    table = [_flat(row) for row in sorted(rows, key=lambda row: (row["variant"], row["seed"]))]
    files = [folder / "sweep.csv", folder / "sweep.html"]
    with replacing(files[0]) as part, part.open("w", newline="", encoding="utf-8", errors="backslashreplace") as out:
        writer = csv.DictWriter(out, COLUMNS)
        writer.writeheader()
        writer.writerows(table)
    write_whole(files[1], _page(title, table))
    if importlib.util.find_spec("pyarrow") is not None:
        files.append(_write_parquet(table, folder / "sweep.parquet"))
    return files


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
                "variant": variant or "as written",
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


def _page(title: str, table: Sequence[Row]) -> str:
    summary = _html_table(summarise(table)) if table else ""
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style><h1>{html.escape(title)}</h1>{summary}{_html_table(table)}</html>\n"
    )


def _html_table(rows: Sequence[Row]) -> str:
    if not rows:
        return "<p>No runs yet.</p>"
    head = "".join(f"<th>{html.escape(name)}</th>" for name in rows[0])
    body = "".join(f'<tr class="{row.get("level", "")}">{"".join(map(_html_cell, row.values()))}</tr>' for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _html_cell(value: object) -> str:
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return f'<td class="{"text" if isinstance(value, str) else ""}">{html.escape(text)}</td>'
