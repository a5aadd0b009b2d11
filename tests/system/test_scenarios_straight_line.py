"""No shipped scenario can be passed by driving straight ahead: each needs what its planner does."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path, quaternion_from_yaw
from mbf_abstract.plugins import PlanResult
from mbf_mesh_nav.plugins import MeshPlanner
from terrain.scenarios.library import shipped_scenarios
from terrain.session.runner import RunOptions, run_scenario

SETTLING_CALLS = 20

pytestmark = [pytest.mark.timeout(300), pytest.mark.usefixtures("one_core")]


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


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_the_shipped_scenario_fails_on_the_straight_line(name, shipped, tmp_path):
    scenario = shipped(name)
    settings = {"planner": STRAIGHT[scenario.backend], **GIVE_UP_SOON}
    result = run_scenario(scenario, RunOptions(tmp_path, settings=settings))
    assert not result.success
    assert result.verdict.outcome_name != "INVALID_PLUGIN", result.verdict
