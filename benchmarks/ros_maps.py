"""Time that the publisher takes for messages of maps: a costmap of 1000 x 1000 cells, a mesh of 20,000 triangles.

    python benchmarks/ros_maps.py

With rclpy (see docs/ros2.md) also the time in which rclpy would make the same bytes out of the fields.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from mbf_abstract.maps.view import GridView, MeshView
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_ros.map_messages import Audience, GridMessages
from mbf_ros.messages import maps
from mbf_ros.messages.cdr import serialized
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message, completed
from mbf_ros.messages.json_text import json_text

SIDE, ROUNDS = 1000, 20
GRID, UPDATES = "global_costmap/costmap", "global_costmap/costmap_updates"


class OneMap:
    """A server of one map, which shows the view that is set."""

    map_views = ("global_costmap",)
    global_frame = "map"

    def __init__(self) -> None:
        self.runtime, self.robot, self.view = self, self, None

    def map_view(self, name: str) -> Any:
        """The view that is set."""
        return self.view


def milliseconds(call: Callable[[], object]) -> str:
    """Median of the processor time of this thread, and the greatest."""
    times = []
    for _ in range(ROUNDS):
        began = time.thread_time()
        call()
        times.append(1000.0 * (time.thread_time() - began))
    return f"{statistics.median(times):7.1f} ms, at most {max(times):.1f} ms"


def grid_messages(window: int) -> Callable[[], object]:
    """Return what makes the message after a change of a square of ``window`` cells, the whole where that is 0."""
    server, audiences = OneMap(), {GRID: Audience(1, 1), UPDATES: Audience(1, 1)}
    messages = GridMessages(server, "global_costmap", MessageContext, audiences.__getitem__)
    cells = np.random.default_rng(1).integers(0, 255, (SIDE, SIDE)).astype(np.uint8)

    def make() -> object:
        cells[100 : 100 + window, 100 : 100 + window] += 1
        if not window:
            audiences[GRID] = Audience(1, audiences[GRID].joined + 1)
        server.view = GridView(np.divide(cells, np.float32(253), dtype=np.float32), (0.0, 50.0, 0.0, 50.0))
        return list(messages.changes(0.0))

    make()
    return make


def grid_of(view: GridView, context: MessageContext) -> Message:
    """Return a view as a message."""
    return maps.occupancy_grid(maps.occupancy_cells(view.costs), view.extent, "map", 0.0, context)


def show(text: str, kind: str, make: Callable[[], Any]) -> None:
    """Print what it takes to make a message, its bytes, and with rclpy a message of ROS with the same bytes."""
    message = make()
    data = serialized(kind, message)
    print(f"{text}, {kind}: {milliseconds(make)}")
    print(f"  its {len(data) / 1e6:.1f} MB: {milliseconds(lambda: serialized(kind, message))}")
    try:
        from rclpy.serialization import serialize_message
    except ImportError:
        return
    from mbf_ros.ros2.conversion import fill, interface_class

    listed = completed(kind, json.loads(json_text(message)))
    kinds = interface_class(kind)
    print(f"  as rclpy does it: {milliseconds(lambda: serialize_message(fill(kinds(), listed)))}")


def main() -> None:
    """Print one line for each message."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for window, text in ((0, "whole"), (100, "update of 100 x 100"), (1000, "update of all cells")):
        print(f"costmap {SIDE} x {SIDE}, {text}: {milliseconds(grid_messages(window))}")
    view, context = GridView(np.zeros((SIDE, SIDE), np.float32), (0.0, 50.0, 0.0, 50.0)), MessageContext()
    show("costmap", "nav_msgs/OccupancyGrid", lambda: grid_of(view, context))
    vertices, faces = heightfield_mesh(np.zeros((101, 101)), 0.2, 0.2)
    mesh, name = MeshView(vertices, faces.astype(np.int32), np.zeros(len(vertices), np.float32)), "mesh"
    show(name, "mesh_msgs/MeshGeometryStamped", lambda: maps.mesh_geometry(mesh, "mbf", "map", 0.0, context))
    show(name, "mesh_msgs/MeshVertexCostsStamped", lambda: maps.mesh_costs(mesh, "mbf", "all", "map", 0.0, context))
    show(name, "visualization_msgs/MarkerArray", lambda: maps.mesh_markers(mesh, "map", 0.0, context))


if __name__ == "__main__":
    with interruptible():
        main()
