"""What ROS 2 and rosbridge cost: the same robot, controller and map in one process, over ROS 2 and over rosbridge.

A kinematic robot (benchmarks/ros2_robot.py) is navigated one way after the other, on this machine, in this run: by a
navigator in its own process, by ``mbf ros2`` (rclpy of Kilted, Fast DDS, loopback), and by ``mbf bridge serve``.
Measured are, where the robot or the client gets the answer:

- from a goal sent until it is accepted, and until its result, for a plan that costs nothing; rosbridge knows no
  acceptance;
- the time between two commands at 20 Hz, and by how much it misses the period;
- the CPU share of the navigator's process meanwhile; in one process the robot is part of it;
- from the first scan that shows a post until a costmap that has it: maps are updated, and published, at 20 Hz. In one
  process that is the map itself.

Needs the environment of the system tests, which is built when it is missing (some minutes), so Linux on x86_64. The
last line is JSON.

    python benchmarks/ros2.py [--quick] [--json]
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from mbf_abstract.time.program_end import interruptible

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.system.ros2.environments import KILTED, MBF, clean_variables, end_with_parent, free_domain  # noqa: E402

ROBOT = Path(__file__).with_name("ros2_robot.py")
PERIOD = 50.0  # ms
MAP = """{width: 100.0, height: 20.0, resolution: 0.2, origin_x: -50.0, origin_y: -10.0, robot_radius: 0.3,
  update_frequency: 20.0, layers: [{name: seen, type: obstacle}],
  seen: {sources: {scan: {obstacle_max_range: 5.0, raytrace_max_range: 6.0}}}}"""
CONFIG = f"""
backend: costmap
controller_frequency: 20.0
controller_patience: 60.0
max_vel_x: 0.5
global_costmap: {MAP}
local_costmap: {MAP}
planners: [{{name: shortest, type: straight_line}}]
controllers: [{{name: follow, type: follow_path}}]
"""
SERVING = ("--map-period", "0.05", "--max-silence", "5")
LIMIT = 600.0  # s for one column


class Amounts:
    """How many goals and scans, and how long [s] to drive."""

    def __init__(self, is_quick):
        self.goals, self.scans, self.seconds = (100, 30, 10.0) if is_quick else (1000, 200, 60.0)

    def arguments(self):
        """As the robot takes them."""
        return [str(self.goals), str(self.scans), str(self.seconds)]


def run_robot(python, kind, config, pid, amounts, variables=None):
    """Run the robot to its end; returns what it has measured."""
    command = [str(python), str(ROBOT), kind, str(config), str(pid), *amounts.arguments()]
    ended = subprocess.run(command, capture_output=True, text=True, env=variables, timeout=LIMIT)
    if ended.returncode:
        sys.exit(f"the robot of {kind} has failed:\n{ended.stderr[-3000:]}")
    return json.loads(ended.stdout.splitlines()[-1])


@contextmanager
def running(command, variables=None, log=None):
    """Run a program until the end of the block, and kill it if that takes long."""
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=log, text=True, env=variables, preexec_fn=end_with_parent
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.communicate(timeout=20.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def in_process(config, amounts):
    return run_robot(sys.executable, "local", config, 0, amounts)


def over_ros(config, amounts):
    try:
        folder = KILTED.prepared()
    except (subprocess.SubprocessError, OSError) as error:
        sys.exit(f"not measured: the environment with ROS 2 cannot be built: {error}")
    python = folder / "venv" / "bin" / "python"
    with ExitStack() as closing:
        variables = clean_variables(folder, free_domain(folder.parent, closing))
        log = closing.enter_context(open(config.with_name("node.txt"), "w"))
        variables["ROS_LOG_DIR"] = str(config.parent)
        command = [str(python), "-c", MBF, "ros2", str(config), "--no-nav2", *SERVING]
        node = closing.enter_context(running(command, variables, log))
        return run_robot(python, "ros2", config, node.pid, amounts, variables)


def over_rosbridge(config, amounts):
    with open(config.with_name("bridge.txt"), "w") as log:
        command = [sys.executable, "-u", "-c", MBF, "bridge", "serve", str(config), "--port", "0", *SERVING]
        with running(command, log=log) as server:
            lines = iter(server.stdout.readline, "")
            address = next((line.split()[1] for line in lines if re.match("rosbridge: ws://", line)), None)
            if address is None:
                sys.exit(f"mbf bridge serve has not started:\n{Path(log.name).read_text()[-3000:]}")
            return run_robot(sys.executable, address, config, server.pid, amounts)


WAYS = {"in one process": in_process, "ROS 2": over_ros, "rosbridge": over_rosbridge}
SHOWN = {50: "median", 5: "5 %", 95: "95 %", 99: "99 %", 100: "longest"}
ROWS = {  # which percentiles are shown of which times, and what they are
    "accepted_ms": ("goal sent until accepted, ms", (50, 95, 99)),
    "planned_ms": ("goal sent until the result of its plan, ms", (50, 95, 99)),
    "between_commands_ms": ("between commands at 20 Hz, ms", (50, 5, 95, 100)),
    "jitter_ms": ("period missed by, ms", (50, 95, 99)),
    "cpu_percent": ("CPU of the navigator's process, % of a core", (50,)),
    "scan_to_costmap_ms": ("scan sent until in a costmap, ms", (50, 95, 100)),
}


def summary(measured):
    """Percentiles by name of row; none where there is nothing to measure."""
    measured = measured | {"jitter_ms": np.abs(np.array(measured["between_commands_ms"]) - PERIOD).tolist()}
    return {
        key: {f"p{share}": round(float(np.percentile(measured[key], share)), 2) for share in shares}
        for key, (_, shares) in ROWS.items()
        if measured[key]
    }


def show(answer):
    """Print a table of all ways, one column each."""
    print(f"| | {' | '.join(answer)} |\n|---|{'---|' * len(answer)}")
    for key, (title, shares) in ROWS.items():
        cells = [", ".join(map(str, one[key].values())) if key in one else "-" for one in answer.values()]
        print(f"| {title}: {', '.join(SHOWN[share] for share in shares)} | {' | '.join(cells)} |")


def missing():
    """What keeps this from running; empty if nothing does."""
    if find_spec("websockets") is None:
        return "rosbridge needs websockets: pip install 'mbf-flex[bridge]'"
    return KILTED.missing()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="100 goals, 30 scans and 10 s of driving each way")
    parser.add_argument("--json", action="store_true", help="print the JSON line only")
    options = parser.parse_args()
    if reason := missing():
        sys.exit(f"not measured: {reason}")
    amounts, answer = Amounts(options.quick), {}
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "robot.yaml"
        config.write_text(CONFIG)
        for name, measure in WAYS.items():
            answer[name] = summary(measure(config, amounts))
    if not options.json:
        show(answer)
    print(json.dumps(answer))


if __name__ == "__main__":
    with interruptible():
        main()
