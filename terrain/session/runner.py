"""Runs a scenario from start to last goal with ``move_base``, or another executive, and writes what happened.

In the folder: ``events.jsonl``, ``metrics.json``, ``recording.npz``, all that repeats the run (``scenario.yaml``,
``navigation.yaml``, ``inputs``, see ``terrain.provenance``), ``provenance.yaml`` and the world's map files; the caller
may add views of them, see ``RunOptions``. On simulated time the same scenario and seed write the same
``events.jsonl``, byte for byte, and the same ``digest`` in ``metrics.json``, which covers poses and commands too (see
``terrain.recording.run_digest``), on every CPU with the versions that ``provenance.yaml`` names. The wall time of the
run is in ``timing.json``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from mbf_abstract.events import JsonLinesSink
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.time.clock import wall_seconds
from terrain.physics.incidents import IncidentKind
from terrain.provenance.provenance import write_provenance, write_scenario
from terrain.recording.metrics import measure
from terrain.recording.planning_times import PlanningTimes
from terrain.recording.recording import Recording
from terrain.recording.run_folder import RecordingParts, clear_results, has_parts
from terrain.recording.verdict import Verdict, judge
from terrain.recording.whole_files import write_whole
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.settings import apply_world_settings
from terrain.scenarios.world import ScenarioWorld
from terrain.session.arrival import arrival_tolerance
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import NO_GOALS, GoalSequence
from terrain.session.session import Session, SessionOptions
from terrain.worlds.geodesics import geodesic_length

Metrics = dict[str, Any]
Watch = Callable[[Session, GoalSequence], AbstractContextManager[object]]
WriteViews = Callable[[Path, Recording, Metrics], Sequence[str]]


@dataclass(frozen=True)
class Progress:
    """State of a run in progress; times in seconds, distance in metres, tilt in radians."""

    time: float
    wall_time: float
    distance_left: float
    speed: float
    tilt: float
    state: str


@dataclass(frozen=True)
class RunResult:
    """Result of a run; ``metrics`` holds the contents of metrics.json and timing.json."""

    verdict: Verdict
    folder: Path
    metrics: dict[str, Any] = field(repr=False)

    @property
    def success(self) -> bool:
        """Whether the run has succeeded, see ``terrain.recording.verdict``."""
        return self.verdict.success


@dataclass(frozen=True)
class RunOptions(SessionOptions):
    """How a scenario is run; results go to ``folder``.

    Attributes
    ----------
    command : str
        The command line that asked for the run, as it is recorded; empty for a run of a script.
    executive : str
        Who decides on plans, drives and recoveries, a name of ``terrain.session.executives.EXECUTIVES``.
    geodesic : bool
        Measure the shortest path over the ground too, which takes up to some seconds.
    stay : bool
        Wait for further goals after those of the scenario, see ``GoalSequence.go_to``.
    watch : callable
        Returns a context manager for a session and its goals, in which the run takes place, e.g. to serve a page.
    write_views : callable
        Writes views (pictures, pages) from the folder, the recording and the metrics; returns problems.
    on_progress : callable
        Called about ten times a simulated second.
    on_note : callable
        Called with what the user must know, such as a package that is missing to draw.
    """

    folder: Path
    command: str = ""
    executive: str = "move_base"
    geodesic: bool = False
    stay: bool = False
    watch: Watch = lambda session, goals: nullcontext()
    write_views: WriteViews = lambda folder, recording, metrics: ()
    on_progress: Callable[[Progress], None] = lambda progress: None
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
    log = JsonLinesSink(options.folder / "events.jsonl")
    planning = PlanningTimes()
    session = Session(scenario, replace(options, sinks=(*options.sinks, log, planning)))
    parts = RecordingParts(
        options.folder, session.recorder, session.events, session.memory.events, lambda: session.loop.origin
    )  # fmt: skip
    session.loop.on_tick.append(parts.after_step)
    try:
        _record_provenance(scenario, session, options)
        for note in session.navigator.server.notes:
            options.on_note(f"note: {note}")
        sequence, wall_time = _drive(session, options)
    except BaseException:
        if has_parts(options.folder):
            options.on_note(f"the run was cut short; what happened until then: mbf replay {options.folder}")
        raise
    finally:
        session.close()
        parts.end()
    recording = session.recorder.finish(events=session.memory.events, began=session.loop.origin)
    metrics, result = _measure(recording, session, sequence), sequence.last_result or NO_GOALS
    if options.geodesic and result.success:
        metrics |= _compare_with_geodesic(recording, session.world, metrics["path_length_m"])
    recording = replace(recording, verdict=judge(result, session.scenario.limits, metrics))
    if options.geodesic:
        metrics["spl"] = success_by_path_length(recording.verdict.success, metrics)
    factor = recording.duration / wall_time if wall_time > 0.0 else 0.0
    timing = {"wall_time_s": round(wall_time, 3), "real_time_factor": round(factor, 2), **planning.to_json()}
    metrics = _write_numbers(recording, metrics, timing, options.folder)
    parts.remove()
    for problem in options.write_views(options.folder, recording, metrics):
        options.on_note(problem)
    return RunResult(recording.verdict, options.folder, metrics)


def _record_provenance(scenario: Scenario, session: Session, options: RunOptions) -> None:
    """Write what the run is made of; of a run that is killed, too."""
    as_asked, _ = apply_world_settings(scenario, options.settings)  # without the noise that the session has added
    write_scenario(options.folder, as_asked, session.backend, session.seed, session.inputs)
    server, is_watched = session.navigator.server, options.watch is not RunOptions.watch
    write_provenance(options.folder, server, options.command, options.executive, options.wall_clock, is_watched)


def _drive(session: Session, options: RunOptions) -> tuple[GoalSequence, float]:
    """Visit the goals, watched or not; returns the finished sequence and the wall time [s] it took."""
    sequence = GoalSequence(session, make_executive(options.executive, session.navigator), options.stay)
    with options.watch(session, sequence):
        started = wall_seconds()
        session.loop.on_sample.append(partial(_report_progress, session, options.on_progress, started))
        session.run()
        sequence.visit_goals()
        if session.loop.failure is not None:
            raise session.loop.failure
        return sequence, wall_seconds() - started


def _report_progress(
    session: Session, on_progress: Callable[[Progress], None], started: float, time: float, pose: Pose, velocity: Twist
) -> None:
    """Report how far the running action is; an action that drives comes before one that only plans."""
    server = session.navigator.server
    at_work = [action.name for action in (server.exe_path, server.recovery, server.get_path) if action.busy]
    driving = server.exe_path.unfinished
    feedback = driving[0].feedback if driving else None
    on_progress(
        Progress(
            time=time,
            wall_time=wall_seconds() - started,
            distance_left=feedback.distance_along_path if feedback else float("nan"),
            speed=velocity.speed,
            tilt=tilt_of(pose),
            state=at_work[0] if at_work else "waiting",
        )
    )


def _measure(recording: Recording, session: Session, sequence: GoalSequence) -> Metrics:
    """Return the numbers of a run: those of its recording, and those that only its simulation knows."""
    metrics = measure(recording).to_json()
    metrics["incidents"] = sorted({incident.kind.value for incident in session.simulation.incidents})
    counts = session.simulation.monitor.counts
    metrics["collisions"] = counts[IncidentKind.COLLISION]
    metrics["collisions_while_moving"] = counts[IncidentKind.COLLISION_WHILE_MOVING]
    metrics["arrivals"] = [arrival.to_json() for arrival in sequence.arrivals]
    metrics["arrival_tolerance"] = arrival_tolerance(
        session.scenario.limits, session.scenario.localization, session.navigator.server.runtime.parameters
    )
    metrics["tip_overs"] = counts[IncidentKind.TIPPED_OVER]
    metrics["near_misses"] = counts[IncidentKind.NEAR_MISS]
    metrics["energy_j"] = round(session.simulation.monitor.energy, 3)
    metrics["slipped_m"] = round(session.simulation.monitor.slipped, 6)
    metrics["seed"], metrics["digest"] = session.seed, session.digest.hexdigest()
    return metrics


def _write_numbers(
    recording: Recording, measured: Mapping[str, Any], timing: Mapping[str, Any], folder: Path
) -> Metrics:
    """Write metrics.json, timing.json and the recording; returns the contents of the first two."""
    metrics = {**measured, **recording.verdict.to_json()}
    for name, numbers in (("metrics.json", metrics), ("timing.json", timing)):
        write_whole(folder / name, json.dumps(numbers, indent=2, sort_keys=True) + "\n")
    recording.save(folder / "recording.npz")
    return {**metrics, **timing}


def success_by_path_length(success: bool, metrics: Mapping[str, Any]) -> float | None:
    """Success weighted by path length (SPL): the shortest path by the longer of it and the track; 0 for no success.

    Anderson et al., On Evaluation of Embodied Navigation Agents, 2018. None where the shortest path is not known.
    """
    if not success:
        return 0.0
    shortest = metrics.get("geodesic_m")
    return None if shortest is None else round(shortest / max(shortest, metrics["path_length_m"]), 6)


def _compare_with_geodesic(recording: Recording, world: ScenarioWorld, driven: float) -> dict[str, float]:
    """Return the shortest path over all goals to where the robot stopped, and the ratio of the driven path to it."""
    goals = [goal.position for goal in recording.goals[:-1]]
    stops = [recording.start.position, *goals, tuple(recording.poses[-1, :3].tolist())]
    shortest = geodesic_length(world.open_surface(), stops)
    if not 0.0 < shortest < float("inf"):
        return {}
    return {"geodesic_m": round(shortest, 6), "path_over_geodesic": round(driven / shortest, 6)}
