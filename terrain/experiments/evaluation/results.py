"""The results of an evaluation as a file: protocol, entries and every run, to stand beside other results."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mbf_abstract.config.findings import ConfigError, Finding, describe_value
from mbf_abstract.whole_files import write_whole
from terrain.experiments.evaluation.protocol import Entry, Protocol
from terrain.provenance.code import commit_of

SHIPPED = Path(__file__).parent / "shipped"
NEEDED = ("trial", "world", "seed", "entry", "route", "success", "failure", "message", "spl", "time_s")

Row = dict[str, Any]


@dataclass(frozen=True)
class Results:
    """Runs of one or more entries.

    Attributes
    ----------
    head : dict
        Protocol, entries, command, version and commit.
    rows : list of dict
        One for each run.
    """

    head: dict[str, Any]
    rows: list[Row]


def results_of(protocol: Protocol, entries: Sequence[Entry], rows: Sequence[Row], command: str) -> Results:
    """Return what is written of an evaluation."""
    head = {
        "protocol": {
            "name": protocol.name,
            "version": protocol.version,
            "hash": protocol.hash,
            "about": protocol.about,
            "trials": len(protocol.trials),
            "rules": dict(protocol.rules),
        },
        "command": command,
        "version": version("mbf-flex"),
        "commit": commit_of(Path(__file__).parents[2]),
        "entries": {
            entry.name: {"backend": entry.backend, "settings": dict(entry.settings), "code": entry.code}
            for entry in entries
        },
    }
    return Results(head, list(rows))


def write_results(results: Results, file: Path) -> None:
    """Write results with one line for each run."""
    head = json.dumps(results.head, indent=1, sort_keys=True).removesuffix("\n}")
    runs = ",\n".join(json.dumps(row, sort_keys=True) for row in results.rows)
    write_whole(file, f'{head},\n "runs": [\n{runs}\n]\n}}\n')


def read_results(file: Path) -> Results:
    """Read results; raises ConfigError if the file is none."""
    expected = "results of mbf bench"
    try:
        data = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError([Finding(str(file), 1, "", expected, str(error))]) from error
    runs = data.pop("runs", None) if isinstance(data, dict) else None
    if not isinstance(runs, list) or not isinstance(data.get("protocol"), dict):
        raise ConfigError([Finding(str(file), 1, "", expected, describe_value(data))])
    wrong = [
        Finding(str(file), 1, f"runs[{number}]", f"an object with {', '.join(NEEDED)}", describe_value(row))
        for number, row in enumerate(runs)
        if not isinstance(row, dict) or any(name not in row for name in NEEDED)
    ]
    if wrong:
        raise ConfigError(wrong)
    return Results(data, runs)


def shipped_results(protocol: Protocol) -> Results | None:
    """Return the results of the shipped entries that come with the package; None if there are none."""
    file = SHIPPED / f"{protocol.name}_{protocol.version}.json"
    return read_results(file) if file.is_file() else None


def comparable(results: Results, protocol: Protocol) -> list[Row]:
    """Return the runs of results in the trials of a protocol, by the trials' hashes."""
    hashes = {protocol.trial_hash(trial) for trial in protocol.trials}
    return [row for row in results.rows if row["trial"] in hashes]
