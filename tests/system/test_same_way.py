"""A robot of ours and somebody who goes the same way, on both maps: one passes, the other is not held up."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

import mbf_abstract
from terrain.scenarios.actors import OtherRobot, Walker
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.world_types import MapWorld
from terrain.session.runner import RunOptions, run_scenario

pytestmark = pytest.mark.timeout(300)
BENCHMARKS = Path(mbf_abstract.__file__).parents[1] / "benchmarks"
CELL = 0.05  # m
FREE_TIME = 23.0  # s for 11 m at 0.5 m/s without the other one


def hall_in(folder, width):
    """16 m long, around y 3.0 m."""
    free = np.zeros((120, 340), dtype=bool)
    half = round(0.5 * width / CELL)
    free[60 - half : 60 + half, 10:330] = True
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(folder / "hall.png")
    header = f"image: hall.png\nresolution: {CELL}\norigin: [0.0, 0.0, 0.0]\n"
    (folder / "hall.yaml").write_text(header + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return MapWorld(type="map", file=folder / "hall.yaml")


def metrics_of(folder, backend, executive, width, actor, start):
    """Drive 11 m along a hall among one other."""
    settings = BENCHMARKS / ("moving.yaml" if backend == "costmap" else "moving_mesh.yaml")
    recoveries = yaml.safe_load(settings.read_text())["recovery_behaviors"] + [{"name": "wait", "type": "wait"}]
    scenario = Scenario(
        name="same_way",
        proves="The robot drives on.",
        backend=backend,
        navigation={backend: settings},
        world=hall_in(folder, width),
        robot="turtlebot",
        start=PlanarPose(x=start, y=3.0, yaw=0.0),
        goals=(PlanarPose(x=start + 11.0, y=3.0, yaw=0.0),),
        sensors=(Sensor(max_range=8.0),),
        actors=(actor,),
        physics="kinematic",
    )
    options = RunOptions(folder / "run", executive=executive, settings={"recovery_behaviors": json.dumps(recoveries)})
    return run_scenario(scenario, options).metrics


@pytest.mark.parametrize("executive", ["move_base", "navigation"])
@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_robot_passes_one_that_goes_its_way_more_slowly(tmp_path, backend, executive):
    """Until decision 0114 pure pursuit drove beside it, or behind it, for more than 50 s."""
    slow = OtherRobot(type="robot", route=((3.0, 3.0), (15.5, 3.0)), speed=0.2)
    found = metrics_of(tmp_path, backend, executive, 5.0, slow, 1.5)
    assert (len(found["arrivals"]), found["collisions"]) == (1, 0)
    assert found["time_s"] < 1.25 * FREE_TIME


@pytest.mark.parametrize(
    "follower",
    [
        OtherRobot(type="robot", route=((0.9, 3.0), (15.5, 3.0)), speed=0.7),
        Walker(type="walker", route=((0.9, 3.0), (15.5, 3.0)), speed=0.9),
    ],
    ids=["robot", "person"],
)
@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_robot_is_not_held_up_by_somebody_who_follows_it_through_a_corridor(tmp_path, backend, follower):
    """Until decision 0115 it braked for them again and again, and took twice as long."""
    found = metrics_of(tmp_path, backend, "navigation", 1.3, follower, 3.0)
    assert (len(found["arrivals"]), found["collisions"]) == (1, 0)
    assert found["time_s"] < 1.4 * FREE_TIME
