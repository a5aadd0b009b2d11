"""A goal or a start that no sensor can open ends at once, with its own outcome; one on a box is tried again."""

import networkx as nx
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.layers.combinations.max_combination import MaxCombinationLayer
from mbf_mesh_nav.layers.keepout import KeepoutLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.search.permanent_walls import what_separates

FORBIDDEN = [[4.0, 0.8], [5.2, 0.8], [5.2, 2.2], [4.0, 2.2]]
WALL = [[3.0, -1.0], [3.3, -1.0], [3.3, 4.0], [3.0, 4.0]]
CONFIGURATIONS = {
    "costmap": """
backend: costmap
planners: [{name: planner, type: PLANNER}]
global_costmap:
  robot_radius: 0.1
  layers:
    - {name: walls, type: static}
    - {name: area, type: keepout}
    - {name: seen, type: obstacle}
    - {name: inflation, type: inflation}
  walls: {map_file: room.yaml}
  area: {zones: [{name: area, polygon: AREA}]}
  seen: {sources: {lidar: {expected_update_rate: 0.0}}}
local_costmap: {rolling_window: true, width: 3.0, height: 3.0, robot_radius: 0.1}
""",
    "mesh": """
backend: mesh
planners: [{name: planner, type: PLANNER}]
mesh_map:
  mesh_file: room.ply
  inscribed_radius: 0.1
  layers:
    - {name: area, type: keepout}
    - {name: seen, type: obstacle}
    - {name: both, type: max_combination, inputs: [area, seen]}
    - {name: inflation, type: inflation, inputs: [both]}
  area: {regions: [{polygon: AREA}]}
  seen: {sources: [lidar], expected_update_rate: 0.0}
  inflation: {inscribed_radius: 0.1, inflation_radius: 0.3, lethal_value: .inf}
""",
}
RECOVERY = "recovery_behaviors: [{name: escape, type: escape}]\ncontrollers: [{name: controller, type: follow_path}]"
PLANNERS = [("costmap", "dijkstra"), ("mesh", "dijkstra"), ("mesh", "any_angle"), ("mesh", "cvp")]
STARTS = [*PLANNERS, ("costmap", "hybrid_astar"), ("costmap", "theta_star")]


@pytest.fixture
def room(tmp_path):
    """``room(backend, planner, area)`` -> a session in a room of 6 m x 3 m."""
    Image.fromarray(np.full((60, 120), 254, dtype=np.uint8)).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text("{image: room.png, resolution: 0.05, origin: [0, 0, 0], negate: 0}")
    vertices, faces = heightfield_mesh(np.zeros((31, 61)), 0.1, 0.1)[:2]
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "room.ply")
    sessions = []

    def open_session(backend, planner, area, start=(1.0, 1.5), more=""):
        text = CONFIGURATIONS[backend].replace("AREA", str(area)).replace("PLANNER", planner)
        (tmp_path / "navigation.yaml").write_text(text + more)
        session = LoopbackSession(Pose.planar(*start))
        sessions.append(session)
        session.serve(*read_config(tmp_path / "navigation.yaml"), session.robot, session.transforms)
        return session

    yield open_session
    for session in sessions:
        session.close()


def plan(session, **fields):
    """Result of a plan into the area, and how long it took [s]."""
    before = session.clock.now()
    result = session.navigator.get_path(session.navigator.ground_pose(4.6, 1.5), **fields)
    return result, session.clock.now() - before


@pytest.mark.parametrize(("backend", "planner"), PLANNERS)
def test_a_goal_in_a_keep_out_area_is_blocked_at_once(room, backend, planner):
    session = room(backend, planner, FORBIDDEN)
    result, took = plan(session, dist_tolerance=0.3)
    assert result.outcome == GetPathOutcome.BLOCKED_GOAL and result.permanent and took < 0.5
    assert result.message.count("separate") == 1
    tour = session.navigator.get_path(Pose.planar(1.0, 2.5), via=(Pose.planar(4.6, 1.5),))
    assert tour.outcome == GetPathOutcome.BLOCKED_GOAL and tour.permanent
    assert plan(session, dist_tolerance=1.5)[0].success  # beside the area


@pytest.mark.parametrize(("backend", "planner"), PLANNERS)
def test_a_goal_behind_a_wall_has_no_path_at_once(room, backend, planner):
    result, took = plan(room(backend, planner, WALL), dist_tolerance=0.5)
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and result.permanent and took < 0.5


