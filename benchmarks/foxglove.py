"""What Foxglove costs a run: alone, served to nobody, and served to a client that reads everything.

    python benchmarks/foxglove.py [--quick] [--json]

The three drive the last third of the scenario ``outdoor`` in turns, without a limit of speed; figures are medians over
the rounds of CPU time of this process over that of the run alone. The client is a process of its own. Then ``indoor``
drives on the wall clock, and the figures are how much more than 1/60 s passes between two steps of the world, and what
the client reads a second. ``--json`` prints the figures as last line.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from contextlib import nullcontext
from itertools import pairwise
from typing import NamedTuple

from mbf_abstract.access.foxglove import FoxgloveOptions
from mbf_abstract.access.page_access import Role
from mbf_abstract.time.program_end import interruptible
from terrain.scenarios.scenario import PlanarPose, Scenario, load_scenario
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session, SessionOptions
from terrain.viewer.foxglove.live import LiveFoxglove
from terrain.viewer.logs.run_messages import TOPICS

LIMITS = {"cpu_ratio_unwatched": 1.10}
PERIOD = 1.0 / 60.0  # s
READER = """
import json, sys
from websockets.sync.client import connect
with connect(sys.argv[1], subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
    subscriptions = [{"id": number, "channelId": number} for number in range(1, int(sys.argv[2]) + 1)]
    socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    print("ready", flush=True)
    size = 0
    try:
        while True:
            size += len(socket.recv())
    except Exception:
        print(size)
"""


class Drive(NamedTuple):
    """CPU and wall time [s] of a run, times [s] of the steps of the world, and the bytes that a client has read."""

    cpu: float
    wall: float
    steps: list[float]
    read: int


def drive(scenario: Scenario, served: bool, watched: bool, wall_clock: bool = False) -> Drive:
    """Drive to the goals."""
    session = Session(scenario, SessionOptions(wall_clock=wall_clock))
    reader, steps = None, list[float]()
    try:
        sequence = GoalSequence(session, make_executive("move_base", session.navigator))
        app = LiveFoxglove(session, sequence, FoxgloveOptions(port=18700), speed=0.0) if served else nullcontext()
        with app as live:
            if watched:
                address = live.access.address(live.port, Role.WATCH).replace("http", "ws", 1)
                command = [sys.executable, "-c", READER, address, str(len(TOPICS))]
                reader = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
                reader.stdout.readline()
            session.loop.on_tick.append(lambda _: steps.append(time.perf_counter()))
            cpu, wall = time.process_time(), time.perf_counter()
            session.run()
            result = sequence.visit_goals()
            cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    finally:
        session.close()
    assert result.success, result.message
    return Drive(cpu, wall, steps, int(reader.communicate()[0]) if reader is not None else 0)


def measure(rounds: int) -> dict[str, float]:
    """All figures."""
    scenario = load_scenario("outdoor").model_copy(update={"start": PlanarPose(x=72.0, y=76.7, yaw=0.8)})
    drive(scenario, served=True, watched=True)  # kernels, caches
    costs: dict[str, list[float]] = {"alone": [], "unwatched": [], "watched": []}
    for _ in range(rounds):
        for name, found in costs.items():
            found.append(drive(scenario, name != "alone", name == "watched").cpu)
    figures = {f"cpu_seconds_{name}": round(statistics.median(found), 2) for name, found in costs.items()}
    for name in ("unwatched", "watched"):
        ratios = [one / alone for one, alone in zip(costs[name], costs["alone"], strict=True)]
        figures[f"cpu_ratio_{name}"] = round(statistics.median(ratios), 3)
    for name in ("alone", "watched"):
        figures |= on_the_wall_clock(name, drive(load_scenario("indoor"), name != "alone", name == "watched", True))
    return figures


def on_the_wall_clock(name: str, driven: Drive) -> dict[str, float]:
    """How late the steps of the world were [ms], and what was read [kB/s]."""
    late = sorted(1e3 * (here - before - PERIOD) for before, here in pairwise(driven.steps))
    figures = {"late_p50_ms": late[len(late) // 2], "late_p99_ms": late[int(0.99 * len(late))], "late_max_ms": late[-1]}
    figures |= {"cpu_share": driven.cpu / driven.wall, "read_kb_per_s": driven.read / driven.wall / 1e3}
    return {f"{name}_{key}": round(value, 3) for key, value in figures.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="one round")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    figures = measure(1 if arguments.quick else 5)
    for name, value in figures.items():
        print(f"{name:28} {value:8.3f}")
    if arguments.json:
        print(json.dumps({"figures": figures, "limits": LIMITS}))


if __name__ == "__main__":
    with interruptible():
        main()
