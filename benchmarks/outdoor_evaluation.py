"""The outdoor evaluation on ground that nothing was chosen on, with replays of failures and a picture of difficulty.

    python benchmarks/outdoor_evaluation.py [--quick] [--json] [--workers 2] [--data ../shared/data]
        [--fresh 3] [--first-seed 5000] [--entries any_angle,cvp] [--fallback heading_astar]
        [--results DIR] [--replays DIR] [--report DIR]

``mbf bench outdoor`` is the evaluation itself; this adds the straight line, ``--fresh`` seeds and surveys, of which
three belong to no other evaluation, ``--fallback`` as in the shipped configurations, and for each entry and class of
failure a replay. Finished runs stand in the folder of results and are never run again. What has been looked at is not
fresh any more: take a later ``--first-seed``.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from mbf_abstract.time.program_end import interruptible
from terrain.experiments.evaluation.leaderboard import standings, terminal_table
from terrain.experiments.evaluation.outdoor import LEVELS, SURVEYS, generated, outdoor, real
from terrain.experiments.evaluation.protocol import Entry, Protocol, Trial
from terrain.experiments.evaluation.trials import FAILURES, run_trials
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.results import write_results

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))  # for workers, too

FRESH_SURVEYS = {  # nothing was ever chosen on these
    "tidal_2m.npz": 0.5 / 2.0,
    "gale_aeolis_mount_sharp_aeolis_palus_center.npz": 0.5 / 2.0,
    "jezero_neretva_neretva_center.npz": 0.5 / 2.0,
}
STRAIGHT = Entry("straight_line", "mesh", {"planner": "straight_planner:StraightPlanner"})
TIME_LIMIT = 1800.0  # s, wall time of a run

Row = dict[str, Any]


def fresh(data: Path, first_seed: int, seeds: int) -> Protocol:
    """Every level and every survey there is with so many seeds."""
    scales = SURVEYS | FRESH_SURVEYS
    places = [(data / "terrain" / folder / name).resolve() for name in scales for folder in ("dem", "mars")]
    files = [file for file in places if file.is_file()]
    trials = []
    for seed in range(first_seed, first_seed + seeds):
        trials += [Trial(generated(level), seed) for level in range(LEVELS)]
        trials += [Trial(real(file, seed, scales[file.name]), seed) for file in files]
    return replace(outdoor([0]), name="outdoor fresh", trials=trials)


def with_fallback(entry: Entry, planner: str) -> Entry:
    """The entry with a planner to ask where its own finds no path; entries without a mesh have none."""
    if entry.backend != "mesh" or entry is STRAIGHT:
        return entry
    return replace(entry, settings=dict(entry.settings) | {"fallback_planner": planner})


def keep_replays(protocol: Protocol, entries: list[Entry], rows: list[Row], folder: Path) -> None:
    """Drive the first run of each entry's classes of failure again and keep everything to look at."""
    trials = {(trial.scenario.name, trial.seed): trial for trial in protocol.trials}
    known = {entry.name: entry for entry in entries}
    jobs: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row["failure"] and row["route"]:
            jobs.setdefault((row["entry"], row["failure"]), row)
    for (name, failure), row in jobs.items():
        trial, entry = trials[row["world"], row["seed"]], known[name]
        options = RunOptions(
            folder / f"{name}_{failure}",
            entry.backend,
            trial.seed,
            settings=entry.settings,
            write_views=write_results,
        )
        run_scenario(trial.scenario, options)


def by_world(rows: list[Row]) -> list[Row]:
    """Count for every entry and level or survey: terrains with a route, arrivals, tip-overs, failures by class."""
    table = []
    for entry in dict.fromkeys(row["entry"] for row in rows):
        for world in dict.fromkeys(row["world"] for row in rows):
            here = [row for row in rows if (row["entry"], row["world"]) == (entry, world) and row["route"]]
            failures = Counter(row["failure"] for row in here)
            line = {"method": entry, "terrain": world, "with_route": len(here), "arrived": failures.pop("", 0)}
            line["tipped_over"] = sum("tipped_over" in (row["incidents"] or ()) for row in here)
            table.append({**line, **{name: failures[name] for name in FAILURES}})
    return table


def report(rows: list[Row], folder: Path) -> None:
    """Write the counts as a table, and success over difficulty as a picture with one line per entry."""
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    table = by_world(rows)
    with (folder / "outdoor_evaluation.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for number, entry in enumerate(dict.fromkeys(line["method"] for line in table)):
        lines = [line for line in table if line["method"] == entry and line["with_route"]]
        share = [100.0 * line["arrived"] / line["with_route"] for line in lines]
        style = ("-", "--", ":", "-.")[number % 4]  # lines that lie upon each other show through
        axes.plot([line["terrain"] for line in lines], share, style, lw=2.5 - 0.2 * number, marker="o", label=entry)
    axes.set(ylabel="arrived [%], where a route exists", ylim=(-3, 103))
    axes.tick_params(axis="x", rotation=60)
    axes.legend()
    figure.savefig(folder / "outdoor_evaluation.png", dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one world of every level")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--fresh", type=int, default=3, help="seeds of every level and survey")
    parser.add_argument("--first-seed", type=int, default=5000, help="parameters were chosen on seeds from 1000")
    parser.add_argument("--entries", default="", help="comma separated; all and the straight line if not given")
    parser.add_argument("--fallback", default="", help="planner that the entries on the mesh fall back to")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--results", type=Path, help="folder of finished runs, added to")
    parser.add_argument("--replays", type=Path, help="folder for one replay of each class of failure")
    parser.add_argument("--report", type=Path, help="folder for a table and a picture of success over difficulty")
    arguments = parser.parse_args()
    protocol = outdoor([0]) if arguments.quick else fresh(arguments.data, arguments.first_seed, arguments.fresh)
    known = {**protocol.entries, STRAIGHT.name: STRAIGHT}
    entries = [known[name] for name in (arguments.entries.split(",") if arguments.entries else known)]
    if arguments.fallback:
        entries = [with_fallback(entry, arguments.fallback) for entry in entries]
    with tempfile.TemporaryDirectory() as folder:
        rows = run_trials(protocol, entries, arguments.results or Path(folder), arguments.workers, TIME_LIMIT)
    lines = standings(rows, len(protocol.trials))
    Console().print(terminal_table(lines, protocol.name))
    if arguments.replays:
        keep_replays(protocol, entries, rows, arguments.replays)
    if arguments.report:
        report(rows, arguments.report)
    if arguments.json:
        print(json.dumps({"standings": [vars(line) for line in lines]}))


if __name__ == "__main__":
    with interruptible():
        main()
