"""The plugins of the guides keep the contract, and configurations that name them drive a robot."""

import importlib

import numpy as np
import pytest
import trimesh
from PIL import Image

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PluginContext
from mbf_abstract.testing.contract import check_controller, check_planner, check_recovery, check_refiner
from mbf_abstract.testing.contract.rig import rig
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.plugins import CostmapContext
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.plugins import MeshContext

SOUTH = (Pose.planar(1.0, 1.0), Pose.planar(5.0, 1.5, 0.5))
THROUGH_THE_BLOCK = (Pose.planar(1.0, 3.0), Pose.planar(5.0, 3.0))
PATH = Path.from_points(np.linspace((1.0, 1.0, 0.0), (5.0, 1.5, 0.0), 41))
CANCEL_WITHIN = 1.0  # s; this machine may be busy

MESH_CONFIG = """\
backend: mesh
planner_max_retries: 0
dist_tolerance: 0.2
planners:
  - {name: straight, type: "straight_on_mesh:StraightOnMesh"}
  - {name: graph, type: "networkx_planner:NetworkxPlanner"}
controllers:
  - {name: chase, type: "chase_on_mesh:ChaseOnMesh"}
recovery_behaviors:
  - {name: look, type: "look_around:LookAround"}
look: {rate: 1.5}
refiners:
  - {name: dense, type: "dense_poses:DensePoses"}
dense: {spacing: 0.03}
plan_refiner: dense
mesh_map:
  mesh_file: ground.ply
  layers: [{name: water, type: "flooded_ground:FloodedGround"}]
"""
COSTMAP_CONFIG = """\
backend: costmap
planner_max_retries: 0
dist_tolerance: 0.2
planners:
  - {name: straight, type: "straight_on_costmap:StraightOnCostmap"}
controllers:
  - {name: chase, type: "chase_on_costmap:ChaseOnCostmap"}
  - {name: carrot, type: "follow_carrot:FollowCarrot"}
recovery_behaviors:
  - {name: look, type: "look_around:LookAround"}
look: {rate: 1.5}
refiners:
  - {name: dense, type: "dense_poses:DensePoses"}
dense: {spacing: 0.03}
plan_refiner: dense
global_costmap: &room
  robot_radius: 0.2
  layers:
    - {name: walls, type: static}
    - {name: floor, type: "wet_floor:WetFloor"}
  walls: {map_file: room.yaml}
  floor: {x: 3.0, y: 1.25, radius: 0.3, cost: 77}
local_costmap: *room
"""


def blocked(x, y):
    """A block in the middle of a place of 6 m x 6 m."""
    return (np.abs(x - 3.0) < 0.5) & (np.abs(y - 3.0) < 0.5)


def ground():
    """Flat ground with a pit where the block is."""
    x, y = np.meshgrid(np.arange(61) * 0.1, np.arange(61) * 0.1)
    return heightfield_mesh(np.where(blocked(x, y), -1.0, 0.0), 0.1, 0.1)


@pytest.fixture(scope="module")
def on_mesh():
    vertices, faces = ground()
    parameters = MeshMapParameters(layers=({"name": "water", "type": "flooded_ground:FloodedGround"},))
    mesh_map = build_mesh_map(parameters, vertices=vertices, faces=faces)
    return lambda base: MeshContext(**vars(base), navigation_map=mesh_map)


@pytest.fixture(scope="module")
def on_costmap():
    x, y = np.meshgrid((np.arange(60) + 0.5) * 0.1, (np.arange(60) + 0.5) * 0.1)
    walls = Costmap(np.where(blocked(x, y), 254, 0).astype(np.uint8), 0.1)
    parameters = CostmapParameters(max_age=0.0, layers=({"name": "walls", "type": "static"},))
    room = build_layered_costmap(parameters, static_map=walls)
    room.update(None, 0.0)
    return lambda base: CostmapContext(**vars(base), navigation_map=room)


@pytest.fixture
def place(request, map_name):
    return request.getfixturevalue(f"on_{map_name}")


def load(target):
    module, _, name = target.partition(":")
    return getattr(importlib.import_module(module), name)


@pytest.mark.parametrize(
    ("map_name", "target"),
    [
        ("mesh", "straight_on_mesh:StraightOnMesh"),
        ("mesh", "networkx_planner:NetworkxPlanner"),
        ("costmap", "straight_on_costmap:StraightOnCostmap"),
    ],
)
def test_the_planners_keep_the_contract(target, place):
    goes_around = target.startswith("networkx")
    check_planner(
        load(target),
        [SOUTH, THROUGH_THE_BLOCK] if goes_around else [SOUTH],
        unreachable=[] if goes_around else [THROUGH_THE_BLOCK],
        make_context=place,
        cancel_within=CANCEL_WITHIN,
    )


def test_the_networkx_planner_drives_on_a_densified_map_and_refuses_goals_off_it():
    square = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [8.0, 8.0, 0.0], [0.0, 8.0, 0.0]])
    coarse = MeshMapParameters(densify=0.5)
    mesh_map = build_mesh_map(coarse, vertices=square, faces=np.array([[0, 1, 2], [0, 2, 3]]))
    planner_class = load("networkx_planner:NetworkxPlanner")
    base = PluginContext("graph", planner_class.Parameters(), SimClock(), np.random.default_rng(0), robot=None)
    planner = planner_class(MeshContext(**vars(base), navigation_map=mesh_map))

    result = planner.make_plan(PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(6.0, 5.0)))

    assert result.success
    assert np.linalg.norm(result.path.positions[[0, -1], :2] - [[1.0, 1.0], [6.0, 5.0]], axis=1).max() < 0.5
    far = planner.make_plan(PlanRequest(Pose.planar(1.0, 1.0), Pose.planar(60.0, 5.0)))
    assert far.outcome == GetPathOutcome.OUT_OF_MAP


