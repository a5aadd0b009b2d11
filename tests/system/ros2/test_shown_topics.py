"""What the node publishes, as real subscribers see it: on a costmap, and on a mesh."""

import json
from contextlib import ExitStack

import numpy as np
import pytest
import trimesh

from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from tests.system.ros2.conftest import PEERS, Peer

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]

SPOT = "[[3.02, -2.98], [3.38, -2.98], [3.38, -2.62], [3.02, -2.62]]"
CONFIG = """
backend: costmap
controller_patience: 60.0
planner_patience: 60.0
max_vel_x: 0.5
global_costmap: {SIZE, LAYERS}
local_costmap: {SIZE, LAYERS}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
""".replace(
    "LAYERS",
    "layers: [{name: area, type: keepout}, {name: seen, type: obstacle}], "
    f"area: {{zones: [{{name: spot, polygon: {SPOT}}}]}}, seen: {{sources: {{scan: {{obstacle_max_range: 5.0}}}}}}",
).replace("SIZE", "robot_radius: 0.3, width: 20.0, height: 20.0, resolution: 0.2, origin_x: -10.0, origin_y: -10.0")
MESH = f"""
backend: mesh
controller_patience: 60.0
planner_patience: 60.0
max_vel_x: 0.5
mesh_map: {{mesh_file: floor.ply, inscribed_radius: 0.3, default_layer: all,
  layers: [{{name: area, type: keepout}}, {{name: seen, type: obstacle}},
    {{name: all, type: max_combination, inputs: [area, seen]}}],
  area: {{regions: [{{polygon: {SPOT}}}]}}, seen: {{sources: [scan]}}}}
planners: [{{name: shortest, type: cvp}}]
controllers: [{{name: follow, type: follow_path}}]
"""
OPTIONS = ("--no-nav2", "--max-silence", "5")
NODE = "/move_base_flex"
OF_BOTH = {
    "/plan": ("nav_msgs/Path", "latched"),
    "/local_plan": ("nav_msgs/Path", "volatile"),
    "/diagnostics": ("diagnostic_msgs/DiagnosticArray", "volatile"),
    f"{NODE}/current_goal": ("geometry_msgs/PoseStamped", "latched"),
    f"{NODE}/footprint": ("geometry_msgs/PolygonStamped", "volatile"),
    f"{NODE}/events": ("std_msgs/String", "volatile"),
    f"{NODE}/cmd_vel": ("geometry_msgs/TwistStamped", "volatile"),
}
GRID, UPDATES = "/global_costmap/costmap", "/global_costmap/costmap_updates"
OF_COSTMAP = {
    GRID: ("nav_msgs/OccupancyGrid", "latched"),
    UPDATES: ("map_msgs/OccupancyGridUpdate", "volatile"),
    "/local_costmap/costmap": ("nav_msgs/OccupancyGrid", "latched"),
}
OF_MESH = {
    f"{NODE}/mesh": ("mesh_msgs/MeshGeometryStamped", "latched"),
    f"{NODE}/vertex_costs": ("mesh_msgs/MeshVertexCostsStamped", "latched"),
    f"{NODE}/mesh_markers": ("visualization_msgs/MarkerArray", "latched"),
    f"{NODE}/vector_field": ("visualization_msgs/MarkerArray", "latched"),
    f"{NODE}/mesh_vector_field": ("mesh_msgs/VectorFieldStamped", "latched"),
}


class Listener(Peer):
    """The subscriber of ``peers/listener.py``."""

    def listen(self, topics):
        for topic, (kind, durability) in topics.items():
            self.order(f"{topic} {kind} {durability}")
            self.wait_for(lambda line, topic=topic: line.get("listens") == topic)

    def newest(self, topic):
        return next(line["message"] for line in reversed(self.lines) if line.get("topic") == topic)

    def wait_for_message(self, topic, wanted=lambda message: True, since=0):
        return self.wait_for(lambda line: line.get("topic") == topic and wanted(line["message"]), since)["message"]


@pytest.fixture
def listener(trio, tmp_path):
    with ExitStack() as closing:
        made = Listener(trio._folder, trio._domain, tmp_path, str(PEERS / "listener.py"))
        closing.callback(made.end)
        yield made


