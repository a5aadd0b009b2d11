"""The shipped runs, whole: from the scenario file to a robot that stands at its goal, on both maps."""

import json

import numpy as np
import pytest

from terrain.provenance.provenance import read_provenance
from terrain.scenarios.scenario import MapWorld, PlanarPose, load_scenario
from terrain.session.runner import RunOptions, run_scenario

pytestmark = [pytest.mark.timeout(300), pytest.mark.usefixtures("one_core")]


def run(scenario, folder, **options):
    return run_scenario(scenario, RunOptions(folder, **options))


def nearby(scenario, **changes):
    """The same scenario with a goal not far from its start, for runs that need not be long."""
    return scenario.model_copy(update=changes)


@pytest.mark.parametrize(("name", "backend"), [("outdoor", "mesh"), ("indoor", "costmap")])
def test_the_robot_arrives_and_leaves_its_results(name, backend, tmp_path):
    result = run(load_scenario(name), tmp_path, backend=backend, geodesic=True)
    assert result.success, result.verdict
    assert result.metrics["distance_to_goal_m"] < 0.5
    assert result.metrics["real_time_factor"] > 1.0
    assert 0.9 < result.metrics["spl"] <= 1.0
    assert json.loads((tmp_path / "metrics.json").read_text())["outcome"] == "SUCCESS"
    assert (tmp_path / "events.jsonl").stat().st_size > 0
    assert (tmp_path / "recording.npz").is_file()
    assert read_provenance(tmp_path).versions["numpy"] == np.__version__


@pytest.mark.parametrize(("name", "backend"), [("outdoor", "costmap"), ("indoor", "mesh")])
def test_the_same_scenario_runs_on_the_other_map(name, backend, tmp_path):
    scenario = load_scenario(name)
    goal = PlanarPose(x=scenario.start.x + 2.0, y=scenario.start.y + 3.0, yaw=1.0)
    result = run(nearby(scenario, goals=(goal,)), tmp_path, backend=backend)
    assert result.success, result.verdict


@pytest.mark.parametrize("name", ["outdoor", "indoor"])
def test_one_seed_is_one_drive_bit_for_bit(name, tmp_path):
    scenario = load_scenario(name)
    goal = PlanarPose(x=scenario.start.x + 2.0, y=scenario.start.y + 3.0, yaw=1.0)
    short = nearby(scenario, goals=(goal,))
    logs, digests = [], []
    for attempt in ("first", "second"):
        result = run(short, tmp_path / attempt, seed=3)
        logs.append((tmp_path / attempt / "events.jsonl").read_bytes())
        digests.append(result.metrics["digest"])
    assert logs[0] == logs[1]
    assert digests[0] == digests[1]


def test_the_robot_drives_in_a_real_building(tmp_path, shared_data):
    """The TurtleBot world of ROS tutorials, with lidar and no walls but its own."""
    scenario = load_scenario("indoor").model_copy(
        update={
            "world": MapWorld(type="map", file=shared_data / "maps" / "nav2_bringup" / "tb3_sandbox.yaml"),
            "start": PlanarPose(x=-2.0, y=-0.5),
            "goals": (PlanarPose(x=0.6, y=1.7, yaw=1.57),),
            "obstacles": (),
        }
    )
    result = run(scenario, tmp_path)
    assert result.success, result.verdict
    assert "collision" not in result.metrics["incidents"]


def test_a_goal_that_cannot_be_reached_ends_with_its_reason(tmp_path):
    scenario = load_scenario("indoor")
    inside_a_wall = scenario.model_copy(update={"goals": (PlanarPose(x=8.0, y=4.0),), "time_limit": 30.0})
    result = run(inside_a_wall, tmp_path)
    assert not result.success
    assert result.verdict.outcome_name in {"BLOCKED_GOAL", "NO_PATH_FOUND"}
    assert result.verdict.message
