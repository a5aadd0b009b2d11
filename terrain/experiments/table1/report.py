"""The result of the experiment: its tables, as text for a terminal and for the documentation, and its file.

The file is JSON that every reader takes, in which there is no NaN and no Infinity.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table

from mbf_abstract.whole_files import write_whole

PAPER = {
    "planner calls": (1195, 290),
    "controller calls": (389, 232),
    "recovery calls": (194, 180),
    "clear_costmaps": (175, 93),
    "out_of_collision": (6, 46),
    "relax_controller": (4, 31),
    "relax_planner": (7, 10),
    "escape_distance": (2, 0),
    "time": (4926, 4312),
}
"""Table I of the paper: move_base, and Move Base Flex with a tree; the time in seconds."""

RECOVERY_ROWS = ("clear_costmaps", "out_of_collision", "relax_controller", "relax_planner", "escape_distance")


def show(result: Mapping[str, Any]) -> Group:
    """Return all tables and the verdict."""
    verdict = f"\nverdict: {result['verdict']}   (parameters {result['parameters_hash']}, seeds {result['seeds']})"
    return Group(table_1(result), conditions_table(result), checks_table(result), criteria_table(result), verdict)


def table_1(result: Mapping[str, Any]) -> Table:
    """Make the paper's table with ours, conditions S1 and B, beside it."""
    a, b = result["conditions"]["S1"], result["conditions"]["B"]
    table = Table("", "move_base", "MBF + tree", "ratio", "ours: S1", "ours: B", "ratio [95 %]")
    for row in ("planner calls", "controller calls", "recovery calls", *RECOVERY_ROWS, "time"):
        paper = PAPER[row]
        ours = [of["recoveries"].get(row, 0) if row in RECOVERY_ROWS else round(of[row]) for of in (a, b)]
        ratio = _plain_ratio(*ours)
        if row in result["ratios"]:
            found = result["ratios"][row]
            ratio = f"{found['value']:.2f} [{found['low']:.2f}, {found['high']:.2f}]"
        table.add_row(
            ("- " if row in RECOVERY_ROWS else "") + row, *map(str, paper), _plain_ratio(*paper), *map(str, ours), ratio
        )
    table.caption = f"times in s; Wilcoxon signed rank of the times p = {result['wilcoxon_p']:.4f}"
    return table


def conditions_table(result: Mapping[str, Any]) -> Table:
    """Make one row for every condition that was run."""
    table = Table(
        "condition",
        "planner main / second (failed)",
        "ctrl",
        "rec (useless)",
        "bit",
        "time",
        "plan / drive / recover / wait",
        "dist",
        "contacts rack / we / they",
        "legs lost",
    )
    for name, condition in result["conditions"].items():
        planner, split, contacts = condition["planner"], condition["split"], condition["contacts"]
        main = planner["main_ok"] + planner["main_failed"]
        second = planner["second_ok"] + planner["second_failed"]
        table.add_row(
            f"{name}: {condition['text']}",
            f"{main} ({planner['main_failed']}) / {second} ({planner['second_failed']})",
            str(condition["controller calls"]),
            f"{condition['recovery calls']} ({condition['useless recoveries']})",
            f"{condition['entropy']:.2f}",
            f"{condition['time']:.0f} s",
            " / ".join(f"{split[key]:.0f}" for key in ("planning", "driving", "recovering", "waiting")),
            f"{condition['distance']:.0f} m",
            " / ".join(str(contacts[key]) for key in ("rack/we", "robot/we", "robot/they")),
            f"{condition['legs']['aborted']} + {condition['legs']['timed_out']} of {sum(condition['legs'].values())}",
        )
    table.caption = "legs lost: aborted + timed out"
    return table


def checks_table(result: Mapping[str, Any]) -> Table:
    """Make the table of the acceptance checks."""
    table = Table("acceptance check", "", "found")
    for check in result["checks"]:
        table.add_row(check["name"], "passed" if check["passed"] else "FAILED", check["found"])
    return table


def criteria_table(result: Mapping[str, Any]) -> Table:
    """Make the table of the six criteria."""
    table = Table("claim", "found", "direction", "agreement")
    for criterion in result["criteria"]:
        holds, strong = criterion["holds"], criterion["strong"]
        table.add_row(
            criterion["claim"], criterion["found"], "holds" if holds else "FAILS", "strong" if holds and strong else "-"
        )
    return table


def _plain_ratio(a: float, b: float) -> str:
    return f"{a / b:.2f}" if b else "-"


def write_result(file: Path, result: Mapping[str, Any]) -> None:
    """Write a file whole. What is undefined (nan) becomes null, what is infinite the text ``inf`` or ``-inf``."""
    write_whole(file, json.dumps(_plain(result), indent=1, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
