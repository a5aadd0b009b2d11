"""``mbf bench all``: one entry through every evaluation, and a page above their leaderboards."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from dataclasses import replace

import typer
from rich.console import Console

from mbf_abstract.whole_files import write_whole
from terrain.commands.counted import counted
from terrain.experiments.evaluation.bench import Asked, Judged, drive, entries_of, show
from terrain.experiments.evaluation.leaderboard import page_line
from terrain.experiments.evaluation.protocol import Protocol
from terrain.sweeps.html_tables import html_page, html_table

SHOWN = ("", "rank", "entry", "arrived", "SPL", "time [s]", "contacts", "failures")


def bench_all(protocols: Sequence[Protocol], asked: Asked) -> None:
    """Drive all sets, each in a folder of its title below that of the results; nothing where one refuses the entry."""
    console = Console(stderr=asked.as_json)
    entries = [entries_of(protocol, asked) for protocol in protocols]
    sets = [
        drive(protocol, own, replace(asked, out=asked.out / protocol.title.replace(" ", "_")), console)
        for protocol, own in zip(protocols, entries, strict=True)
    ]
    write_whole(asked.out / "leaderboard.html", overview(sets, asked.command))
    if asked.as_json:
        typer.echo(json.dumps([judged.to_json() for judged in sets]))
        return
    for judged in sets:
        show(judged, console)
    console.print(f"all of them: {asked.out / 'leaderboard.html'}", markup=False, soft_wrap=True)


def overview(sets: Sequence[Judged], command: str) -> str:
    """The page: a short table for every set, with the user's line marked, and a link to its leaderboard."""
    parts = [f"<p>Driven with: {html.escape(command)}.</p>"]
    for judged in sets:
        link = f'<a href="{judged.out.name}/leaderboard.html">{html.escape(judged.title)}</a>'
        text = f"{counted(len(judged.protocol.trials), 'world')}, protocol hash {judged.protocol.hash}"
        parts += [f"<h2>{link}</h2><p>{html.escape(text)}</p>", html_table(_lines(judged))]
    return html_page("mbf bench all", parts)


def _lines(judged: Judged) -> list[dict[str, object]]:
    whole = [page_line(line, line.entry in judged.own, {"contacts": "contacts"}) for line in judged.lines]
    return [{name: line[name] for name in SHOWN} for line in whole]
