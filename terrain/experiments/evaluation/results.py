"""The results of an evaluation as a file: protocol, entries and every run, to stand beside other results."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, field_validator, model_validator

from mbf_abstract.config.findings import ConfigError, Finding, describe_value
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.whole_files import write_whole
from terrain.experiments.evaluation.protocol import Entry, Protocol
from terrain.experiments.evaluation.trials import FAILURES
from terrain.provenance.code import commit_of

SHIPPED = Path(__file__).parent / "shipped"

Row = dict[str, Any]


class RunRow(ParameterModel):
    """One run, as far as a table needs it; other keys stay."""

    model_config = ConfigDict(extra="allow")

    trial: str = parameter(..., "Hash of the trial.")
    world: str = parameter(..., "Name of the world.")
    seed: int = parameter(..., "Seed of the world.", ge=0)
    entry: str = parameter(..., "Who drove.")
    route: bool = parameter(..., "Whether the world has a route.")
    success: bool = parameter(..., "Whether the run succeeded.")
    failure: str = parameter(..., "Class of the failure; empty for a success.")
    outcome: str = parameter(..., "Outcome of navigation.")
    message: str = parameter(..., "Message of navigation.")
    verdict: str = parameter(..., "The verdict in words.")
    spl: float | None = parameter(..., "Success weighted by path length.", ge=0.0, le=1.0)
    time_s: float | None = parameter(..., "Simulated time.", unit="s", ge=0.0)
    planning_wall_median_ms: float | None = parameter(None, "Median planning time.", unit="ms", ge=0.0)

    @field_validator("failure")
    @classmethod
    def _is_a_class(cls, failure: str) -> str:
        if failure and failure not in FAILURES:
            raise ValueError(f"one of {', '.join(FAILURES)}, or an empty text")
        return failure

    @model_validator(mode="after")
    def _is_consistent(self) -> RunRow:
        if self.success != (not self.failure) or (self.success and self.time_s is None):
            raise ValueError("a time and no failure for a success, and a failure otherwise")
        return self


class EntryRow(ParameterModel):
    """What an entry is."""

    backend: str = parameter(..., "Map.")
    settings: dict[str, str] = parameter(..., "Changes of the configuration.")
    code: str = parameter(..., "Hash of code and files that are not of this project.")


class ResultsFile(ParameterModel):
    """A whole file."""

    protocol: dict[str, Any] = parameter(..., "Name, version, hash and rules.")
    command: str = parameter(..., "Command that completed it.")
    version: str = parameter(..., "Version of the package.")
    commit: str = parameter(..., "Commit, empty if not known.")
    entries: dict[str, EntryRow] = parameter(..., "Entries by name.")
    runs: list[RunRow] = parameter(..., "Runs.")

    @model_validator(mode="after")
    def _is_consistent(self) -> ResultsFile:
        nameless = sorted({run.entry for run in self.runs} - set(self.entries))
        if nameless:
            raise ValueError(f"runs of the file's entries, but {nameless[0]!r} is none")
        twice = [run for run, count in Counter((run.entry, run.trial) for run in self.runs).items() if count > 1]
        if twice:
            raise ValueError(f"one run of an entry in each world, but {twice[0][0]!r} has two in one")
        return self


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
            "part": protocol.part,
            "version": protocol.version,
            "hash": protocol.hash,
            "about": protocol.about,
            "trials": len(protocol.trials),
            "rules": dict(protocol.rules),
        },
        "command": command,
        "version": version("mbf-flex"),
        "commit": commit_of(Path(__file__).parents[2]),
        "entries": {entry.name: described(entry) for entry in entries},
    }
    return Results(head, list(rows))


def described(entry: Entry) -> dict[str, Any]:
    """Return what an entry is, but for its name."""
    return {"backend": entry.backend, "settings": dict(entry.settings), "code": entry.code}


def write_results(results: Results, file: Path) -> None:
    """Write results with one line for each run."""
    head = json.dumps(results.head, indent=1, sort_keys=True).removesuffix("\n}")
    runs = ",\n".join(json.dumps(row, sort_keys=True) for row in results.rows)
    write_whole(file, f'{head},\n "runs": [\n{runs}\n]\n}}\n')


def read_results(file: Path) -> Results:
    """Read results; raises ConfigError if the file is none, with all findings."""
    expected = "results of mbf bench"
    try:
        data = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError([Finding(str(file), 1, "", expected, str(error))]) from error
    if not isinstance(data, dict):
        raise ConfigError([Finding(str(file), 1, "", expected, describe_value(data))])
    findings: list[Finding] = []
    validate(ResultsFile, data, YamlDocument(file, data), (), findings)
    if findings:
        raise ConfigError(findings)
    runs = data.pop("runs")
    return Results(data, runs)


def shipped_results(protocol: Protocol) -> Results | None:
    """Return the results of the shipped entries that come with the package; None if there are none."""
    file = SHIPPED / f"{protocol.title.replace(' ', '_')}.json"
    return read_results(file) if file.is_file() else None


def comparable(results: Results, protocol: Protocol) -> list[Row]:
    """Return the runs of results in the trials of a protocol, by the trials' hashes."""
    hashes = {protocol.trial_hash(trial) for trial in protocol.trials}
    return [row for row in results.rows if row["trial"] in hashes]
