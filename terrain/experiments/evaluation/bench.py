"""Drives an evaluation as the command line asks for, and writes and prints its results."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer
from rich.console import Console

from mbf_abstract.event_values import well_formed
from mbf_abstract.whole_files import write_whole
from terrain.commands.counted import counted
from terrain.commands.verdict_line import TERMINAL_COLOURS
from terrain.experiments.evaluation.entrant import entrant
from terrain.experiments.evaluation.joining import join
from terrain.experiments.evaluation.leaderboard import Standing, page, settings_text, standings, terminal_table
from terrain.experiments.evaluation.levels import curves_of_levels
from terrain.experiments.evaluation.protocol import Entry, Protocol
from terrain.experiments.evaluation.results import described, read_results, results_of, shipped_results, write_results
from terrain.experiments.evaluation.trials import run_trials
from terrain.recording.verdict import Level
from terrain.sweeps.figures import write_difficulty
from terrain.sweeps.html_tables import inline_svg

ALL_SHIPPED = "all"


@dataclass(frozen=True)
class Asked:
    """What the command line asks for; see the options."""

    settings: dict[str, str]
    backend: str
    name: str
    beside: Sequence[str]
    workers: int
    time_limit: float
    as_json: bool
    out: Path
    command: str


@dataclass(frozen=True)
class Judged:
    """One protocol that has been driven: the head of its results, its lines, and whose they are."""

    protocol: Protocol
    head: dict[str, Any]
    lines: Sequence[Standing]
    own: set[str]
    entries: dict[str, dict[str, Any]]
    out: Path
    files: Sequence[str]

    @property
    def title(self) -> str:
        """What was driven, as a command."""
        return f"mbf bench {self.protocol.title}"

    def to_json(self) -> dict[str, Any]:
        """Head and standings, best first."""
        return {**self.head, "standings": [vars(line) for line in self.lines]}


def bench(protocol: Protocol, asked: Asked) -> None:
    """Drive everything, and write and print the results."""
    console = Console(stderr=asked.as_json)
    judged = drive(protocol, entries_of(protocol, asked), asked, console)
    if asked.as_json:
        typer.echo(json.dumps(judged.to_json()))
    else:
        show(judged, console)


def drive(protocol: Protocol, entries: list[Entry], asked: Asked, console: Console) -> Judged:
    """Drive the entries, and write results.json, leaderboard.html and the figures."""
    others = {name: read_results(Path(name)) for name in asked.beside if is_results_file(name)}
    if (shipped := shipped_results(protocol)) is not None:
        others["the shipped results"] = shipped
    rows = run_trials(protocol, entries, asked.out, asked.workers, asked.time_limit, _reporter(console))
    results = results_of(protocol, entries, rows, asked.command)
    asked.out.mkdir(parents=True, exist_ok=True)
    write_results(results, asked.out / "results.json")
    table = join(results, others, protocol)
    lines = standings(table.rows, len(protocol.trials))
    own = {entry.name for entry in entries if entry.name not in protocol.entries}
    figures = write_difficulty(curves_of_levels(table.rows, [line.entry for line in lines]), asked.out)
    names = ["results.json", "leaderboard.html", *(file.name for file in figures)]
    judged = Judged(protocol, results.head, lines, own, table.entries, asked.out, names)
    about = [*_about(results.head), *table.origins]
    curves = "".join(inline_svg(file) for file in figures if file.suffix == ".svg")
    write_whole(
        asked.out / "leaderboard.html", page(judged.title, about, table.rows, lines, own, table.entries, curves)
    )
    return judged


def show(judged: Judged, console: Console) -> None:
    """Print the table, settings that are not the protocol's, why the user's entry fails, and where the files are."""
    protocol, lines = judged.protocol, judged.lines
    title = f"{judged.title}, {counted(len(protocol.trials), 'world')}, protocol {protocol.hash}"
    console.print(terminal_table(lines, title))
    known = {name: described(entry) for name, entry in protocol.entries.items()}
    texts = [
        f"{name}: {entry['backend']}, {settings_text(entry)}"
        for name, entry in judged.entries.items()
        if known.get(name) != entry
    ]
    texts += [
        f"{line.entry} fails most often with: {line.reason}"
        for line in lines
        if line.entry in judged.own and line.reason
    ]
    texts.append(f"results in {judged.out}: {', '.join(judged.files)}")
    for text in texts:
        console.print(well_formed(text), markup=False, highlight=False, soft_wrap=True)


def entries_of(protocol: Protocol, asked: Asked) -> list[Entry]:
    """The user's entry, and the shipped ones that are driven too, each once."""
    names = [name for name in asked.beside if not is_results_file(name)]
    chosen = list(protocol.entries) if ALL_SHIPPED in names else list(dict.fromkeys(names))
    own = [entrant(protocol, asked.settings, asked.backend, asked.name)] if asked.settings else []
    return [*own, *(protocol.entry(name) for name in chosen)]


def is_results_file(name: str) -> bool:
    """Whether a name of ``--beside`` is that of a file, not of a shipped entry."""
    return name.endswith(".json")


def _reporter(console: Console) -> Callable[[dict[str, Any]], None]:
    def report(row: dict[str, Any]) -> None:
        text = well_formed(f"{row['entry']}, {row['world']}, seed {row['seed']}: {row['verdict']}")
        style = TERMINAL_COLOURS[Level(row["level"])]
        console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)

    return report


def _about(head: dict[str, Any]) -> list[str]:
    protocol = head["protocol"]
    return [
        f"{protocol['about']} {counted(protocol['trials'], 'world')}; protocol {protocol['version']}, "
        f"hash {protocol['hash']}.",
        f"A success: {protocol['rules']['success']}. Rates are over the worlds that have a route by the judge. Ranked "
        "by successes, then by SPL (success weighted by path length); who did not drive all worlds has no rank.",
        f"Driven with: {head['command']} (mbf-flex {head['version']}).",
    ]