def see(session, x, y):
    """A scan of something of 0.2 m."""
    hits = np.array([[x + dx, y + dy, 0.1] for dx in (-0.1, 0.0, 0.1) for dy in (-0.1, 0.0, 0.1)])
    session.navigator.server.take_scan(RangeScan.of_points("lidar", hits, (x - 0.6, y, 0.1), 0.0, "map"))


@pytest.mark.parametrize(("backend", "planner"), STARTS)
@pytest.mark.parametrize("start", [(4.6, 1.5), (3.92, 1.5)], ids=["inside", "beside"])
def test_a_start_in_a_keep_out_area_is_blocked_at_once(room, backend, planner, start):
    session = room(backend, planner, FORBIDDEN, start)
    before = session.clock.now()
    result = session.navigator.get_path(session.navigator.ground_pose(1.0, 1.5))
    may_open = backend == "mesh" and start[0] < 4.0  # inflated ground, which ``relax`` makes smaller
    assert result.outcome == (GetPathOutcome.PAT_EXCEEDED if may_open else GetPathOutcome.BLOCKED_START), result.message
    assert result.permanent != may_open and (session.clock.now() - before < 0.5) != may_open


@pytest.mark.parametrize(("backend", "planner"), STARTS)
def test_a_robot_that_starts_there_still_recovers(room, backend, planner):
    session = room(backend, planner, FORBIDDEN, (4.2, 1.5), RECOVERY)
    result = session.navigator.go_to(session.navigator.ground_pose(1.0, 1.5))
    assert result.success and session.clock.now() < 25.0, result.message


@pytest.mark.parametrize(("backend", "planner"), STARTS)
def test_a_start_on_something_seen_is_tried_again(room, backend, planner):
    session = room(backend, planner, [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]], (4.6, 1.5))
    see(session, 4.6, 1.5)
    result = session.navigator.get_path(session.navigator.ground_pose(1.0, 1.5))
    assert result.outcome == GetPathOutcome.PAT_EXCEEDED and not result.permanent, result.message


@pytest.mark.parametrize(("backend", "planner"), PLANNERS[:2])
def test_a_goal_on_something_seen_is_tried_again(room, backend, planner):
    session = room(backend, planner, [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]])
    see(session, 4.6, 1.5)
    result, took = plan(session)
    assert result.outcome == GetPathOutcome.PAT_EXCEEDED and not result.permanent and took > 2.0


def twin(mesh_map, first, last, goal, tolerance):
    """Whether no walk along free edges leads from any corner of the first face to the goal, by networkx."""
    closed = set(np.flatnonzero(mesh_map.layers["all"].lethal).tolist())
    graph = nx.Graph(mesh_map.topology.edges.tolist())
    graph.remove_nodes_from(closed)
    near = set(np.flatnonzero(np.linalg.norm(mesh_map.vertices - goal, axis=1) <= tolerance).tolist())
    near |= set(mesh_map.faces[last].tolist())
    found = set().union(*(nx.node_connected_component(graph, int(v)) for v in mesh_map.faces[first]))
    return not found & near


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 10), st.integers(1, 10), st.integers(1, 6), st.integers(1, 6)), max_size=5))
def test_what_separates_agrees_with_a_naive_twin(boxes):
    mesh_map = MeshMap.from_heights(np.zeros((13, 13)), 0.5, 0.5)
    regions = [
        {
            "polygon": [
                [0.5 * x, 0.5 * y],
                [0.5 * (x + w), 0.5 * y],
                [0.5 * (x + w), 0.5 * (y + h)],
                [0.5 * x, 0.5 * (y + h)],
            ]
        }
        for x, y, w, h in boxes
    ]
    common = mesh_map.topology, mesh_map.locator
    area = KeepoutLayer(LayerContext("area", *common, KeepoutLayer.Parameters.model_validate({"regions": regions})))
    every = MaxCombinationLayer(LayerContext("all", *common, MaxCombinationLayer.Parameters(), (area,)))
    for layer in (area, every):
        layer.recompute()
    mesh_map.set_layers(LayerGraph([area, every]), "all")
    start, goal = Pose((0.1, 0.1, 0.0)), Pose((4.1, 4.3, 0.0))
    first, last = mesh_map.locate([start.position, goal.position], np.inf).faces
    if area.lethal[mesh_map.faces[first]].any():
        assert what_separates(mesh_map, start, goal, 0.7) == ()
        return
    expected = twin(mesh_map, first, last, np.array(goal.position), 0.7)
    assert bool(what_separates(mesh_map, start, goal, 0.7)) == expected
