"""A robot of ours that stands without a goal in a corridor of one robot's width, and another one that has to pass."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import mbf_abstract
from mbf_abstract.events import EventKind
from mbf_abstract.goals.goal_types import MoveBaseGoal
from terrain.physics.incidents import CONTACTS
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.robots import OwnRobot, Sensor
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.world_types import MapWorld
from terrain.session.executives import make_executive
from terrain.session.fleet import FleetSession
from terrain.session.simulation_session import SessionOptions

pytestmark = pytest.mark.timeout(300)
BENCHMARKS = Path(mbf_abstract.__file__).parents[1] / "benchmarks"
CELL = 0.05  # m


def floor_in(folder):
    """Two rooms joined by a corridor of 0.9 m."""
    free = np.zeros((80, 220), dtype=bool)
    for x0, x1, y0, y1 in ((0.5, 3.0, 0.5, 3.5), (3.0, 8.0, 1.55, 2.45), (8.0, 10.5, 0.5, 3.5)):
        free[round(y0 / CELL) : round(y1 / CELL), round(x0 / CELL) : round(x1 / CELL)] = True
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(folder / "floor.png")
    header = f"image: floor.png\nresolution: {CELL}\norigin: [0.0, 0.0, 0.0]\n"
    (folder / "floor.yaml").write_text(header + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return MapWorld(type="map", file=folder / "floor.yaml")


@pytest.fixture(params=["costmap", "mesh"])
def fleet(request, tmp_path):
    """``fleet(x)``: anna in the west room, ben without a goal in the corridor at x [m]."""
    backend = request.param
    settings = BENCHMARKS / ("moving.yaml" if backend == "costmap" else "moving_mesh.yaml")
    made = []

    def make(x, **settings_of_both):
        east, ben = PlanarPose(x=9.5, y=2.0, yaw=0.0), PlanarPose(x=x, y=2.0, yaw=3.1)
        scenario = Scenario(
            name="idle",
            proves="A robot without a goal makes room.",
            backend=backend,
            navigation={backend: settings},
            world=floor_in(tmp_path),
            robot="turtlebot",
            robots=(
                OwnRobot(name="anna", start=PlanarPose(x=1.5, y=2.0, yaw=0.0), goals=(east,)),
                OwnRobot(name="ben", start=ben, goals=(ben,)),
            ),
            sensors=(Sensor(max_range=8.0),),
            physics="kinematic",
        )
        made.append(FleetSession(scenario, SessionOptions(folder=tmp_path / "run", settings=settings_of_both)))
        made[-1].run()
        return made[-1]

    yield make
    for one in made:
        one.close()


def drive_through(fleet, recovery_behaviors=None):
    anna = fleet.sessions["anna"]
    return anna.navigator.send(MoveBaseGoal(anna.goals[0], recovery_behaviors=recovery_behaviors)).wait()


def recoveries_of(session):
    return [event.data["plugin"] for event in session.memory.events if event.kind is EventKind.RECOVERY]


def contacts(fleet):
    return [one for session in fleet.sessions.values() for one in session.simulation.incidents if one.kind in CONTACTS]


def assert_ben_pulled_out_and_came_back(made):
    made.clock.sleep(40.0)
    ben = made.sessions["ben"]
    home = ben.goals[0]
    track = ben.recorder.finish().poses[:, :2]
    assert np.linalg.norm(track - [home.x, home.y], axis=1).max() > 0.6, "it pulled out"
    assert ben.robot.pose().distance_to(home) < 0.3
    assert contacts(made) == []


@pytest.mark.parametrize("recoveries", [None, ()], ids=["all recoveries", "nothing clears"])
def test_it_pulls_out_touches_nobody_and_comes_back(fleet, recoveries):
    made = fleet(3.6)
    result = drive_through(made, recoveries)
    assert result.success, result.message
    assert recoveries_of(made.sessions["anna"])[0] == "give_way", "it asks, before it forgets who stands there"
    assert_ben_pulled_out_and_came_back(made)


@pytest.mark.parametrize("executive", ["move_base", "navigation"])
def test_one_that_sees_it_only_while_it_drives_asks_before_it_has_come_up_to_it(fleet, executive):
    """Without that it takes 28 to 36 s, and stands before it until its controller's patience is over."""
    made = fleet(7.0)
    anna, begun = made.sessions["anna"], made.clock.now()
    result = make_executive(executive, anna.navigator).drive(anna.goals[0])
    assert result.success, result.message
    assert recoveries_of(anna) == [] and made.clock.now() - begun < 25.0
    assert_ben_pulled_out_and_came_back(made)


def test_without_it_the_other_one_does_not_get_through(fleet):
    made = fleet(3.6, idle_makes_room="false")
    assert not drive_through(made).success
    assert contacts(made) == []
