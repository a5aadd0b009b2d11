"""The command ``mbf rerun``."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mbf_abstract.commands.reporting import FAILURE, readable_errors
from terrain.commands.command_line import command_line
from terrain.commands.new_run import RUNS, new_run_folder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from terrain.provenance.differences import Change
    from terrain.provenance.rerun import Repetition

SHOWN = 24  # characters of a value in the table


def rerun(
    context: typer.Context,
    folder: Path = typer.Argument(..., help="Folder of a run, e.g. runs/2030-01-02_03-04-05."),
    out: Path | None = typer.Option(None, "--out", help="Folder for the repetition; runs/<time> if not given."),
    quiet: bool = typer.Option(False, "--quiet", help="Print the result without progress."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object with all differences."),
) -> None:
    """Repeat a run from its folder alone and compare; exit code 0 only if it is the same drive, bit for bit.

    Differences of results, versions, code and files are listed. The repetition has no pictures: mbf replay makes them.
    """
    with readable_errors():
        from terrain.commands.live_line import LiveLine
        from terrain.provenance.rerun import rerun as repeat
        from terrain.session.runner import RunOptions

        target = out or new_run_folder(RUNS, datetime.now())
        with LiveLine(show=not (quiet or as_json)) as live:
            options = RunOptions(
                folder=target,
                command=command_line(context),
                on_progress=live.progress,
                on_step=live.step,
                on_note=live.note,
            )
            repetition = repeat(folder, options)
    if as_json:
        typer.echo(json.dumps(_to_json(repetition)))
    else:
        _print(repetition)
    if not repetition.differences.same_drive:
        raise typer.Exit(FAILURE)


def _to_json(repetition: Repetition) -> dict[str, object]:
    return {
        "folder": str(repetition.result.folder),
        "changed_files": list(repetition.changed_files),
        **asdict(repetition.differences),
    }


def _print(repetition: Repetition) -> None:
    from terrain.commands.verdict_line import print_verdict

    differences, provenance = repetition.differences, repetition.provenance
    print_verdict(repetition.result.verdict)
    if differences.same_drive:
        typer.secho("the same drive: poses, commands and events are equal, bit for bit", fg="green")
    else:
        typer.secho(f"another drive: {differences.parting}", fg="red")
        if provenance.live_page:
            typer.echo("the earlier run had a live page, whose commands are not recorded")
    for name in repetition.changed_files:
        typer.echo(f"changed or missing in the folder: {name}")
    _print_changes("other results", differences.results)
    _print_changes("made with", differences.surroundings)
    typer.echo(f"the repetition is in {repetition.result.folder}")


def _print_changes(title: str, changes: Sequence[Change]) -> None:
    if not changes:
        return
    typer.echo(f"{title}:")
    for change in changes:
        typer.echo(f"  {change.name}: {_short(change.before)} -> {_short(change.now)}")


def _short(text: str) -> str:
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."
