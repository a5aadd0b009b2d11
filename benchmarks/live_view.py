"""What a page that nobody watches costs a run: the same drive with and without ``--view``, taken in turns.

    python benchmarks/live_view.py [--quick] [--json]

Each pair drives the last third of the scenario ``outdoor`` twice, without a limit of speed; the figure is the median
over the pairs of CPU time (of the whole process, the page's threads included) with the page over that without, and the
same of wall time. ``--json`` prints the figures as last line.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from contextlib import nullcontext

from mbf_abstract.time.program_end import interruptible
from terrain.scenarios.scenario import PlanarPose, Scenario, load_scenario
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.live.session import LiveSession, ViewOptions

LIMITS = {"cpu_ratio": 1.10, "wall_ratio": 1.10}
PORT = 18600


def drive(scenario: Scenario, executive: str, served: bool) -> tuple[float, float]:
    """CPU and wall seconds from the first step of the world to the goal."""
    session = Session(scenario)
    try:
        sequence = GoalSequence(session, make_executive(executive, session.navigator))
        page = LiveSession(session, sequence, ViewOptions(port=PORT, speed=0.0)) if served else nullcontext()
        with page:
            cpu, wall = time.process_time(), time.perf_counter()
            session.run()
            result = sequence.visit_goals()
            cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    finally:
        session.close()
    assert result.success, result.message
    return cpu, wall


def measure(pairs: int, executive: str) -> dict[str, float]:
    scenario = load_scenario("outdoor").model_copy(update={"start": PlanarPose(x=72.0, y=76.7, yaw=0.8)})
    drive(scenario, executive, served=True)  # kernels, page, caches
    plain, served = [], []
    for pair in range(pairs):
        order = (False, True) if pair % 2 else (True, False)
        for with_page in order:
            (served if with_page else plain).append(drive(scenario, executive, with_page))
    ratios = [[b / a for a, b in zip(p, s, strict=True)] for p, s in zip(plain, served, strict=True)]
    cpu_ratio, wall_ratio = (statistics.median(column) for column in zip(*ratios, strict=True))
    return {
        "cpu_seconds_without": round(statistics.median(cpu for cpu, _ in plain), 2),
        "cpu_seconds_with": round(statistics.median(cpu for cpu, _ in served), 2),
        "cpu_ratio": round(cpu_ratio, 3),
        "wall_ratio": round(wall_ratio, 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="3 pairs instead of 15")
    parser.add_argument("--executive", default="move_base", help="move_base, classic or navigation")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    options = parser.parse_args()
    figures = measure(3 if options.quick else 15, options.executive)
    for name, value in figures.items():
        limit = LIMITS.get(name)
        verdict = "" if limit is None else f"  (at most {limit:g}: {'met' if value <= limit else 'MISSED'})"
        print(f"{name:22s} {value:8.3f}{verdict}")
    if options.json:
        print(json.dumps({"benchmark": "live_view", **figures, "limits": LIMITS}))


if __name__ == "__main__":
    with interruptible():
        main()
