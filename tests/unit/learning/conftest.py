"""A small room in which an episode takes some seconds of simulated time."""

import pytest

from terrain.experiments.evaluation.indoor import CONFIGS
from terrain.scenarios.limits import Limits
from terrain.scenarios.obstacles import Obstacle
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import PlanarPose, Scenario
from terrain.scenarios.world_types import GeneratedWorld

SEES = {"scan_sectors": 12, "scan_range": 3.0, "waypoints": 3}
ACTS = {"max_vel_x": 0.5, "min_vel_x": -0.5, "max_vel_theta": 1.5}


def room(**changes):
    """A TurtleBot with a goal 2 m ahead, and a wall 1 m behind it."""
    scenario = Scenario(
        name="small room",
        proves="An environment works.",
        backend="costmap",
        navigation=CONFIGS,
        world=GeneratedWorld(type="generated", size=(7.0, 5.0), spacing=0.25),
        robot="turtlebot",
        start=PlanarPose(x=2.0, y=2.5, yaw=0.0),
        goals=(PlanarPose(x=4.0, y=2.5, yaw=0.0),),
        sensors=(Sensor(name="lidar", type="planar", rate=10.0, rays=60, max_range=3.0),),
        obstacles=(Obstacle(shape="box", x=1.0, y=2.5, size=(0.2, 3.0, 1.0)),),
        physics="kinematic",
        time_limit=12.0,
        limits=Limits(goal_distance=0.3),
    )
    return scenario.model_copy(update=changes)


@pytest.fixture
def small_room():
    """Return the function that makes the room, with changes of its keys."""
    return room


@pytest.fixture
def make_environment():
    """Make environments in the small room; all are closed at the end."""
    environment = pytest.importorskip("terrain.learning.environment", reason="needs the extra gym")
    made = []

    def make(scenario=None, **arguments):
        chosen = {"observation": SEES, "commands": ACTS, **arguments}
        made.append(environment.NavigationEnvironment(scenario or room(), **chosen))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def to_the_waypoint():
    """A policy that turns to the second point of the plan and drives while it is ahead."""

    def act(observation):
        x, y = observation["waypoints"][1].tolist()
        return [1.0 if x > abs(y) else 0.0, max(-1.0, min(2.0 * y, 1.0))]

    return act


@pytest.fixture
def drive():
    """Drive an episode; return its first observation, and of each step observation, reward, ends and info."""

    def run(environment, policy, seed=None):
        first, _ = environment.reset(seed=seed)
        observation, steps, over = first, [], False
        while not over:
            observation, reward, terminated, truncated, info = environment.step(policy(observation))
            steps.append((observation, reward, terminated, truncated, info))
            over = terminated or truncated
        return first, steps

    return run
