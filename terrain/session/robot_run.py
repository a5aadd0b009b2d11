"""One robot's part of a run: its logs, its goals, its metrics and its results on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

from mbf_abstract.event_sinks import JsonLinesSink
from mbf_abstract.events import EventSink
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.time.clock import wall_seconds
from mbf_abstract.whole_files import write_whole
from terrain.physics.incidents import IncidentKind
from terrain.provenance.named_files import InputCopies
from terrain.provenance.provenance import write_provenance, write_scenario
from terrain.recording.metrics import measure
from terrain.recording.planning_times import PlanningTimes
from terrain.recording.recording import Recording
from terrain.recording.run_folder import RecordingParts, clear_results, has_parts
from terrain.recording.verdict import judge
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.settings import apply_world_settings
from terrain.scenarios.world import ScenarioWorld
from terrain.session.arrival import Arrival, arrival_tolerance
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import NO_GOALS, GoalSequence
from terrain.session.robot_fit import notes_on_fit
from terrain.session.run_options import Metrics, Progress, RunOptions, RunResult
from terrain.session.session import Session
from terrain.worlds.geodesics import geodesic_length


class RunLogs:
    """The sinks of a robot's events that a run needs, made before its session; what an earlier run left is removed."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        clear_results(folder)
        self.planning = PlanningTimes()
        self.sinks: tuple[EventSink, ...] = (JsonLinesSink(folder / "events.jsonl"), self.planning)

    def close(self) -> None:
        """Close the sinks, also those that no session has taken; idempotent."""
        for sink in self.sinks:
            sink.close()


class RobotRun:
    """The goals of one robot and what comes of them.

    Parameters
    ----------
    session : Session
        Built with the sinks of ``logs``, not running yet.

    Attributes
    ----------
    sequence : GoalSequence
    wall_time : float
        That it took [s], once all goals were visited.
    measured : dict
        The contents of ``metrics.json``, once the run is finished.
    """

    def __init__(self, session: Session, options: RunOptions, logs: RunLogs) -> None:
        self._session = session
        self._options = options
        self._planning = logs.planning
        self._started = self.wall_time = 0.0
        self.measured: Metrics = {}
        self._parts = RecordingParts(
            session.folder, session.recorder, session.events, session.memory.events, lambda: session.loop.origin
        )  # fmt: skip
        session.loop.on_tick.append(self._parts.after_step)
        session.loop.on_sample.append(self._report_progress)
        server = session.navigator.server
        for note in (*server.notes, *notes_on_fit(server, session.scenario.robot)):
            options.on_note(f"note: {note}")
        make = options.outside or (lambda one: make_executive(options.executive, one.navigator))
        self.sequence = GoalSequence(session, make(session), options.stay)

    def begin(self) -> None:
        """Let the wall time count; called before time passes."""
        self._started = wall_seconds()

    def visit_goals(self) -> None:
        """Visit the goals; time is passing. Raises what made the simulation fail."""
        self.sequence.visit_goals()
        if self._session.loop.failure is not None:
            raise self._session.loop.failure
        self.wall_time = wall_seconds() - self._started

    def end_parts(self) -> None:
        """Write the last part of the recording; the session is closed."""
        self._parts.end()

    def note_parts(self) -> None:
        """Say where a run that was cut short can be seen."""
        folder = self._session.folder
        if has_parts(folder):
            self._options.on_note(f"the run was cut short; what happened until then: mbf replay {folder}")

    def finish(self) -> tuple[RunResult, Recording]:
        """Measure and judge the run, and write its results; the session is closed."""
        session, options, sequence = self._session, self._options, self.sequence
        recording = session.recorder.finish(events=session.memory.events, began=session.loop.origin)
        metrics, result = _measure(recording, session, sequence), sequence.last_result or NO_GOALS
        if options.geodesic and result.success:
            metrics |= _compare_with_geodesic(recording, session.world, metrics["path_length_m"])
        recording = replace(recording, verdict=judge(result, session.scenario.limits, metrics))
        if options.geodesic:
            metrics["spl"] = success_by_path_length(recording.verdict.success, metrics)
        wall_time = self.wall_time
        factor = recording.duration / wall_time if wall_time > 0.0 else 0.0
        timing = {"wall_time_s": round(wall_time, 3), "real_time_factor": round(factor, 2), **self._planning.to_json()}
        self.measured = {**metrics, **recording.verdict.to_json()}
        write_numbers(session.folder, self.measured, timing)
        with ThreadPoolExecutor(1) as beside:  # most of it is compression, which leaves Python to the views
            saving = beside.submit(self._save, recording)
            for problem in options.write_views(session.folder, recording, {**self.measured, **timing}):
                options.on_note(problem)
            saving.result()
        return RunResult(recording.verdict, session.folder, {**self.measured, **timing}), recording

    def _save(self, recording: Recording) -> None:
        """Write the recording as a whole; its parts are not needed any more."""
        recording.save(self._session.folder / "recording.npz")
        self._parts.remove()

    def _report_progress(self, time: float, pose: Pose, velocity: Twist) -> None:
        """Report how far the running action is; an action that drives comes before one that only plans."""
        server = self._session.navigator.server
        at_work = [action.name for action in (server.exe_path, server.recovery, server.get_path) if action.busy]
        driving = server.exe_path.unfinished
        feedback = driving[0].feedback if driving else None
        self._options.on_progress(
            Progress(
                time=time,
                wall_time=wall_seconds() - self._started,
                distance_left=feedback.distance_along_path if feedback else float("nan"),
                speed=velocity.speed,
                tilt=tilt_of(pose),
                state=at_work[0] if at_work else "waiting",
            )
        )


