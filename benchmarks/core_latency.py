"""Latency of the core on the wall clock: how long a goal takes that costs nothing, and what it leaves behind.

Sends get_path goals one after the other to a planner that answers at once, then drives a loopback robot at 20 Hz and
measures by how much the cycles miss their times. Memory and threads are counted after a warm-up and at the end.
The last line is JSON with ``latency_ms_p50``, ``latency_ms_p99``, ``threads_growth``, ``rss_growth_mb`` and
``jitter_ms_p99``.

    python benchmarks/core_latency.py [--quick] [--json]
"""

import argparse
import json
import threading
from pathlib import Path as FilePath

import numpy as np

from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.program_end import interruptible

WARM_UP = 500
TARGET = Pose.planar(1.0, 0.0)
PATH = Path.from_points([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
FAR = Path.from_points([(0.0, 0.0, 0.0), (1000.0, 0.0, 0.0)])


def resident_megabytes() -> float:
    """Resident memory of this process [MB], from the kernel."""
    fields = FilePath("/proc/self/statm").read_text().split()
    return int(fields[1]) * 4096 / 1e6


def measure_latency(session: ScriptedSession, goals: int) -> np.ndarray:
    """Seconds from ``send`` to the result, one per goal."""
    session.planner.play(PlanResult(0, "", PATH))
    seconds = np.empty(goals)
    for i in range(goals):
        begin = session.clock.now()
        session.navigator.send(GetPathGoal(TARGET)).wait()
        seconds[i] = session.clock.now() - begin
        session.planner.requests.clear()
    return seconds


def measure_jitter(session: ScriptedSession, seconds: float) -> np.ndarray:
    """How far [s] each 20 Hz control cycle begins from its due time."""
    stamps: list[float] = []

    def stamp(request: object) -> object:
        stamps.append(session.clock.now())
        return drive(0.1)

    session.controller.play(stamp)
    handle = session.navigator.send(ExePathGoal(FAR))
    session.clock.sleep(seconds)
    handle.cancel()
    handle.wait()
    periods = np.diff(stamps)
    return np.abs(periods - 1.0 / session.server.runtime.parameters.controller_frequency)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1,000 goals and 3 s of driving instead of 10,000 and 20")
    parser.add_argument("--json", action="store_true", help="print the JSON line only")
    options = parser.parse_args()
    goals, driving = (1_000, 3.0) if options.quick else (10_000, 20.0)
    with ScriptedSession(clock=WallClock()) as session:
        session.events.remove_sink(session.memory)  # it would keep 100,000 events
        session.events.add_sink(MemorySink(1000))
        measure_latency(session, WARM_UP)
        threads, memory = threading.active_count(), resident_megabytes()
        latency = 1e3 * measure_latency(session, goals)
        threads_growth, rss_growth = threading.active_count() - threads, resident_megabytes() - memory
        jitter = 1e3 * measure_jitter(session, driving)
    answer = {
        "goals": goals,
        "latency_ms_p50": round(float(np.percentile(latency, 50)), 4),
        "latency_ms_p99": round(float(np.percentile(latency, 99)), 4),
        "threads_growth": threads_growth,
        "rss_growth_mb": round(rss_growth, 2),
        "jitter_ms_p99": round(float(np.percentile(jitter, 99)), 4),
    }
    if not options.json:
        print(f"{goals} get_path goals through a trivial planner, then {driving:g} s of control at 20 Hz")
        for key, value in answer.items():
            print(f"  {key:16} {value}")
    print(json.dumps(answer))


if __name__ == "__main__":
    with interruptible():
        main()
