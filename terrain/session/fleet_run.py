"""Runs a scenario with several robots and writes what happened: for each robot, and together.

Each robot has a folder by its name in the folder of the run, with all that the folder of a run with one robot holds.
The folder of the run has ``events.jsonl`` with the events of all robots, whose sources begin with the robot's name,
and ``metrics.json`` with the numbers of all robots, together and of each. A robot that has visited its goals stands
there until the last one has.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from mbf_abstract.event_sinks import JsonLinesSink
from mbf_abstract.time.clock import Priority
from terrain.recording.fleet_metrics import contacts_between, judge_together, together
from terrain.recording.recording import Recording
from terrain.recording.run_folder import clear_results
from terrain.scenarios.scenario import Scenario
from terrain.session.fleet import FleetSession, NamedSink
from terrain.session.robot_run import RobotRun, RunLogs, record_provenance, write_numbers
from terrain.session.run_options import RunOptions, RunResult


def run_fleet(scenario: Scenario, options: RunOptions) -> RunResult:
    """Run a scenario with several robots to its end and write its results.

    Raises
    ------
    ConfigError
        As ``run_scenario`` does.
    """
    options.folder.mkdir(parents=True, exist_ok=True)
    clear_results(options.folder)
    runs: dict[str, RobotRun] = {}
    with ExitStack() as closing:
        log = JsonLinesSink(options.folder / "events.jsonl")
        closing.callback(log.close)
        logs = {robot.name: RunLogs(options.folder / robot.name) for robot in scenario.robots}
        for own_logs in logs.values():
            closing.callback(own_logs.close)
        sinks = {name: (*logs[name].sinks, NamedSink(name, log)) for name in logs}
        fleet = FleetSession(scenario, options, sinks)
        parts = closing.enter_context(ExitStack())  # ended once the fleet is closed
        closing.callback(fleet.close)
        for name, session in fleet.sessions.items():
            own = replace(options, on_progress=options.on_progress if not runs else _ignore)
            runs[name] = run = RobotRun(session, own, logs[name])
            parts.callback(run.end_parts)
        record_provenance(scenario, fleet.sessions, options)
        try:
            _drive(fleet, runs, options)
        except BaseException:
            for run in runs.values():
                run.note_parts()
            raise
    return _finish(fleet, runs, options)


def _ignore(progress: object) -> None:
    """Show the progress of the first robot only."""


def _drive(fleet: FleetSession, runs: Mapping[str, RobotRun], options: RunOptions) -> None:
    """Let all robots visit their goals, each on a thread of its own; raises the first error of any of them."""
    errors: list[BaseException] = []

    def visit(run: RobotRun) -> None:
        try:
            run.visit_goals()
        except BaseException as error:
            errors.append(error)
            for other in runs.values():
                other.sequence.end("another robot's run has failed")

    with ExitStack() as watched:
        for name, session in fleet.sessions.items():
            watched.enter_context(options.watch(session, runs[name].sequence))
        for run in runs.values():
            run.begin()
        fleet.run()
        first, *others = runs.items()
        threads = [fleet.clock.spawn(partial(visit, run), f"goals of {name}", Priority.CLIENT) for name, run in others]
        visit(first[1])
        for thread in threads:
            thread.join()
    if errors:
        raise errors[0]


def _finish(fleet: FleetSession, runs: Mapping[str, RobotRun], options: RunOptions) -> RunResult:
    """Write the results of each robot, then those of all together."""
    results: dict[str, RunResult] = {}
    recordings: dict[str, Recording] = {}
    for name, run in runs.items():
        results[name], recordings[name] = run.finish()
    contacts = contacts_between({name: session.simulation.incidents for name, session in fleet.sessions.items()})
    verdict = judge_together({name: result.verdict for name, result in results.items()})
    metrics = together(fleet.scenario.name, {name: run.measured for name, run in runs.items()}, contacts)
    metrics |= {"seed": fleet.seed, **verdict.to_json()}
    wall_time = max(run.wall_time for run in runs.values())
    timing = {
        "wall_time_s": round(wall_time, 3),
        "real_time_factor": round(metrics["time_s"] / max(wall_time, 1e-9), 2),
    }
    write_numbers(options.folder, metrics, timing)
    for problem in options.write_joint_views(options.folder, recordings, verdict):
        options.on_note(problem)
    return RunResult(verdict, options.folder, {**metrics, **timing})
