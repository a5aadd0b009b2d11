"""Everything that is made of a ``DriveLog``: pictures of its map over time, a log for Foxglove, and a short report."""

from __future__ import annotations

from html import escape
from pathlib import Path

from mbf_abstract.drive_log import DriveLog, LogReport
from mbf_abstract.event_values import error_text
from mbf_abstract.whole_files import write_whole
from terrain.recording.drive_logs import recording_of
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.pictures.plan_picture import map_png
from terrain.viewer.reports.page import image, page, table

PICTURES = "map_*.png"


def write_log_views(folder: Path, log: DriveLog, report: LogReport) -> list[str]:
    """Write map_<seconds>s.png for each map, run.mcap and report.html; older pictures in the folder are removed.

    Returns
    -------
    problems : list of str
        Why some could not be made. What can be made is made.
    """
    problems: list[str] = []
    for old in folder.glob(PICTURES):
        old.unlink()
    pictures: list[tuple[str, bytes]] = []
    try:
        pictures = [(f"map_{time:07.1f}s.png", map_png(log, time, view)) for time, view in log.maps]
    except ViewerMissing as missing:
        problems.append(str(missing))
    for name, png in pictures:
        write_whole(folder / name, png)
    write_whole(folder / "report.html", _report_html(log, report, pictures))
    try:
        from terrain.viewer.logs.mcap_log import write_mcap

        write_mcap(folder / "run.mcap", recording_of(log))
    except ImportError as error:
        text = error_text(error)
        problems.append(f"run.mcap needs mcap and its schemas: pip install 'mbf-flex[sim]' ({text})")
    return problems


def _report_html(log: DriveLog, report: LogReport, pictures: list[tuple[str, bytes]]) -> str:
    title = f"{log.name} on {log.backend}"
    parts = [f"<h1>{escape(title)}</h1>", f"<p>{escape(report.result)}</p>"]
    parts += [f"<p>{escape(note)}</p>" for note in report.notes]
    parts += [f"<p>{image(name, png)}</p>" for name, png in pictures[-1:]]
    parts += [f"<h2>{escape(one.title)}</h2>" + table(one.header, one.rows) for one in report.tables]
    if pictures[:-1]:
        parts += ["<h2>The map over time</h2>", *(f"<p>{image(name, png)}</p>" for name, png in pictures[:-1])]
    return page(title, parts)
