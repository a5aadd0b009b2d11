"""The command ``mbf replay``."""

from __future__ import annotations

from pathlib import Path

import typer

from mbf_abstract.commands.reporting import readable_errors


def replay(
    folder: Path = typer.Argument(..., help="Folder of a run, e.g. runs/2030-01-02_03-04-05."),
    show: bool = typer.Option(True, "--open/--no-open", help="Open the page in the browser."),
    rrd: bool = typer.Option(False, "--rrd", help="Write run.rrd for Rerun too; needs the extra rerun."),
    gif: bool = typer.Option(False, "--gif", help="Write animation.gif too, for where no script may run."),
    mp4: bool = typer.Option(False, "--mp4", help="Write film.mp4 too, in full colour; needs the extra video."),
) -> None:
    """Write picture, report, replay and MCAP log of a run, also of one that was killed, and open the replay."""
    with readable_errors():
        from terrain.commands.live_line import LiveLine
        from terrain.recording.fleet_metrics import judge_together
        from terrain.recording.run_folder import read_run, robots_of
        from terrain.viewer.logs.rerun_log import write_rrd
        from terrain.viewer.pictures.animation import write_animation
        from terrain.viewer.pictures.film import write_film
        from terrain.viewer.results import write_joint_results, write_results

        recordings = {}
        with LiveLine() as live:
            problems = []
            for name in robots_of(folder):
                own = folder / name
                recordings[name], metrics = read_run(own)
                problems += write_results(own, recordings[name], metrics, live.step)
                if rrd:
                    live.step("writing the recording for Rerun")
                    write_rrd(own / "run.rrd", recordings[name])
                if gif:
                    live.step("writing the animation")
                    write_animation(own / "animation.gif", recordings[name])
                if mp4:
                    live.step("writing the film")
                    write_film(own / "film.mp4", recordings[name])
            if "" not in recordings:
                verdict = judge_together({name: recording.verdict for name, recording in recordings.items()})
                problems += write_joint_results(folder, recordings, verdict, live.step)
            if problems:
                raise RuntimeError("; ".join(dict.fromkeys(problems)))
    typer.echo((folder / "replay.html").resolve())
    if show:
        open_replay(folder)


def open_replay(folder: Path) -> None:
    """Open the replay of a run in the browser, if there is one."""
    page = replay_page(folder)
    if page is not None:
        typer.launch(page.as_uri())


def replay_page(folder: Path) -> Path | None:
    """Return the absolute path of the replay of a run, if there is one."""
    page = (folder / "replay.html").resolve()
    return page if page.is_file() else None
