"""A robot that is pushed against a pillar in Bullet, where friction holds it, gets free with every controller."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
from PIL import Image

from mbf_abstract.geometry import Pose
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario

PILLARS, HALF = ((6.0, 4.0), (6.0, 6.1)), 0.4
RADIUS = 0.178  # m, of the body, which is less than that of the maps
SCENARIO = """
name: pushed
proves: A robot that was pushed against a pillar gets free and arrives.
backend: costmap
navigation: {costmap: costmap.yaml, mesh: mesh.yaml}
world: {type: map, file: floor.yaml}
robot: turtlebot
start: {x: 3.5, y: 5.0}
goals: [{x: 9.0, y: 5.0}]
sensors: [{name: lidar, type: planar, rate: 10.0, rays: 360, max_range: 8.0}]
physics_rate: 120.0
time_limit: 40.0
"""
COMMON = """
controller_frequency: 20.0
planner_frequency: 1.0
replan_failed_policy: keep
dist_tolerance: 0.2
angle_tolerance: 3.14
planners: [{name: astar, type: astar}]
"""
COSTMAP = f"""
backend: costmap
{COMMON}
controllers: [{{name: regulated_pure_pursuit, type: regulated_pure_pursuit}}, {{name: dwa, type: dwa}},
  {{name: mppi, type: mppi}}, {{name: rotation_shim, type: rotation_shim}}, {{name: follow_path, type: follow_path}}]
global_costmap:
  robot_radius: 0.20
  layers: [{{name: walls, type: static}}, {{name: inflation, type: inflation}}]
  walls: {{map_file: $WORLD_MAP}}
  inflation: {{inflation_radius: 0.5, cost_scaling_factor: 6.0}}
local_costmap:
  rolling_window: true
  width: 6.0
  height: 6.0
  resolution: 0.05
  robot_radius: 0.20
  layers: [{{name: obstacles, type: obstacle}}, {{name: inflation, type: inflation}}]
  obstacles: {{sources: {{lidar: {{obstacle_max_range: 4.0, raytrace_max_range: 5.0}}}}}}
  inflation: {{inflation_radius: 0.4, cost_scaling_factor: 6.0}}
"""
MESH = f"""
backend: mesh
{COMMON}
controllers: [{{name: path_follower, type: path_follower}}, {{name: mppi, type: mppi}},
  {{name: follow_path, type: follow_path}}]
mesh_map:
  mesh_file: $WORLD_MESH
  inscribed_radius: 0.20
  default_layer: inflation
  layers: [{{name: walls, type: steepness}}, {{name: inflation, type: inflation, inputs: [walls]}}]
  walls: {{threshold: 0.3}}
  inflation: {{inscribed_radius: 0.20, inflation_radius: 0.5, lethal_value: .inf, inscribed_value: 1.0}}
"""
DRIVERS = [
    *(("costmap", name) for name in ("regulated_pure_pursuit", "dwa", "mppi", "rotation_shim", "follow_path")),
    *(("mesh", name) for name in ("path_follower", "mppi", "follow_path")),
]
CONTACTS = {
    "at the upper pillar's right face, looking at it": ((6.579, 5.891, -2.55), PILLARS[1]),
    "at the lower pillar's corner": ((6.35, 4.58, -1.18), PILLARS[0]),
}


@pytest.fixture
def scenario(tmp_path):
    free = np.zeros((200, 240), dtype=bool)
    free[10:-10, 10:-10] = True
    for x, y in PILLARS:
        free[tuple(slice(round((v - HALF) / 0.05), round((v + HALF) / 0.05)) for v in (y, x))] = False
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(tmp_path / "floor.png")
    files = {
        "floor.yaml": "image: floor.png\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        "costmap.yaml": COSTMAP,
        "mesh.yaml": MESH,
        "pushed.yaml": SCENARIO,
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return load_scenario(tmp_path / "pushed.yaml")


def gaps_to(pillar, positions):
    """Distance (n,) [m] of the body from the pillar."""
    beyond = np.maximum(np.abs(positions[:, :2] - pillar) - HALF, 0.0)
    return np.hypot(*beyond.T) - RADIUS


@pytest.mark.parametrize("where", CONTACTS)
@pytest.mark.parametrize(("backend", "controller"), DRIVERS)
def test_a_robot_that_is_pushed_against_a_pillar_is_free_soon_and_arrives(
    tmp_path, scenario, backend, controller, where
):
    (x, y, yaw), pillar = CONTACTS[where]
    sessions, pushed = [], []

    def push(state):
        robot = sessions[0].robot
        if not pushed and robot.pose().x > 4.9:
            pushed.append(state.time)
            robot.place(Pose((x, y, robot.pose().z), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))))

    def watch(session, goals):
        sessions.append(session)
        return nullcontext()

    options = RunOptions(
        tmp_path / "run",
        seed=0,
        backend=backend,
        settings={"controller": controller},
        watch=watch,
        on_progress=push,
    )
    result = run_scenario(scenario, options)
    assert result.verdict.at_goals, result.verdict
    assert result.metrics["recoveries"] == 0
    with np.load(tmp_path / "run" / "recording.npz") as recording:
        after = recording["times"] > pushed[0] + 0.05
        gaps, times = gaps_to(pillar, recording["poses"][after]), recording["times"][after] - pushed[0]
    assert gaps[0] < 0.02, "it touched the pillar"
    assert times[np.argmax(gaps > 0.06)] < 5.0
