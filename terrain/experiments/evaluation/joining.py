"""Rows of several results in one table: an entry has one line, and two entries never share a name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.experiments.evaluation.protocol import Protocol
from terrain.experiments.evaluation.results import Results, Row, comparable


@dataclass(frozen=True)
class Joined:
    """What stands in a table.

    Attributes
    ----------
    entries : dict of str to dict
        Map, settings and code of every line, as in the head of results.
    origins : list of str
        A sentence for each file that rows come from, or that has rows which are left out.
    """

    rows: list[Row]
    entries: dict[str, dict[str, Any]]
    origins: list[str]


def join(own: Results, others: Mapping[str, Results], protocol: Protocol) -> Joined:
    """Add the runs of other results in the protocol's worlds, by the names of their files.

    An entry with the map, settings and code of one that the table has is left out. Another one of the same name gets
    the name of its file behind its own.

    Raises
    ------
    ConfigError
        Two entries have one name even so.
    """
    joined = Joined(list(own.rows), dict(own.head["entries"]), [])
    for file, other in others.items():
        rows = comparable(other, protocol)
        names = _names(joined, file, other.head["entries"], list(dict.fromkeys(row["entry"] for row in rows)))
        joined.rows.extend({**row, "entry": names[row["entry"]]} for row in rows if row["entry"] in names)
        joined.entries.update({names[name]: other.head["entries"][name] for name in names})
        left_out = [name for name in dict.fromkeys(row["entry"] for row in rows) if name not in names]
        if names:
            joined.origins.append(_origin(other.head, list(names.values())))
        if left_out:
            joined.origins.append(f"Left out of {file}, because the same entry is in the table: {', '.join(left_out)}.")
    return joined


def _names(joined: Joined, file: str, entries: Mapping[str, Any], wanted: Sequence[str]) -> dict[str, str]:
    """Name in the table of each entry of a file that is not there yet."""
    names: dict[str, str] = {}
    for name in wanted:
        title = name if name not in joined.entries else f"{name} ({file})"
        if entries[name] in (joined.entries.get(name), joined.entries.get(title)):
            continue
        if title in joined.entries or title in names.values():
            expected = "results whose entries have other names"
            raise ConfigError([Finding(file, 1, "entries", expected, f"another {title!r}")])
        names[name] = title
    return names


def _origin(head: Mapping[str, Any], names: Sequence[str]) -> str:
    where = f"mbf-flex {head['version']}, commit {head['commit'][:9]}"
    return f"From other results ({where}; {head['command']}), planning times of that machine: {', '.join(names)}."