def drive_and_look(trio, listener):
    """Drive, and check what is published whatever the map."""
    goal = trio.client.send("move_base", target=[trio.robot.x + 4.0, 0.0])
    end = listener.wait_for_message("/plan")["poses"][-1]["pose"]["position"]
    assert end["x"] == pytest.approx(listener.wait_for_message(f"{NODE}/current_goal")["pose"]["position"]["x"])
    trio.robot.wait_for_speed(lambda speed: speed > 0.0)
    ahead = listener.wait_for_message("/local_plan")
    assert ahead["header"]["frame_id"] == "map" and ahead["poses"][0]["pose"]["position"]["x"] < end["x"]
    corners = listener.wait_for_message(f"{NODE}/footprint")["polygon"]["points"]
    assert len(corners) == 16 and max(c["y"] for c in corners) == pytest.approx(0.3, abs=0.1)
    array = listener.wait_for_message(
        "/diagnostics", lambda one: any("driven by" in state["message"] for state in one["status"])
    )
    states = {state["name"].removeprefix("move_base_flex: "): state for state in array["status"]}
    assert {"input odom", "input scan", "velocity gate", "planner 'shortest'", "controller 'follow'"} <= set(states)
    command = listener.wait_for_message(f"{NODE}/cmd_vel", lambda one: one["twist"]["linear"]["x"] > 0.0)
    assert command["header"]["frame_id"] == "base_link" and command["header"]["stamp"]["sec"] > 0
    assert trio.cancel(goal)["status"] == "canceled"
    event = listener.wait_for_message(f"{NODE}/events", lambda one: "goal_finished" in one["data"])
    assert json.loads(event["data"])["kind"] == "goal_finished"


def forget_the_wall(trio):
    """Let the map lose what the robot has seen."""
    trio.robot.set("scan", "off")
    trio.client.wait(trio.client.do(order="call", service="clear_costmaps"), "answer")


def test_a_costmap_is_published_as_a_whole_and_then_by_its_changes(trio, listener):
    listener.listen({**OF_BOTH, **OF_COSTMAP})
    drive_and_look(trio, listener)
    forget_the_wall(trio)
    shown, seen = None, 0

    def draw_until(wanted):
        """Draw grids and updates in the order in which they come, until the map is as it should be."""

        def drawn():
            nonlocal shown, seen
            for line in listener.lines[seen:]:
                message = line.get("message", {})
                if line.get("topic") == GRID:
                    shape = message["info"]["height"], message["info"]["width"]
                    shown = np.array(message["data"]).reshape(shape)
                elif line.get("topic") == UPDATES:
                    x, y, width, height = (message[name] for name in ("x", "y", "width", "height"))
                    shown[y : y + height, x : x + width] = np.array(message["data"]).reshape(height, width)
            seen = len(listener.lines)
            return shown is not None and wanted(shown)

        listener.wait_until(drawn)

    def lethal(cells):
        rows, columns = np.nonzero(cells == 100)
        return {(round(0.2 * x - 9.9, 1), round(0.2 * y - 9.9, 1)) for x, y in zip(columns, rows, strict=True)}

    spot = {(3.1, -2.9), (3.1, -2.7), (3.3, -2.9), (3.3, -2.7)}
    draw_until(lambda cells: lethal(cells) == spot)
    trio.robot.set("scan", "on")
    draw_until(lambda cells: lethal(cells) > spot)
    assert all(3.5 < y < 4.2 for _, y in lethal(shown) - spot)  # the wall on the left of the robot
    assert UPDATES in [line.get("topic") for line in listener.lines]
    assert listener.newest("/local_costmap/costmap")["header"]["frame_id"] == "map"


def test_a_mesh_is_published_with_its_costs_and_as_coloured_triangles(trio, listener):
    trio.kill_node()
    vertices, faces = heightfield_mesh(np.zeros((51, 51)), 0.4, 0.4)  # markers are slow to read in rclpy
    trimesh.Trimesh(vertices - [10.0, 10.0, 0.1], faces, process=False).export(trio.file.parent / "floor.ply")
    trio.file.write_text(MESH)
    trio.start_node()
    trio.wait_until_ready()
    listener.listen({**OF_BOTH, **OF_MESH})
    drive_and_look(trio, listener)
    geometry = listener.wait_for_message(f"{NODE}/mesh")["mesh_geometry"]
    places = np.array([[v["x"], v["y"]] for v in geometry["vertices"]])

    def forbidden(costs):
        return places[[cost is None for cost in costs["mesh_vertex_costs"]["costs"]]]

    def is_wall(places):
        return bool((places[:, 1] > 3.0).any())

    before = len(listener.lines)
    forget_the_wall(trio)
    costs = listener.wait_for_message(f"{NODE}/vertex_costs", lambda one: not is_wall(forbidden(one)), before)
    assert len(forbidden(costs)) and (np.abs(forbidden(costs) - [3.2, -2.8]) < 0.4).all()
    before = len(listener.lines)
    trio.robot.set("scan", "on")
    listener.wait_for_message(f"{NODE}/vertex_costs", lambda one: is_wall(forbidden(one)), before)
    (marker,) = listener.wait_for_message(f"{NODE}/mesh_markers")["markers"]
    assert len(marker["points"]) == len(marker["colors"]) == 3 * len(geometry["faces"])
    (lines,) = listener.wait_for_message(f"{NODE}/vector_field")["markers"]
    field = listener.wait_for_message(f"{NODE}/mesh_vector_field")["vector_field"]
    assert len(field["positions"]) == len(field["vectors"]) == len(lines["points"]) / 2 > 0
