"""A robot of ours behind a slower one in a wide hall: it passes, on both maps, whoever decides when to plan."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

import mbf_abstract
from terrain.scenarios.actors import OtherRobot
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.world_types import MapWorld
from terrain.session.runner import RunOptions, run_scenario

pytestmark = pytest.mark.timeout(300)
BENCHMARKS = Path(mbf_abstract.__file__).parents[1] / "benchmarks"
CELL = 0.05  # m
FREE_TIME = 23.0  # s for 11 m at 0.5 m/s without the other one


def hall_in(folder):
    """16 m x 5 m."""
    free = np.zeros((120, 340), dtype=bool)
    free[10:110, 10:330] = True
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(folder / "hall.png")
    header = f"image: hall.png\nresolution: {CELL}\norigin: [0.0, 0.0, 0.0]\n"
    (folder / "hall.yaml").write_text(header + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return MapWorld(type="map", file=folder / "hall.yaml")


@pytest.mark.parametrize("executive", ["move_base", "navigation"])
@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_robot_passes_one_that_goes_its_way_more_slowly(tmp_path, backend, executive):
    """Until decision 0114 pure pursuit drove beside it, or behind it, for 49 s."""
    settings = BENCHMARKS / ("moving.yaml" if backend == "costmap" else "moving_mesh.yaml")
    recoveries = yaml.safe_load(settings.read_text())["recovery_behaviors"] + [{"name": "wait", "type": "wait"}]
    scenario = Scenario(
        name="overtaking",
        proves="The robot passes who is slower.",
        backend=backend,
        navigation={backend: settings},
        world=hall_in(tmp_path),
        robot="turtlebot",
        start=PlanarPose(x=1.5, y=3.0, yaw=0.0),
        goals=(PlanarPose(x=12.5, y=3.0, yaw=0.0),),
        sensors=(Sensor(max_range=8.0),),
        actors=(OtherRobot(type="robot", route=((3.0, 3.0), (15.5, 3.0)), speed=0.2),),
        physics="kinematic",
    )
    options = RunOptions(tmp_path / "run", executive=executive, settings={"recovery_behaviors": json.dumps(recoveries)})
    found = run_scenario(scenario, options).metrics
    assert len(found["arrivals"]) == 1
    assert found["collisions"] == 0
    assert found["time_s"] < 1.25 * FREE_TIME
