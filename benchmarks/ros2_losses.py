"""How soon a robot on ROS 2 is stopped when something fails to come, with the defaults of ``mbf ros2``.

A robot, our node and a client run as in the system tests, each in a process of its own, on this machine. While the
robot drives it drops its transforms, its odometry or its scans. Measured, on the robot's side, is the time from the
last message of that topic to the command to stand. The bar is ``command_timeout`` plus one control period. Needs an
idle machine, and the environment of the system tests, which is built when it is missing (some minutes): Linux on
x86_64. The last line is JSON.

    python benchmarks/ros2_losses.py [--quick] [--json]
"""

import argparse
import json
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from mbf_abstract.time.program_end import interruptible
from tests.system.ros2.conftest import Trio
from tests.system.ros2.environments import KILTED
from tests.system.ros2.test_stopping_in_time import CONFIG, stop_after

TOPICS = "tf", "odom", "scan"
BAR = 0.55  # s: command_timeout 0.5 s, and one period of 20 Hz
SETTINGS = CONFIG[: CONFIG.index("command_timeout")]  # without the long times of the test


def measured(trio, topic, times):
    """Times from the last message of a topic until the robot is stopped [s], ascending."""
    delays = []
    for _ in range(times):
        goal = trio.drive()
        done, stopped_at = stop_after(trio, f"{topic} off")
        delays.append(stopped_at - done["last"])
        trio.robot.set(topic, "on")
        trio.cancel(goal)
    return np.sort(delays)


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="10 losses a topic instead of 40")
    parser.add_argument("--json", action="store_true", help="print nothing but the last line")
    given = parser.parse_args()
    if reason := KILTED.missing():
        sys.exit(reason)
    with ExitStack() as closing:
        logs = Path(closing.enter_context(tempfile.TemporaryDirectory()))
        module = SimpleNamespace(CONFIG=SETTINGS, OPTIONS=("--no-nav2",))
        trio = Trio(closing, KILTED.prepared(), logs, module)
        delays = {topic: measured(trio, topic, 10 if given.quick else 40) for topic in TOPICS}
    if not given.json:
        for topic, values in delays.items():
            median, longest = np.median(values), values[-1]
            print(f"{topic:5} median {median:.3f} s, longest {longest:.3f} s of {len(values)}, bar {BAR} s")
    print(json.dumps({topic: [round(float(value), 4) for value in values] for topic, values in delays.items()}))


if __name__ == "__main__":
    with interruptible():
        main()
