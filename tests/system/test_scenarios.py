"""Every shipped scenario succeeds on its own backend, and none of them does when the robot just drives straight."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path, quaternion_from_yaw
from mbf_abstract.plugins import PlanResult
from mbf_mesh_nav.plugins import MeshPlanner
from terrain.runner import RunOptions, run_scenario
from terrain.scenario import load_scenario, shipped_scenarios
from terrain.scenario_world_types import GarageWorld

SETTLING_CALLS = 20
QUICK = {  # shorter runs that still need what the scenario proves
    "garage_roof": {"world": GarageWorld(type="garage", floors=2)},
    "office_delivery": {"goals": ("meeting_room", "corridor_west")},
}
RUN_ELSEWHERE = {"outdoor", "indoor"}  # test_run_scenarios.py

pytestmark = pytest.mark.timeout(300)


class StraightLinePlanner(MeshPlanner):
    """Projects the straight line from start to goal onto the surface, whatever is in the way."""

    def make_plan(self, request):
        start, goal = (np.array(pose.position) for pose in (request.start, request.goal))
        points = np.linspace(start, goal, max(2, int(np.linalg.norm(goal - start) / 0.2)))
        for _ in range(SETTLING_CALLS):  # the nearest surface point of the nearest surface point ... is straight below
            points[:, 2] = self.mesh_map.locate(points, np.inf).points[:, 2]
        heading = np.tile(quaternion_from_yaw(float(np.arctan2(*(goal - start)[1::-1]))), (len(points), 1))
        return PlanResult(0, "straight ahead", Path(points, heading, request.start.frame_id))


STRAIGHT = {"costmap": "straight_line", "mesh": f"{__name__}:StraightLinePlanner"}


GIVE_UP_SOON = {"controller_patience": "2.0", "recovery_enabled": "false"}  # recoveries only delay the failure


def quick(name):
    return load_scenario(name).model_copy(update=QUICK.get(name, {}))


def test_at_least_twelve_scenarios_ship_and_each_says_what_it_proves():
    loaded = {name: load_scenario(name) for name in shipped_scenarios()}
    assert len(loaded) >= 12
    assert all(name == scenario.name and scenario.proves.endswith(".") for name, scenario in loaded.items())


@pytest.mark.parametrize("name", sorted(set(shipped_scenarios()) - RUN_ELSEWHERE))
def test_the_shipped_scenario_succeeds(name, tmp_path):
    result = run_scenario(quick(name), RunOptions(tmp_path, draw=False))
    assert result.success, result.message


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_the_shipped_scenario_fails_on_the_straight_line(name, tmp_path):
    scenario = quick(name)
    planner = STRAIGHT[scenario.backend]
    settings = {"planner": planner, **GIVE_UP_SOON}
    result = run_scenario(scenario, RunOptions(tmp_path, draw=False, settings=settings))
    assert not result.success
