"""All views of a run, made from its recording: picture, report, replay and log for Foxglove."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.time.program_end import is_for_the_program
from mbf_abstract.whole_files import write_whole
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.pictures.run_picture import joint_picture_png, picture_png
from terrain.viewer.replay.replay_page import joint_replay_html, replay_html
from terrain.viewer.reports.report import report_html

Makers = list[tuple[str, str, Callable[[Path], None]]]  # what is done, the name of the file, what makes it


def write_results(
    folder: Path, recording: Recording, metrics: Mapping[str, Any], on_step: Callable[[str], None] = lambda text: None
) -> list[str]:
    """Write picture.png, report.html, replay.html and run.mcap, each whole or not at all.

    Returns
    -------
    problems : list of str
        Why some could not be made: a package is missing, the disk is full, or one of them has a defect. What can be
        made is made.
    """
    drawn: list[bytes] = []

    def draw(file: Path) -> None:
        drawn.append(picture_png(recording))  # the report shows it too
        write_whole(file, drawn[0])

    drawings: Makers = [
        ("drawing the picture", "picture.png", draw),
        ("writing the report", "report.html", lambda file: write_whole(file, report_html(recording, metrics, *drawn))),
    ]
    logs: Makers = [
        ("writing the replay", "replay.html", lambda file: write_whole(file, replay_html(recording))),
        ("writing the log for Foxglove", "run.mcap", lambda file: _write_log(file, recording)),
    ]
    with ThreadPoolExecutor(1) as beside:  # most of it is compression, for which two threads use two cores
        problems_beside = beside.submit(_make_all, folder, logs)
        problems = _make_all(folder, drawings, on_step)
        on_step("writing the replay and the log for Foxglove")
        return list(dict.fromkeys([*problems, *problems_beside.result()]))


def write_joint_results(
    folder: Path,
    recordings: Mapping[str, Recording],
    verdict: Verdict,
    on_step: Callable[[str], None] = lambda text: None,
) -> list[str]:
    """Write picture.png and replay.html of several robots together; as ``write_results``."""
    run = JointRecording(recordings, verdict)
    makers: Makers = [
        ("drawing all robots", "picture.png", lambda file: write_whole(file, joint_picture_png(run))),
        ("writing their replay", "replay.html", lambda file: write_whole(file, joint_replay_html(run))),
    ]
    return _make_all(folder, makers, on_step)


def _make_all(folder: Path, makers: Makers, on_step: Callable[[str], None] = lambda text: None) -> list[str]:
    problems: list[str] = []
    for step, name, make in makers:
        on_step(step)
        try:
            make(folder / name)
        except ViewerMissing as missing:
            problems.append(str(missing))
        except Exception as error:  # a run counts whatever becomes of its pictures
            if is_for_the_program(error):
                raise
            problems.append(f"{name} could not be made: {type(error).__name__}: {error_text(error)}")
    return list(dict.fromkeys(problems))


def _write_log(file: Path, recording: Recording) -> None:
    try:
        from terrain.viewer.logs.mcap_log import write_mcap
    except ImportError as error:
        raise ViewerMissing(f"run.mcap needs mcap and its schemas: pip install 'mbf-flex[sim]' ({error})") from error
    write_mcap(file, recording)
