"""What it costs to navigate through a robot's rosbridge: delay of a goal, and how evenly commands reach the robot.

Run: python benchmarks/rosbridge_robot.py [--seconds 20]

A kinematic robot drives at 20 Hz, first with the navigator in its own process, then as `mbf bridge connect` does: the
robot and its server in one process, the navigator and a client that sends goals in another, over loopback. Measured is
the time between two commands where the robot gets them, and from sending a goal that is refused at once to its result.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

from rosbridge import row
from websockets.sync.client import connect

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal, MoveBaseGoal
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock, wall_seconds
from mbf_abstract.time.program_end import interruptible
from mbf_ros.rosbridge.serving import BridgeOptions
from mbf_ros.rosbridge_robot.navigator import connect_navigator
from mbf_ros.rosbridge_robot.simulated_robot import serve_robot

FAR = Pose.planar(190.0, 5.0)
MAP = "{width: 200.0, height: 10.0, resolution: 0.5, layers: [{name: area, type: keepout}], area: {zones: []}}"
CONFIG = f"""
backend: costmap
controller_frequency: 20.0
global_costmap: {MAP}
local_costmap: {MAP}
planners: [{{name: shortest, type: straight_line}}]
controllers: [{{name: follow, type: follow_path}}]
"""


def robot_session(file: Path) -> LoopbackSession:
    session = LoopbackSession(Pose.planar(1.0, 5.0), WallClock())
    session.serve(*read_config(file), session.robot, session.transforms)
    return session


def serve(file: Path) -> None:
    """Serve the robot: print its port, and at the end of the input the times of its commands [s]."""
    with robot_session(file) as session, serve_robot(session, BridgeOptions(ServerOptions(port=0))) as server:
        print(server.port, flush=True)
        sys.stdin.read()
        print(json.dumps([time for time, _ in session.robot.commands]), flush=True)


def drive(navigator, seconds: float) -> None:
    handle = navigator.send(MoveBaseGoal(FAR))
    WallClock().sleep(seconds)
    handle.cancel()
    handle.wait(30.0)


def refused_goals(send, count: int = 200) -> list[float]:
    """Times [ms] from a goal to its refusal."""
    delays = []
    for number in range(count + 10):
        began = wall_seconds()
        send(number)
        delays.append(1000.0 * (wall_seconds() - began))
    return delays[10:]


def send_over(socket):
    pose = {"header": {"frame_id": "map"}, "pose": {"orientation": {"w": 1.0}}}

    def send(number: int) -> None:
        args = {"target_pose": pose, "planner": "none such"}
        fields = {"id": str(number), "action": "/move_base_flex/get_path", "args": args}
        socket.send(json.dumps({"op": "send_action_goal", **fields}))
        socket.recv()

    return send


def between(times: list[float]) -> list[float]:
    return [1000.0 * (later - earlier) for earlier, later in pairwise(times[10:-5])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--robot", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.robot:
        serve(options.robot)
        return
    print("| ms | median | 99 % | worst |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.yaml"
        file.write_text(CONFIG)
        with robot_session(file) as session:
            drive(session.navigator, options.seconds)
            print(row("between commands, in one process", between([time for time, _ in session.robot.commands])))
            goal = GetPathGoal(Pose.planar(5.0, 5.0), planner="none such")
            print(
                row(
                    "a goal and its refusal, in one process",
                    refused_goals(lambda _: session.navigator.send(goal).wait()),
                )
            )
        over_rosbridge(file, options.seconds)


def over_rosbridge(file: Path, seconds: float) -> None:
    command = [sys.executable, __file__, "--robot", str(file)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as robot:
        assert robot.stdin is not None and robot.stdout is not None
        address = f"ws://127.0.0.1:{int(robot.stdout.readline())}"
        with connect_navigator(address, file, report=print) as navigator, connect(address) as socket:
            while navigator.problem():
                WallClock().sleep(0.05)
            drive(navigator.session.navigator, seconds)
            delays = refused_goals(send_over(socket))
        robot.stdin.close()
        print(row("between commands, over rosbridge", between(json.loads(robot.stdout.readline()))))
        print(row("a goal and its refusal, over rosbridge", delays))


if __name__ == "__main__":
    with interruptible():
        main()