def record_provenance(scenario: Scenario, sessions: Mapping[str, Session], options: RunOptions) -> None:
    """Write what a run is made of; of a run that is killed, too."""
    as_asked, _ = apply_world_settings(scenario, options.settings)  # without the noise that the sessions have added
    seed = scenario.seed if options.seed is None else options.seed
    backends = {name: session.backend for name, session in sessions.items()}
    inputs = sessions[""].inputs if "" in sessions else InputCopies(options.folder)
    write_scenario(options.folder, as_asked, backends, seed, inputs)
    servers = [session.navigator.server for session in sessions.values()]
    is_watched = options.watch is not RunOptions.watch
    write_provenance(options.folder, servers, options.command, options.executive, options.wall_clock, is_watched)


def _measure(recording: Recording, session: Session, sequence: GoalSequence) -> Metrics:
    """Return the numbers of a run: those of its recording, and those that only its simulation knows."""
    monitor = session.simulation.monitor
    return {
        **measure(recording).to_json(),
        **judged_numbers(session, sequence.arrivals),
        "near_misses": monitor.counts[IncidentKind.NEAR_MISS],
        "energy_j": round(monitor.energy, 3),
        "slipped_m": round(monitor.slipped, 6),
        "seed": session.seed,
        "digest": session.digest.hexdigest(),
    }


def judged_numbers(session: Session, arrivals: Sequence[Arrival]) -> Metrics:
    """Return those numbers of a run that only its simulation knows and that its verdict looks at."""
    counts, scenario = session.simulation.monitor.counts, session.scenario
    parameters = session.navigator.server.runtime.parameters
    return {
        "incidents": sorted({incident.kind.value for incident in session.simulation.incidents}),
        "collisions": counts[IncidentKind.COLLISION],
        "collisions_while_moving": counts[IncidentKind.COLLISION_WHILE_MOVING],
        "arrivals": [arrival.to_json() for arrival in arrivals],
        "arrival_tolerance": arrival_tolerance(scenario.limits, scenario.localization, parameters),
        "tip_overs": counts[IncidentKind.TIPPED_OVER],
    }


def write_numbers(folder: Path, metrics: Metrics, timing: Metrics) -> None:
    """Write metrics.json, and timing.json, in which are the numbers that differ from one run to the next."""
    for name, numbers in (("metrics.json", metrics), ("timing.json", timing)):
        write_whole(folder / name, json.dumps(numbers, indent=2, sort_keys=True) + "\n")


def success_by_path_length(success: bool, metrics: Mapping[str, Any]) -> float | None:
    """Success weighted by path length (SPL): the shortest path by the longer of it and the track; 0 for no success.

    Anderson et al., On Evaluation of Embodied Navigation Agents, 2018. None where the shortest path is not known.
    """
    if not success:
        return 0.0
    shortest = metrics.get("geodesic_m")
    if shortest is None:
        return None
    longest = max(shortest, metrics["path_length_m"])
    return round(shortest / longest, 6) if longest > 0.0 else 1.0  # who stood at its goal has driven no detour


def _compare_with_geodesic(recording: Recording, world: ScenarioWorld, driven: float) -> dict[str, float]:
    """Return the shortest path over all goals to where the robot stopped, and the ratio of the driven path to it."""
    goals = [goal.position for goal in recording.goals[:-1]]
    stops = [recording.start.position, *goals, tuple(recording.poses[-1, :3].tolist())]
    shortest = geodesic_length(world.open_surface(), stops, driven)
    if not 0.0 < shortest < float("inf"):
        return {}
    return {"geodesic_m": round(shortest, 6), "path_over_geodesic": round(driven / shortest, 6)}
