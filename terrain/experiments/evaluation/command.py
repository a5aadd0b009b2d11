"""The commands ``mbf bench outdoor`` and ``mbf bench indoor``."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mbf_abstract.commands.reporting import readable_errors
from terrain.commands.command_line import command_line

if TYPE_CHECKING:
    from rich.console import Console

    from terrain.experiments.evaluation.protocol import Entry, Protocol

QUICK_SEEDS = "0:1"
ALL_SHIPPED = "all"
MOST_LEVELS = 10

PLANNER = typer.Option("", "--planner", help="Planner to judge: a type, module:Class or an installed plugin's name.")
CONTROLLER = typer.Option(
    "", "--controller", help="Controller to judge, likewise; the first of the protocol if not given."
)
NAME = typer.Option("", "--name", help="Name of your entry in the table; what you judge if not given.")
SETTINGS = typer.Option([], "--set", help="KEY=VALUE: a dotted path of the configuration, for your entry; repeatable.")
BESIDE = typer.Option(
    [], "--beside", help="Drive this shipped entry too, or all; or rows of another results.json; repeatable."
)
SEEDS = typer.Option("0:2", "--seeds", help="First and one past the last seed of every level, 0:16, or a list, 1,5,9.")
LEVELS = typer.Option("0:10", "--levels", help="Levels of difficulty, likewise; 0 is the easiest, 9 the hardest.")
QUICK = typer.Option(False, "--quick", help=f"One world of every level: --seeds {QUICK_SEEDS}.")
WORKERS = typer.Option(2, "--workers", min=1, help="Worker processes.")
TIME_LIMIT = typer.Option(
    600.0, "--time-limit", min=1.0, help="Wall time in seconds after which a run counts as hung; compiling counts."
)
AS_JSON = typer.Option(False, "--json", help="Print one JSON object instead of the table.")


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


def register(bench: typer.Typer) -> None:
    """Add the commands to the group ``mbf bench``."""
    bench.command("outdoor")(outdoor)
    bench.command("indoor")(indoor)


def outdoor(
    context: typer.Context,
    planner: str = PLANNER,
    controller: str = CONTROLLER,
    backend: str = typer.Option("mesh", "--backend", help="Map of your entry: mesh or costmap."),
    name: str = NAME,
    settings: list[str] = SETTINGS,
    beside: list[str] = BESIDE,
    seeds: str = SEEDS,
    levels: str = LEVELS,
    quick: bool = QUICK,
    surveys: Path | None = typer.Option(
        None, "--surveys", help="Folder with the four surveys, for 40 crops of real ground beside the generated worlds."
    ),
    workers: int = WORKERS,
    time_limit: float = TIME_LIMIT,
    as_json: bool = AS_JSON,
    out: Path = typer.Option(
        Path("runs/bench_outdoor"), "--out", help="Folder for results; runs that it holds are kept."
    ),
) -> None:
    """Judge your planner or controller on rough ground, beside the shipped ones."""
    asked = _asked(context, planner, controller, settings, backend, name, beside, workers, time_limit, as_json, out)
    with readable_errors():
        from terrain.experiments.evaluation.outdoor import outdoor as protocol

        _bench(protocol(_seeds(seeds, quick), _levels(levels), surveys), asked)


def indoor(
    context: typer.Context,
    planner: str = PLANNER,
    controller: str = CONTROLLER,
    backend: str = typer.Option("costmap", "--backend", help="Map of your entry: costmap or mesh."),
    name: str = NAME,
    settings: list[str] = SETTINGS,
    beside: list[str] = BESIDE,
    seeds: str = SEEDS,
    levels: str = LEVELS,
    quick: bool = QUICK,
    workers: int = WORKERS,
    time_limit: float = TIME_LIMIT,
    as_json: bool = AS_JSON,
    out: Path = typer.Option(
        Path("runs/bench_indoor"), "--out", help="Folder for results; runs that it holds are kept."
    ),
) -> None:
    """Judge your planner or controller among posts that only a lidar sees, beside the shipped ones."""
    asked = _asked(context, planner, controller, settings, backend, name, beside, workers, time_limit, as_json, out)
    with readable_errors():
        from terrain.experiments.evaluation.indoor import indoor as protocol

        _bench(protocol(_seeds(seeds, quick), _levels(levels)), asked)


def _seeds(text: str, quick: bool) -> list[int]:
    from terrain.sweeps.command import parse_seeds

    return parse_seeds(QUICK_SEEDS if quick else text)


def _levels(text: str) -> list[int]:
    from terrain.sweeps.command import parse_seeds

    levels = parse_seeds(text)
    if max(levels) >= MOST_LEVELS:
        raise typer.BadParameter(f"expected levels from 0 to {MOST_LEVELS - 1}, got {text!r}", param_hint="--levels")
    return levels


def _asked(
    context: typer.Context,
    planner: str,
    controller: str,
    settings: list[str],
    backend: str,
    name: str,
    beside: list[str],
    workers: int,
    time_limit: float,
    as_json: bool,
    out: Path,
) -> Asked:
    from terrain.commands.run import settings_of

    chosen = settings_of(settings, planner=planner, controller=controller)
    if not chosen and not beside:
        raise typer.BadParameter("nothing to judge: give --planner, --controller, --set or --beside")
    return Asked(chosen, backend, name, beside, workers, time_limit, as_json, out, command_line(context))


def _bench(protocol: Protocol, asked: Asked) -> None:
    """Drive everything, and write and print the results."""
    from rich.console import Console

    from mbf_abstract.event_values import well_formed
    from mbf_abstract.whole_files import write_whole
    from terrain.experiments.evaluation.joining import join
    from terrain.experiments.evaluation.leaderboard import page, settings_text, standings, terminal_table
    from terrain.experiments.evaluation.results import (
        described,
        read_results,
        results_of,
        shipped_results,
        write_results,
    )
    from terrain.experiments.evaluation.trials import run_trials

    console = Console(stderr=asked.as_json)
    entries = _entries(protocol, asked)
    others = {name: read_results(Path(name)) for name in asked.beside if _is_file(name)}
    if (shipped := shipped_results(protocol)) is not None:
        others["the shipped results"] = shipped
    rows = run_trials(protocol, entries, asked.out, asked.workers, asked.time_limit, _reporter(console))
    results = results_of(protocol, entries, rows, asked.command)
    asked.out.mkdir(parents=True, exist_ok=True)
    write_results(results, asked.out / "results.json")
    table = join(results, others, protocol)
    lines = standings(table.rows, len(protocol.trials))
    title = f"mbf bench {protocol.name} {protocol.version}"
    own = {entry.name for entry in entries if entry.name not in protocol.entries}
    about = [*_about(results.head), *table.origins]
    write_whole(asked.out / "leaderboard.html", page(title, about, table.rows, lines, own, table.entries))
    if asked.as_json:
        typer.echo(json.dumps({**results.head, "standings": [vars(line) for line in lines]}))
        return
    console.print(terminal_table(lines, f"{title}, {len(protocol.trials)} worlds, protocol {protocol.hash}"))
    known = {name: described(entry) for name, entry in protocol.entries.items()}
    for name, entry in table.entries.items():
        if known.get(name) != entry:
            text = f"{name}: {entry['backend']}, {settings_text(entry)}"
            console.print(well_formed(text), markup=False, highlight=False, soft_wrap=True)
    for line in lines:
        if line.entry in own and line.reason:
            text = f"{line.entry} fails most often with: {line.reason}"
            console.print(well_formed(text), markup=False, highlight=False, soft_wrap=True)
    console.print(f"results in {asked.out}: results.json, leaderboard.html", markup=False, soft_wrap=True)


def _entries(protocol: Protocol, asked: Asked) -> list[Entry]:
    """The user's entry, and the shipped ones that are driven too, each once."""
    from terrain.experiments.evaluation.entrant import entrant

    names = [name for name in asked.beside if not _is_file(name)]
    chosen = list(protocol.entries) if ALL_SHIPPED in names else list(dict.fromkeys(names))
    own = [entrant(protocol, asked.settings, asked.backend, asked.name)] if asked.settings else []
    return [*own, *(protocol.entry(name) for name in chosen)]


def _is_file(name: str) -> bool:
    return name.endswith(".json")


def _reporter(console: Console) -> Callable[[dict[str, Any]], None]:
    from mbf_abstract.event_values import well_formed
    from terrain.commands.verdict_line import TERMINAL_COLOURS
    from terrain.recording.verdict import Level

    def report(row: dict[str, Any]) -> None:
        text = well_formed(f"{row['entry']}, {row['world']}, seed {row['seed']}: {row['verdict']}")
        style = TERMINAL_COLOURS[Level(row["level"])]
        console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)

    return report


def _about(head: dict[str, Any]) -> list[str]:
    protocol = head["protocol"]
    return [
        f"{protocol['about']} {protocol['trials']} worlds; protocol {protocol['version']}, hash {protocol['hash']}.",
        f"A success: {protocol['rules']['success']}. Rates are over the worlds that have a route by the judge. Ranked "
        "by successes, then by SPL (success weighted by path length); who did not drive all worlds has no rank.",
        f"Driven with: {head['command']} (mbf-flex {head['version']}).",
    ]
