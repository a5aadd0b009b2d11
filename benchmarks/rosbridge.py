"""What a rosbridge costs: delay of a goal and of a command, and how even the control loop runs with clients.

Run: python benchmarks/rosbridge.py [--scenario indoor] [--seconds 20]

A scenario drives in real time, alone, then with the bridge, then with clients that listen to everything, maps too. The
controller runs at the scenario's own rate; what is measured is the time between two commands of the gate.
"""

import argparse
import json
import statistics
import threading
from itertools import pairwise

from websockets.sync.client import connect

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.time.clock import WallClock, wall_seconds
from mbf_abstract.time.program_end import interruptible
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session
from terrain.session.served_world import open_world
from terrain.session.session import Session

TOPICS = ("/tf", "/odom", "/cmd_vel", "/scan", "/points", "/plan", "/move_base_flex/events")
MAPS = ("/global_costmap/costmap", "/local_costmap/costmap", "/move_base_flex/mesh", "/move_base_flex/vertex_costs")


class Listener:
    """A client on a thread of its own that subscribes to everything and reads."""

    def __init__(self, port):
        self.frames = self.bytes = 0
        self.socket = connect(f"ws://127.0.0.1:{port}/", max_size=None)
        for topic in (*TOPICS, *MAPS):
            kind = {} if topic not in MAPS else {"type": MAP_TYPES[topic]}
            self.socket.send(json.dumps({"op": "subscribe", "topic": topic, **kind}))
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        for frame in self.socket:
            self.frames, self.bytes = self.frames + 1, self.bytes + len(frame)


MAP_TYPES = {
    "/global_costmap/costmap": "nav_msgs/OccupancyGrid",
    "/local_costmap/costmap": "nav_msgs/OccupancyGrid",
    "/move_base_flex/mesh": "mesh_msgs/MeshGeometryStamped",
    "/move_base_flex/vertex_costs": "mesh_msgs/MeshVertexCostsStamped",
}


def drive(session: Session, seconds: float) -> list[float]:
    """Drive to the scenario's first goal for some seconds; returns the times between commands [ms]."""
    stamps: list[float] = []
    digest, before = session.digest, session.digest.command

    def note(command):
        stamps.append(wall_seconds())
        before(command)

    digest.command = note  # every command of the gate passes there
    handle = session.navigator.send(MoveBaseGoal(session.goals[0]))
    WallClock().sleep(seconds)
    handle.cancel()
    handle.wait(30.0)
    digest.command = before
    steady = stamps[10:-5]
    return [1000.0 * (later - earlier) for earlier, later in pairwise(steady)]


def goal_delays(port: int, count: int = 200) -> list[float]:
    """Times [ms] from sending a goal that is refused at once to its result: the way there and back."""
    delays = []
    with connect(f"ws://127.0.0.1:{port}/") as socket:
        pose = {"pose": {"position": {"x": 0.0, "y": 0.0}, "orientation": {"w": 0.0}}}
        for number in range(count):
            operation = {
                "op": "send_action_goal",
                "id": str(number),
                "action": "/navigate_to_pose",
                "args": {"pose": pose},
            }
            began = wall_seconds()
            socket.send(json.dumps(operation))
            socket.recv()
            delays.append(1000.0 * (wall_seconds() - began))
    return delays


def row(name: str, values: list[float]) -> str:
    ordered = sorted(values)
    high = ordered[int(0.99 * (len(ordered) - 1))]
    return f"| {name} | {statistics.median(values):.2f} | {high:.2f} | {ordered[-1]:.2f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="indoor")
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    print("| ms | median | 99 % | worst |\n|---|---|---|---|")
    with open_world(options.scenario, None, None, lambda text: None) as session:
        print(row("between commands, no bridge", drive(session, options.seconds)))
        with serve_session(session, BridgeOptions(ServerOptions(port=0))) as server:
            print(row("between commands, bridge without clients", drive(session, options.seconds)))
            listeners = [Listener(server.port) for _ in range(3)]
            print(row("between commands, 3 clients of all topics", drive(session, options.seconds)))
            print(row("a goal there and its result back", goal_delays(server.port)))
            print(f"\n{listeners[0].frames} frames, {listeners[0].bytes / 1e6:.1f} MB to each client")


if __name__ == "__main__":
    with interruptible():
        main()
