"""Runs a scenario from start to last goal with ``move_base``, or another executive, and writes what happened.

In the folder: ``events.jsonl``, ``metrics.json``, ``recording.npz``, ``picture.png``, ``report.html``, ``replay.html``,
``run.mcap``, ``navigation.yaml``, ``versions.json`` and the world's map files. On simulated time the same scenario and
seed write the same ``events.jsonl``, byte for byte, and the same ``digest`` in ``metrics.json``, which covers poses and
commands too (see ``terrain.recording.run_digest``), on every CPU with the versions that ``versions.json`` names; how
long the run took on the wall stands in ``timing.json``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mbf_abstract.events import JsonLinesSink
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.time.clock import wall_seconds
from terrain.physics.incidents import IncidentKind
from terrain.recording.metrics import measure
from terrain.recording.recording import Recording
from terrain.recording.recording_parts import RecordingParts, has_parts
from terrain.recording.run_folder import clear_results
from terrain.recording.verdict import Verdict, judge
from terrain.recording.versions import write_versions
from terrain.recording.whole_files import write_whole
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.world import ScenarioWorld
from terrain.session.arrival import arrival_tolerance
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import NO_GOALS, GoalSequence
from terrain.session.session import Session
from terrain.viewer.live.options import ViewOptions
from terrain.worlds.geodesics import geodesic_length


@dataclass(frozen=True)
class Progress:
    """One line of news while a run goes on; times in seconds, distance in metres, tilt in radians."""

    time: float
    wall_time: float
    distance_left: float
    speed: float
    tilt: float
    state: str


@dataclass(frozen=True)
class RunResult:
    """What became of a run; ``metrics`` holds the contents of metrics.json and timing.json."""

    verdict: Verdict
    folder: Path
    metrics: dict[str, Any] = field(repr=False)

    @property
    def success(self) -> bool:
        """Whether the run has succeeded, see ``terrain.recording.verdict``."""
        return self.verdict.success


@dataclass(frozen=True)
class RunOptions:
    """How a scenario is run.

    Attributes
    ----------
    folder : Path
        Where results go.
    backend, seed : optional
        Instead of the scenario's own.
    wall_clock : bool
        Real time instead of lockstep simulated time.
    draw : bool
        Make picture and replay too.
    on_progress : callable
        Told about ten times a simulated second.
    on_step : callable
        Told the name of each step before and after the drive that may take a while.
    settings : mapping of str to str
        Changes of the navigation configuration, see ``terrain.scenarios.settings``.
    geodesic : bool
        Measure the shortest way over the ground too, which takes up to some seconds.
    executive : str
        Who decides on plans, drives and recoveries, a name of ``terrain.session.executives.EXECUTIVES``.
    view : ViewOptions, optional
        Serve a page on which the run can be watched and controlled.
    on_page : callable
        Told the address of that page.
    on_note : callable
        Told what the user must know: which package is missing to draw.
    """

    folder: Path
    backend: str | None = None
    seed: int | None = None
    wall_clock: bool = False
    draw: bool = True
    on_progress: Callable[[Progress], None] = lambda progress: None
    on_step: Callable[[str], None] = lambda text: None
    settings: Mapping[str, str] = field(default_factory=dict)
    geodesic: bool = False
    executive: str = "move_base"
    view: ViewOptions | None = None
    on_page: Callable[[str], None] = lambda address: None
    on_note: Callable[[str], None] = lambda text: None


def run_scenario(scenario: Scenario, options: RunOptions) -> RunResult:
    """Run a scenario to its end and write its results.

    Raises
    ------
    ConfigError
        The scenario has no configuration for the backend, or that configuration is wrong; all findings.
    """
    options.folder.mkdir(parents=True, exist_ok=True)
    clear_results(options.folder)
    write_versions(options.folder)
    log = JsonLinesSink(options.folder / "events.jsonl")
    session = Session(
        scenario,
        options.backend,
        options.seed,
        options.folder,
        options.wall_clock,
        (log,),
        options.on_step,
        options.settings,
    )
    parts = RecordingParts(
        options.folder, session.recorder, session.events, session.memory.events, lambda: session.loop.origin
    )  # fmt: skip
    session.loop.on_tick.append(parts.after_step)
    try:
        for note in session.navigator.server.notes:
            options.on_note(f"note: {note}")
        tour, wall_time = _drive(session, options)
    except BaseException:
        if has_parts(options.folder):
            options.on_note(f"the run was cut short; what happened until then: mbf replay {options.folder}")
        raise
    finally:
        session.close()
        parts.end()
    recording = session.recorder.finish(events=session.memory.events, began=session.loop.origin)
    metrics, result = _measure(recording, session, tour), tour.last_result or NO_GOALS
    if options.geodesic and result.success:
        metrics |= _compare_with_geodesic(recording, session.world)
    recording = replace(recording, verdict=judge(result, session.scenario.limits, metrics))
    metrics = _write_numbers(recording, metrics, wall_time, options.folder)
    parts.remove()
    if options.draw:
        _draw(recording, metrics, options)
    return RunResult(recording.verdict, options.folder, metrics)


def _drive(session: Session, options: RunOptions) -> tuple[GoalSequence, float]:
    """Visit the goals, watched or not; returns the finished tour and the wall time [s] it took."""
    tour = GoalSequence(session, make_executive(options.executive, session.navigator), stay=_stays(options))
    with _live_view(session, tour, options):
        started = wall_seconds()
        session.run(_ProgressReporter(session, options.on_progress, started).report)
        tour.visit_goals()
        if session.loop.failure is not None:
            raise session.loop.failure
        return tour, wall_seconds() - started


def _stays(options: RunOptions) -> bool:
    return options.view is not None and options.view.stay


def _live_view(session: Session, tour: GoalSequence, options: RunOptions) -> AbstractContextManager[object]:
    """Serve the page while the run goes on, if it is wanted; raises ViewerMissing where it cannot be served."""
    if options.view is None:
        return nullcontext()
    from terrain.viewer.live.session import LiveSession

    return LiveSession(session, tour, options.view, options.on_page, options.on_note)


class _ProgressReporter:
    """Makes a line of news from each sample of the robot."""

    def __init__(self, session: Session, tell: Callable[[Progress], None], started: float) -> None:
        self._server = session.navigator.server
        self._tell = tell
        self._started = started

    def report(self, time: float, pose: Pose, speed: float) -> None:
        """Tell how far the action at work is; what drives comes before what only plans."""
        server = self._server
        at_work = [action.name for action in (server.exe_path, server.recovery, server.get_path) if action.busy]
        driving = server.exe_path.unfinished
        feedback = driving[0].feedback if driving else None
        self._tell(
            Progress(
                time=time,
                wall_time=wall_seconds() - self._started,
                distance_left=feedback.distance_along_path if feedback else float("nan"),
                speed=speed,
                tilt=tilt_of(pose),
                state=at_work[0] if at_work else "waiting",
            )
        )


def _measure(recording: Recording, session: Session, tour: GoalSequence) -> dict[str, Any]:
    """Return the numbers of a run: those of its recording, and those that only its simulation knows."""
    metrics = measure(recording).to_json()
    metrics["incidents"] = sorted({incident.kind.value for incident in session.simulation.incidents})
    counts = session.simulation.monitor.counts
    metrics["collisions"] = counts[IncidentKind.COLLISION]
    metrics["collisions_while_moving"] = counts[IncidentKind.COLLISION_WHILE_MOVING]
    metrics["arrivals"] = [arrival.to_json() for arrival in tour.arrivals]
    metrics["arrival_tolerance"] = arrival_tolerance(
        session.scenario.limits, session.scenario.localization, session.navigator.server.runtime.parameters
    )
    metrics["tip_overs"] = counts[IncidentKind.TIPPED_OVER]
    metrics["energy_j"] = round(session.simulation.monitor.energy, 3)
    metrics["slipped_m"] = round(session.simulation.monitor.slipped, 6)
    metrics["seed"], metrics["digest"] = session.seed, session.digest.hexdigest()
    return metrics


def _write_numbers(recording: Recording, measured: Mapping[str, Any], wall_time: float, folder: Path) -> dict[str, Any]:
    """Write metrics.json, timing.json and the recording; returns what stands in the first two."""
    metrics = {**measured, **recording.verdict.to_json()}
    factor = recording.duration / wall_time if wall_time > 0.0 else 0.0
    timing = {"wall_time_s": round(wall_time, 3), "real_time_factor": round(factor, 2)}
    for name, numbers in (("metrics.json", metrics), ("timing.json", timing)):
        write_whole(folder / name, json.dumps(numbers, indent=2, sort_keys=True) + "\n")
    recording.save(folder / "recording.npz")
    return {**metrics, **timing}


def _compare_with_geodesic(recording: Recording, world: ScenarioWorld) -> dict[str, float]:
    """Return the shortest way over all goals to where the robot stopped, and how many times as far it drove."""
    goals = [goal.position for goal in recording.goals[:-1]]
    stops = [recording.start.position, *goals, tuple(recording.poses[-1, :3].tolist())]
    shortest = geodesic_length(world.open_surface(), stops)
    if not 0.0 < shortest < float("inf"):
        return {}
    driven = measure(recording).path_length_m
    return {"geodesic_m": round(shortest, 6), "path_over_geodesic": round(driven / shortest, 6)}


def _draw(recording: Recording, metrics: dict[str, Any], options: RunOptions) -> None:
    """Make everything that is looked at; what cannot be made is told, and the run still counts."""
    from terrain.viewer.results import write_results

    for problem in write_results(options.folder, recording, metrics, options.on_step):
        options.on_note(problem)