@pytest.mark.parametrize(
    ("map_name", "target"),
    [
        ("mesh", "chase_on_mesh:ChaseOnMesh"),
        ("costmap", "chase_on_costmap:ChaseOnCostmap"),
        ("costmap", "follow_carrot:FollowCarrot"),
    ],
)
def test_the_controllers_keep_the_contract(target, place):
    check_controller(load(target), PATH, make_context=place, cancel_within=CANCEL_WITHIN)


@pytest.mark.parametrize(
    ("map_name", "target"),
    [("mesh", "look_around:LookAround"), ("costmap", "look_around:LookAround")],
)
def test_the_recoveries_keep_the_contract(target, place):
    check_recovery(load(target), start=Pose.planar(2.0, 2.0), make_context=place)


@pytest.mark.parametrize(
    ("map_name", "target"), [("mesh", "dense_poses:DensePoses"), ("costmap", "dense_poses:DensePoses")]
)
def test_the_refiners_keep_the_contract(target, place):
    check_refiner(load(target), PATH, make_context=place)


@pytest.mark.parametrize("map_name", ["mesh", "costmap"])
def test_dense_poses_keeps_all_poses_and_adds_those_that_are_missing(place):
    corners = Path.from_points([(1.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.25, 1.0, 0.0), (1.25, 2.0, 0.0)])
    with rig(load("dense_poses:DensePoses"), place, None, corners[0]) as made:
        refined = made.plugin.apply_refinement(corners, CancelToken()).path

    # The second pose lies on the first; lines of 0.25 m and 1 m are cut into pieces of at most 0.1 m.
    assert refined.positions[[0, 1, 4, 14]].tolist() == corners.positions.tolist() and len(refined) == 15
    assert [pose.yaw for pose in refined] == pytest.approx([0.0] * 4 + [np.pi / 2] * 11)
    assert np.linalg.norm(np.diff(refined.positions, axis=0), axis=1).max() <= 0.1 + 1e-9


@pytest.fixture
def drive(tmp_path):
    """Make a navigator with a loopback robot from a configuration text; everything ends after the test."""
    opened = []

    def make(text):
        file = tmp_path / "navigation.yaml"
        file.write_text(text)
        clock, transforms = SimClock(), TransformBuffer()
        robot = LoopbackRobot(clock, transforms, SOUTH[0])
        navigator = Navigator.from_file(file, robot, clock, transforms)
        opened.append((navigator, robot, clock))
        clock.sleep(1.0)  # the maps have been updated
        return navigator, robot

    yield make
    for navigator, robot, clock in opened:
        navigator.close()
        robot.close()
        clock.sleep(1.0)


def go_and_look(navigator, robot):
    """Drive to the goal, turn around there, and ask for a way through the block."""
    result = navigator.go_to(SOUTH[1])
    assert result.success, result.message
    assert robot.pose.distance_to(SOUTH[1]) < 0.25
    looked = navigator.recover("look")
    assert looked.success, looked.message
    return navigator.get_path(THROUGH_THE_BLOCK[1], start_pose=THROUGH_THE_BLOCK[0])


def test_a_mesh_configuration_of_examples_drives_a_robot(drive, tmp_path):
    trimesh.Trimesh(*ground(), process=False).export(tmp_path / "ground.ply")
    navigator, robot = drive(MESH_CONFIG)

    blocked_plan = go_and_look(navigator, robot)

    assert blocked_plan.outcome == GetPathOutcome.NO_PATH_FOUND and "lethal ground at (2." in blocked_plan.message
    around = navigator.get_path(THROUGH_THE_BLOCK[1], start_pose=THROUGH_THE_BLOCK[0], planner="graph")
    assert around.success and 4.5 < around.path.length < 6.0


def test_a_costmap_configuration_of_examples_drives_a_robot(drive, tmp_path):
    write_room(tmp_path)
    navigator, robot = drive(COSTMAP_CONFIG)

    blocked_plan = go_and_look(navigator, robot)

    assert blocked_plan.outcome == GetPathOutcome.NO_PATH_FOUND and "blocked at (2." in blocked_plan.message
    assert navigator.server.global_costmap.snapshot().cost_at(3.0, 1.25) == 77


def test_the_controller_stops_before_what_blocks_its_path(drive, tmp_path):
    write_room(tmp_path)
    navigator, robot = drive(COSTMAP_CONFIG + "controller_max_retries: 0\n")
    into_the_block = Path.from_points(np.linspace((1.0, 1.0, 0.0), (3.0, 3.0, 0.0), 41))

    result = navigator.exe_path(into_the_block, controller="chase")

    assert result.outcome == ExePathOutcome.BLOCKED_PATH
    assert not blocked(robot.pose.x, robot.pose.y) and robot.command.is_stopped()


def test_the_map_free_controller_drives_on_a_costmap(drive, tmp_path):
    write_room(tmp_path)
    navigator, robot = drive(COSTMAP_CONFIG)

    result = navigator.exe_path(PATH, controller="carrot")

    assert result.success, result.message
    assert robot.pose.distance_to(SOUTH[1]) < 0.25


def write_room(folder):
    """Write the block as a map_server map."""
    x, y = np.meshgrid((np.arange(60) + 0.5) * 0.1, (np.arange(60) + 0.5) * 0.1)
    pixels = np.where(blocked(x, y), 0, 254).astype(np.uint8)[::-1]
    Image.fromarray(pixels).save(folder / "room.png")
    (folder / "room.yaml").write_text(
        "image: room.png\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
