"""A robot that stands in or beside a keep-out area is told so and gets out by ``escape``, on both maps."""

import numpy as np
import pytest
import trimesh
import yaml
from PIL import Image

from mbf_abstract.commands.starters import starters
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.outcomes import GetPathOutcome, RecoveryOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

STAIRS = "[[3, 2], [5, 2], [5, 4], [3, 4]]"
PLUGINS = """
planner_patience: 1.0
planners: [{name: planner, type: PLANNER}]
controllers: [{name: controller, type: follow_path}]
"""
ESCAPE = {"recovery_behaviors": [{"name": "escape", "type": "escape"}]}
COSTMAP = """
backend: costmap
global_costmap:
  robot_radius: 0.2
  layers: [{name: walls, type: static}, {name: stairs, type: keepout}, {name: inflation, type: inflation}]
  walls: {map_file: room.yaml}
  stairs: {zones: [{name: stairway, polygon: STAIRS}]}
local_costmap:
  robot_radius: 0.2
  width: 5
  height: 5
  rolling_window: true
  layers: [LOCAL{name: walls, type: static}, {name: inflation, type: inflation}]
  walls: {map_file: room.yaml}
  BLOCK
""".replace("STAIRS", STAIRS)
CONFIGURATIONS = {
    "costmap, one map": COSTMAP.replace("LOCAL", "").replace("BLOCK", ""),
    "costmap, both maps": COSTMAP.replace("LOCAL", "{name: stairs, type: keepout}, ").replace(
        "BLOCK", f"stairs: {{zones: [{{name: stairway, polygon: {STAIRS}}}]}}"
    ),
    "mesh": """
backend: mesh
mesh_map:
  mesh_file: room.ply
  layers:
    - {name: border, type: border}
    - {name: stairs, type: keepout}
    - {name: inflation, type: inflation, inputs: [stairs]}
  border: {threshold: 0.5}
  stairs: {regions: [{polygon: STAIRS}]}
""".replace("STAIRS", STAIRS),
}
POSES = [
    (4.0, 3.0, 0.0),
    (4.0, 3.0, 1.57),
    (3.3, 3.0, 0.0),
    (3.3, 3.0, 1.57),
    (2.9, 3.0, 0.0),
    (2.9, 3.0, 1.57),
    (3.1, 2.1, 0.7),
    (4.0, 4.15, 0.0),
]


@pytest.fixture
def room(tmp_path):
    """``room(backend, pose, planner=.., walls=..)`` -> session in a room of 8 m x 6 m with stairs in its middle."""
    vertices, faces = heightfield_mesh(np.zeros((61, 81)), 0.1, 0.1)[:2]
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "room.ply")
    (tmp_path / "room.yaml").write_text("{image: room.png, resolution: 0.05, origin: [0, 0, 0], negate: 0}")
    sessions = []

    def open_room(backend, pose, planner="dijkstra", walls=(), recoveries=ESCAPE, **robot):
        cells = np.full((120, 160), 254, dtype=np.uint8)
        for x0, y0, x1, y1 in walls:
            cells[120 - round(y1 / 0.05) : 120 - round(y0 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)] = 0
        Image.fromarray(cells).save(tmp_path / "room.png")
        text = CONFIGURATIONS[backend] + PLUGINS.replace("PLANNER", planner) + yaml.safe_dump(recoveries)
        (tmp_path / "navigation.yaml").write_text(text + "".join(f"{key}: {value}\n" for key, value in robot.items()))
        session = LoopbackSession(Pose.planar(*pose))
        sessions.append(session)
        session.serve(*read_config(tmp_path / "navigation.yaml"), session.robot, session.transforms)
        session.clock.sleep(1.0)
        return session

    yield open_room
    for session in sessions:
        session.close()


def of_starter(name):
    """The recoveries of a starter with their parameters, as a configuration."""
    whole = yaml.safe_load(starters()[name].replace("$map_file", "map"))
    recoveries = whole["recovery_behaviors"]
    blocks = {entry["name"]: whole[entry["name"]] for entry in recoveries if entry["name"] in whole}
    return {"recovery_behaviors": recoveries, **blocks}


def plan(session):
    return session.navigator.get_path(session.navigator.ground_pose(1.0, 1.0))


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_escape_leads_out_to_where_a_plan_begins(room, backend, pose):
    session = room(backend, pose)
    assert not plan(session).success
    result = session.navigator.recover("escape")
    assert result.success, result.message
    assert plan(session).success
    moved = np.hypot(session.robot.pose.x - pose[0], session.robot.pose.y - pose[1])
    assert moved < 1.7


