"""Keep-out and slow areas are changed while the server runs, on both maps: the next plan and the next command obey."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

PLUGINS = """
planner_frequency: 2.0
planners: [{name: planner, type: dijkstra}]
controllers: [{name: controller, type: CONTROLLER}]
recovery_behaviors: []
"""
CONFIGURATIONS = {
    "costmap": """
backend: costmap
global_costmap:
  robot_radius: 0.1
  layers:
    - {name: walls, type: static}
    - {name: closed, type: keepout}
    - {name: inflation, type: inflation}
    - {name: slow, type: speed_limit}
  walls: {map_file: room.yaml}
local_costmap:
  robot_radius: 0.1
  layers: [{name: walls, type: static}, {name: closed, type: keepout}, {name: inflation, type: inflation}]
  walls: {map_file: room.yaml}
""",
    "mesh": """
backend: mesh
mesh_map:
  mesh_file: room.ply
  layers:
    - {name: border, type: border}
    - {name: closed, type: keepout}
    - {name: inflation, type: inflation, inputs: [closed]}
    - {name: slow, type: speed_limit}
  border: {threshold: 0.5}
  inflation: {inscribed_radius: 0.1, inflation_radius: 0.3}
""",
}
MAPS = {"costmap": ("global_costmap", "local_costmap"), "mesh": ("mesh_map",)}
CONTROLLERS = {"costmap": ("follow_path", "regulated_pure_pursuit"), "mesh": ("path_follower", "follow_path")}
KEY = {"costmap": "zones", "mesh": "regions"}
DOOR = {"name": "door", "polygon": [[2.8, 0.0], [3.2, 0.0], [3.2, 3.0], [2.8, 3.0]]}
HALF = {"name": "half", "polygon": [[2.8, 0.0], [3.2, 0.0], [3.2, 2.0], [2.8, 2.0]]}
CROSSING = {"name": "bow", "polygon": [[1, 1], [2, 2], [1, 2], [2, 1]]}


@pytest.fixture(params=CONFIGURATIONS)
def backend(request):
    return request.param


@pytest.fixture(params=[0])
def controller(request, backend):
    return CONTROLLERS[backend][request.param]


@pytest.fixture
def room(backend, controller, tmp_path):
    """A session in a room of 6 m x 3 m."""
    Image.fromarray(np.full((60, 120), 254, dtype=np.uint8)).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text("{image: room.png, resolution: 0.05, origin: [0, 0, 0], negate: 0}")
    vertices, faces = heightfield_mesh(np.zeros((31, 61)), 0.1, 0.1)[:2]
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "room.ply")
    (tmp_path / "navigation.yaml").write_text(CONFIGURATIONS[backend] + PLUGINS.replace("CONTROLLER", controller))
    with LoopbackSession(Pose.planar(1.0, 1.5)) as session:
        session.serve(*read_config(tmp_path / "navigation.yaml"), session.robot, session.transforms)
        session.clock.sleep(1.0)
        yield session


@pytest.fixture
def draw(room, backend):
    """``draw(layer, *areas)`` replaces the areas of a layer on all maps that have it."""

    def draw_on_all(layer, *areas):
        for name in MAPS[backend]:
            if layer in room.navigator.server.served[name].map.layers:
                room.navigator.server.set_layer_parameters(f"{name}.{layer}", **{KEY[backend]: areas})

    return draw_on_all


def plan(session):
    session.clock.sleep(1.0)
    return session.navigator.get_path(session.navigator.ground_pose(5.0, 1.5))


def test_a_closed_area_turns_plans_and_an_opened_one_lets_them_through(room, draw):
    assert plan(room).path.length == pytest.approx(4.0, abs=0.1)
    draw("closed", HALF)
    around = plan(room)
    assert around.path.length > 4.1 and around.path.positions[:, 1].max() > 2.0
    draw("closed", DOOR)
    refused = plan(room)
    assert refused.outcome == GetPathOutcome.NO_PATH_FOUND and refused.permanent
    draw("closed")
    assert plan(room).path.length == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("controller", [0, 1], indirect=True)
def test_a_drive_goes_around_an_area_that_is_closed_while_it_runs(room, draw):
    handle = room.navigator.send(MoveBaseGoal(room.navigator.ground_pose(5.0, 1.5)))
    room.clock.sleep(1.0)
    draw("closed", HALF)
    inside = False
    while not handle.done:
        room.clock.sleep(0.05)
        inside = inside or (2.8 < room.robot.pose.x < 3.2 and room.robot.pose.y < 2.0)
    assert handle.wait().success, handle.wait().message
    assert not inside


def test_a_slow_area_holds_from_the_moment_it_is_drawn(room, draw):
    handle = room.navigator.send(MoveBaseGoal(room.navigator.ground_pose(5.0, 1.5)))
    room.clock.sleep(1.5)
    assert room.robot.command.vx > 0.3
    draw("slow", {**DOOR, "polygon": [[0, 0], [6, 0], [6, 3], [0, 3]], "speed_limit": 0.1})
    room.clock.sleep(0.5)
    assert 0.0 < room.robot.command.vx <= 0.1 + 1e-9
    draw("slow")
    room.clock.sleep(1.0)
    assert room.robot.command.vx > 0.3
    assert handle.wait().success


@pytest.mark.parametrize(
    ("area", "text"),
    [
        ({"polygon": [[1, 1], [2, 2]]}, "a polygon of at least 3 corners, not of 2"),
        ({"polygon": [[1, 1], [2, "x"], [2, 1]]}, "[0].polygon[1][1]"),
        ({"polygon": [[1, 1], [2, 2], [2, 1]], "colour": "red"}, "colour"),
    ],
)
def test_an_illegal_area_is_refused_by_name_and_the_old_ones_stay(room, draw, backend, area, text):
    draw("closed", DOOR)
    with pytest.raises(ValueError) as caught:
        draw("closed", area)
    assert f"{MAPS[backend][0]}.closed.{KEY[backend]}[0]" in str(caught.value).replace(" ", "")
    assert text in str(caught.value)
    assert plan(room).outcome == GetPathOutcome.NO_PATH_FOUND


def test_an_area_that_is_hardly_meant_is_told_and_withdrawn(room, draw):
    draw("closed", CROSSING)
    draw("closed")
    told = [event.data["message"] for event in room.memory.of_kind(EventKind.MAP)]
    assert any("'bow': its sides 0 and 2 meet" in one and not one.startswith("no longer") for one in told)
    assert any(one.startswith("no longer") and "'bow'" in one for one in told)
