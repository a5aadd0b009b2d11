"""Runs a scenario from start to last goal with ``move_base``, or another executive, and writes what happened.

In the folder: ``events.jsonl``, ``metrics.json``, ``recording.npz``, all that repeats the run (``scenario.yaml``,
``navigation.yaml``, ``inputs``, see ``terrain.provenance``), ``provenance.yaml`` and the world's map files; the caller
may add views of them, see ``RunOptions``. On simulated time the same scenario and seed write the same
``events.jsonl``, byte for byte, and the same ``digest`` in ``metrics.json``, which covers poses and commands too (see
``terrain.recording.run_digest``), on every CPU with the versions that ``provenance.yaml`` names. The wall time of the
run is in ``timing.json``. A scenario with several robots is run by ``terrain.session.fleet_run``.
"""

from __future__ import annotations

from dataclasses import replace

from terrain.scenarios.scenario import Scenario
from terrain.session.fleet_run import run_fleet
from terrain.session.robot_run import RobotRun, RunLogs, record_provenance
from terrain.session.run_options import Progress, RunOptions, RunResult
from terrain.session.session import Session

__all__ = ["Progress", "RunOptions", "RunResult", "run_scenario"]


def run_scenario(scenario: Scenario, options: RunOptions) -> RunResult:
    """Run a scenario to its end and write its results.

    Raises
    ------
    ConfigError
        The scenario has no configuration for the backend, or that configuration is wrong; all findings.
    """
    if scenario.robots:
        return run_fleet(scenario, options)
    logs = RunLogs(options.folder)
    session = Session(scenario, replace(options, sinks=(*options.sinks, *logs.sinks)))
    try:
        run = RobotRun(session, options, logs)
        record_provenance(scenario, {"": session}, options)
    except BaseException:
        session.close()
        raise
    try:
        with options.watch(session, run.sequence):
            run.begin()
            session.run()
            run.visit_goals()
    except BaseException:
        run.note_parts()
        raise
    finally:
        session.close()
        run.end_parts()
    return run.finish()[0]