@pytest.mark.parametrize(
    ("backend", "planner", "text"),
    [
        ("costmap, one map", "dijkstra", "lethal in layer stairs (zone 'stairway')"),
        ("costmap, one map", "hybrid_astar", "lethal in layer stairs (zone 'stairway')"),
        ("mesh", "dijkstra", "lethal in layer stairs (regions[0])"),
    ],
)
def test_a_start_and_a_goal_in_an_area_are_refused_with_its_name(room, backend, planner, text):
    inside, outside = room(backend, (4.0, 3.0, 0.0), planner), room(backend, (1.0, 1.0, 0.0), planner)
    assert text in plan(inside).message
    refused = outside.navigator.get_path(outside.navigator.ground_pose(4.0, 3.0))
    assert refused.outcome == GetPathOutcome.BLOCKED_GOAL and text in refused.message


@pytest.mark.parametrize("backend", [name for name in CONFIGURATIONS if name != "mesh"])
def test_escape_drives_through_areas_but_not_through_what_stands_in_them(room, backend):
    """Three sides of the area are walls; the fourth one is farther away."""
    walls = [(3.2, 2.0, 3.3, 4.0), (3.2, 2.0, 4.5, 2.1), (3.2, 3.9, 4.5, 4.0)]
    session = room(backend, (3.7, 3.0, 1.57), walls=walls)
    lowest, handle = session.robot.pose.x, session.navigator.send(RecoveryGoal("escape"))
    while not handle.done:
        session.clock.sleep(0.05)
        lowest = min(lowest, session.robot.pose.x)
    assert handle.wait().success, handle.wait().message
    assert session.robot.pose.x > 5.2 and lowest > 3.5


def test_escape_of_a_closed_in_robot_is_impassable_with_the_area(room):
    walls = [(3.2, 2.2, 3.3, 3.8), (4.7, 2.2, 4.8, 3.8), (3.2, 2.2, 4.8, 2.3), (3.2, 3.7, 4.8, 3.8)]
    session = room("costmap, one map", (4.0, 3.0, 0.0), walls=walls)
    result = session.navigator.recover("escape")
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert "no manoeuvre of 2 m leads to where the robot may stand" in result.message
    assert "lethal in layer stairs (zone 'stairway')" in result.message


@pytest.mark.parametrize("pose", [(3.2, 3.0, 1.57), (3.2, 3.0, 0.0), (3.3, 2.3, -2.4)])
@pytest.mark.parametrize("backend", ["costmap, one map", "mesh"])
def test_a_car_leaves_an_area_in_curves_it_can_drive(room, backend, pose):
    session = room(backend, pose, min_turning_radius=0.6)
    handle = session.navigator.send(RecoveryGoal("escape"))
    while not handle.done:
        session.clock.sleep(0.05)
        command = session.robot.command
        assert abs(command.wz) * 0.6 <= abs(command.vx) + 1e-6
    assert handle.wait().success and plan(session).success, handle.wait().message


STARTERS = {
    "costmap, one map": "costmap_differential",
    "costmap, both maps": "costmap_mapless",
    "mesh": "mesh_skid_steered",
}


@pytest.mark.parametrize("pose", [(4.0, 3.0, 0.0), (3.1, 2.1, 0.7)])
@pytest.mark.parametrize(("backend", "starter"), STARTERS.items())
def test_a_goal_is_reached_from_within_an_area_with_the_recoveries_of_a_starter(room, backend, starter, pose):
    session = room(backend, pose, recoveries=of_starter(starter))
    result = session.navigator.go_to(session.navigator.ground_pose(1.0, 1.0))
    assert result.success, result.message


@pytest.mark.parametrize("check_poses", [True, False])
@pytest.mark.parametrize(("backend", "starter"), STARTERS.items())
def test_a_tree_leaves_an_area_by_its_escape(room, backend, starter, check_poses):
    session = room(backend, (4.0, 3.0, 0.0), recoveries=of_starter(starter))
    options = TreeOptions(escape="escape", check_poses=check_poses, second_planner_pause=0.0)
    executive = TreeExecutive(navigation_tree(options), session.navigator)
    result = executive.run(session.navigator.ground_pose(1.0, 1.0))
    assert result.success, result.message


@pytest.mark.parametrize("starter", starters())
def test_every_starter_has_an_escape(starter):
    assert {"name": "escape", "type": "escape"} in of_starter(starter)["recovery_behaviors"]
