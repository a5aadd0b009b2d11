"""The command ``mbf compare``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer

from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.commands.waiting import waiting

ABREAST = 3  # runs in one table, so that it fits 80 columns


def compare(
    folders: list[Path] = typer.Argument(..., metavar="DIR DIR...", help="Folders of two or more runs."),
    out: Path = typer.Option(Path("compare.html"), "--out", help="The page to write."),
) -> None:
    """Compare runs: a table of their metrics in the terminal, and one page with everything."""
    if len(folders) < 2:
        raise typer.BadParameter(f"expected two or more folders, got {len(folders)}", param_hint="DIR DIR...")
    with readable_errors():
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from mbf_abstract.whole_files import write_whole
        from terrain.commands.verdict_line import print_verdict
        from terrain.recording.run_folder import read_run
        from terrain.viewer.reports.comparison import compare_digests, compare_metrics, comparison_html, metrics_header

        for folder in folders:
            refuse_folder_of_runs(folder)
        runs, names = [read_run(folder) for folder in folders], names_of(folders)
        for name, (recording, _) in zip(names, runs, strict=True):
            print_verdict(recording.verdict, f"{name}: ")
        metrics = [run[1] for run in runs]
        for first in range(0, len(runs), ABREAST):
            some = slice(first, first + ABREAST)
            table = Table()
            for title in metrics_header(names[some]):
                table.add_column(escape(title), overflow="fold")
            for row in compare_metrics(metrics[some]):
                table.add_row(*map(escape, row))
            Console().print(table)
        typer.echo(compare_digests(names, metrics))
        with waiting("writing the page"):
            write_whole(out, comparison_html(names, runs))
    typer.echo(out.resolve())


def refuse_folder_of_runs(folder: Path) -> None:
    """Raise RecordingError for a folder that is no run and holds some, such as that of a variant or of a sweep."""
    from terrain.recording.recording import RecordingError
    from terrain.recording.run_folder import is_run

    if is_run(folder) or not folder.is_dir():
        return
    seeds = sorted(inner for inner in folder.glob("**/seed_*") if is_run(inner))
    if runs := seeds or [inner for inner in sorted(folder.iterdir()) if is_run(inner)]:
        raise RecordingError(
            f"{folder}: expected the folder of a run, got one that holds {len(runs)}; "
            f"name single ones, such as {runs[0]}"
            + (". All seeds of a sweep are compared in its sweep.html and tests.csv" if seeds else "")
        )


def names_of(folders: Sequence[Path]) -> list[str]:
    """Return the folders' names, or where two have the same, their paths without what all begin and end with."""
    names = [folder.name for folder in folders]
    if len(set(names)) == len(names):
        return names
    paths = [list(folder.resolve().parts) for folder in folders]
    while len({path[0] for path in paths}) == 1 and min(map(len, paths)) > 1:
        paths = [path[1:] for path in paths]
    while len({path[-1] for path in paths}) == 1 and min(map(len, paths)) > 1:
        paths = [path[:-1] for path in paths]
    return ["/".join(path) for path in paths]
