"""The third robot: a car that cannot turn on the spot drives a scenario on paths it can follow."""

import numpy as np
import pytest

from terrain.robot_models import CAR
from terrain.runner import RunOptions, run_scenario
from terrain.scenario import load_scenario

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
max_vx: 1.0
min_vx: -0.6
max_wz: 1.0
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

    result = run_scenario(load_scenario(tmp_path / "parking.yaml"), RunOptions(tmp_path / "run", draw=False))

    assert result.success, result.verdict
    with np.load(tmp_path / "run" / "recording.npz") as recording:
        forward, turning = recording["twists"][:, 0], recording["twists"][:, 2]
    moving = np.abs(forward) > 0.1
    assert moving.sum() > 50
    assert (np.abs(turning[moving] / forward[moving]) < slip / CAR.min_turning_radius).all()
    assert np.abs(turning[~moving]).max() < 0.3
