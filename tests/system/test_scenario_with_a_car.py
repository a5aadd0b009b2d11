"""The third robot: a car that cannot turn on the spot drives a scenario on paths it can follow."""

import numpy as np
import pytest

from terrain.physics.robot_models import CAR
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario

SCENARIO = """
name: parking
proves: A car drives to a pose behind it.
backend: costmap
navigation: {costmap: nav.yaml}
world: {type: generated, size: [20.0, 16.0], spacing: 0.5}
robot: car
start: {x: 7.0, y: 8.0}
goals: [{x: 12.0, y: 11.0, yaw: 3.0}]
time_limit: 60.0
"""
FOOTPRINT = "[[-0.17, -0.29], [0.75, -0.29], [0.75, 0.29], [-0.17, 0.29]]"
COSTMAP = f"{{footprint: {FOOTPRINT}, layers: [{{name: slopes, type: static}}], slopes: {{map_file: $WORLD_MAP}}}}"
NAVIGATION = f"""
backend: costmap
dist_tolerance: 0.3
angle_tolerance: 0.5
max_vel_x: 1.0
min_vel_x: -0.6
max_vel_theta: 1.0
min_turning_radius: 1.0
planners: [{{name: hybrid, type: hybrid_astar}}]
controllers: [{{name: pursuit, type: regulated_pure_pursuit}}]
hybrid: {{min_turning_radius: 1.4}}
pursuit: {{rotate_to_heading: false}}
global_costmap: {COSTMAP}
local_costmap: {COSTMAP}
"""


@pytest.mark.parametrize(("physics", "slip"), [("bullet", 1.3), ("kinematic", 1.0001)])
def test_a_car_reaches_a_pose_behind_it_without_turning_on_the_spot(tmp_path, physics, slip):
    (tmp_path / "nav.yaml").write_text(NAVIGATION)
    (tmp_path / "parking.yaml").write_text(SCENARIO + f"physics: {physics}\n")

    result = run_scenario(load_scenario(tmp_path / "parking.yaml"), RunOptions(tmp_path / "run"))

    assert result.success, result.verdict
    with np.load(tmp_path / "run" / "recording.npz") as recording:
        forward, turning = recording["twists"][:, 0], recording["twists"][:, 2]
    moving = np.abs(forward) > 0.1
    assert moving.sum() > 50
    assert (np.abs(turning[moving] / forward[moving]) < slip / CAR.min_turning_radius).all()
    assert np.abs(turning[~moving]).max() < 0.3


MPPI = f"""
backend: costmap
dist_tolerance: 0.3
angle_tolerance: 0.4
max_vel_x: 1.0
min_vel_x: -0.6
max_vel_theta: 1.0
planners: [{{name: hybrid, type: hybrid_astar}}]
controllers: [{{name: mppi, type: mppi}}]
recovery_behaviors: [{{name: wait, type: wait}}]
wait: {{duration: 0.5}}
hybrid: {{min_turning_radius: 1.3}}
mppi: {{motion_model: ackermann, max_vel_x: 0.8, min_vel_x: -0.5, max_vel_theta: 1.0, batch_size: 1000}}
global_costmap: {COSTMAP}
local_costmap: {COSTMAP}
"""
MANOEUVRES = {
    "turned about where it stands": ((7.0, 8.0, 0.0), (7.0, 8.0, 3.14)),
    "a step aside": ((7.0, 8.0, 0.0), (7.0, 9.0, 0.0)),
    "a place beside it, turned": ((11.31, 7.64, 1.59), (12.04, 7.87, 0.24)),
    "back and up": ((10.37, 7.04, 0.07), (9.37, 8.62, 1.59)),
    "ahead, looking back": ((9.54, 9.89, -0.58), (11.6, 11.24, -1.91)),
}


@pytest.mark.parametrize(("start", "goal"), MANOEUVRES.values(), ids=MANOEUVRES)
def test_a_car_drives_hybrid_plans_with_cusps_by_mppi_on_the_curves_of_its_driver(tmp_path, start, goal):
    start, goal = ("{{x: {}, y: {}, yaw: {}}}".format(*pose) for pose in (start, goal))
    text = SCENARIO.replace("{x: 7.0, y: 8.0}", start).replace("{x: 12.0, y: 11.0, yaw: 3.0}", goal)
    (tmp_path / "nav.yaml").write_text(MPPI)
    (tmp_path / "parking.yaml").write_text(text)

    result = run_scenario(load_scenario(tmp_path / "parking.yaml"), RunOptions(tmp_path / "run"))

    assert result.success, result.verdict
    with np.load(tmp_path / "run" / "recording.npz") as recording:
        commands = recording["commands"]
        assert recording["times"][-1] < 25.0
    forward, turning = commands[:, 0], commands[:, 2]
    assert (np.abs(turning) * CAR.min_turning_radius <= np.abs(forward) * (1.0 + 1e-5) + 1e-9).all()
    assert (forward > 0.1).any() and (forward < -0.1).any(), "it drives both ways"
