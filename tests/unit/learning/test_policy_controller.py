"""A policy is a controller as any other: it is driven, checked and judged by the navigation, on both maps."""

from itertools import pairwise

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest
from mbf_abstract.testing.contract.controller import check_controller
from mbf_abstract.testing.contract.rig import rig
from mbf_costmap_nav.grid.costmap import GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_mesh_nav.map.mesh_map import MeshMap
from terrain.learning.command_range import CommandRange
from terrain.learning.observation import ObservationParameters
from terrain.learning.policy_controller import PolicyController, PolicyParameters
from terrain.scenarios.scenario import PlanarPose
from terrain.session.runner import RunOptions, run_scenario

FLOOR = MeshMap.from_heights(np.zeros((9, 9)), 1.0, 1.0)


class Steering(PolicyController):
    """Steers to a point of the plan ahead; what it has seen is kept."""

    observation = ObservationParameters(scan_sectors=12, scan_range=3.0, waypoints=3)
    commands = CommandRange(max_vel_x=0.5, min_vel_x=-0.5, max_vel_theta=1.5)
    seen: list = []  # noqa: RUF012

    def act(self, observation):
        self.seen.append(observation)
        x, y = observation["waypoints"][1].tolist()
        return [1.0 if x > abs(y) else 0.0, 2.0 * y]


class Blind(Steering):
    """The same without a sensor."""

    observation = ObservationParameters(scan_sectors=0, waypoints=3)


class NoNumber(Blind):
    """Gives no action."""

    def act(self, observation):
        return [float("nan"), 0.0]


class Patch(Blind):
    """Asks for heights."""

    observation = ObservationParameters(scan_sectors=0, patch_cells=3)


class Sharp(Blind):
    """Drives ahead in the tightest curve to the left."""

    def act(self, observation):
        return [1.0, 1.0]


class Ahead(Blind):
    """Always drives ahead."""

    def act(self, observation):
        return [1.0, 0.0]


def on_floor(scans=(), navigation_map=FLOOR, turning_radius=0.0):
    seen = {one.source: one for one in scans}
    return lambda base: MapContext(
        **{**vars(base), "min_turning_radius": turning_radius}, navigation_map=navigation_map, scans=seen
    )


def answer(controller, at=(4.0, 4.0), scans=(), turning_radius=0.0, **parameters):
    """What a controller answers to its first call, on a floor from 0 to 8 m, 10 s after the beginning."""
    start = Pose.planar(*at)
    context = on_floor(scans, turning_radius=turning_radius)
    with rig(controller, context, PolicyParameters(**parameters), start) as made:
        made.clock.sleep(10.0)
        made.plugin.set_plan(Path.from_points([start.position, (7.0, 4.0, 0.0)]))
        return made.plugin.compute_velocity_commands(ControlRequest(start, Twist()))


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_policy_drives_a_scenario_to_a_success(small_room, tmp_path, backend):
    settings = {"controller": f"{__name__}:Steering"}
    result = run_scenario(small_room(), RunOptions(tmp_path, backend, 3, settings=settings))
    assert result.success, result.verdict


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
@pytest.mark.parametrize(("plans_a_second", "compared"), [("0", 20), ("2", 6)], ids=["one plan", "plans anew"])
def test_a_policy_sees_the_same_in_an_environment_and_in_a_run(
    small_room, make_environment, tmp_path, backend, plans_a_second, compared
):
    """One step is one control cycle, and the cycle in which a plan is asked for has the old one."""
    scenario = small_room(goals=(PlanarPose(x=4.0, y=3.2, yaw=0.0),))
    planning = {"planner_frequency": plans_a_second}
    Steering.seen.clear()
    policy = {"controller": f"{__name__}:Steering", "controller_frequency": "10", **planning}
    run_scenario(scenario, RunOptions(tmp_path, backend, 3, settings=policy))
    _, *driven = Steering.seen  # the first one is of the warm-up, before there are scans
    made = {"observation": Steering.observation, "commands": Steering.commands, "settings": planning}
    environment = make_environment(scenario, backend=backend, **made)
    seen, _ = environment.reset(seed=3)
    for expected in driven[:compared]:
        assert all(np.array_equal(seen[name], expected[name]) for name in seen)
        x, y = seen["waypoints"][1].tolist()
        seen = environment.step([1.0 if x > abs(y) else 0.0, 2.0 * y])[0]
    assert len(driven) > compared and seen["velocity"].any()


def test_a_policy_keeps_the_contract_of_controllers():
    path = Path.from_points([(x, 4.0, 0.0) for x in np.linspace(1.0, 6.0, 26)])
    check_controller(Blind, path, make_context=on_floor(), parameters=PolicyParameters())


def test_the_robot_stops_where_no_scan_comes_or_only_an_old_one():
    old = RangeScan.of_points("lidar", [(5.0, 4.0, 0.3)], (4.0, 4.0, 0.3), 9.0)
    assert answer(Steering).outcome == ExePathOutcome.NO_VALID_CMD
    assert answer(Steering, scans=[old]).message == "the newest scan of 'lidar' is 1.00 s old"
    assert answer(Steering, scans=[old], max_scan_age=2.0).success
    assert answer(Steering, max_scan_age=0.0).success
    other = answer(Steering, scans=[old], max_scan_age=2.0, sources=["lidar", "rear"])
    assert other.message == "no scan of 'rear' has come"


def test_a_call_without_scans_has_asked_the_policy_so_that_a_drive_need_not_wait_for_what_it_loads():
    Steering.seen.clear()
    assert answer(Steering).outcome == ExePathOutcome.NO_VALID_CMD
    assert len(Steering.seen) == 1


def test_the_motion_that_is_checked_is_the_one_that_a_car_can_drive():
    """At 0.5 m/s and 1.5 rad/s the robot would curl around the end of the map, into which it drives with 1.06 m."""
    curl = {"at": (7.4, 4.0), "check_ahead_time": 2.5}
    assert answer(Sharp, **curl).command == Twist.planar(0.5, 0.0, 1.5)
    assert answer(Sharp, turning_radius=1.06, **curl).outcome == ExePathOutcome.BLOCKED_PATH
    assert answer(Sharp, turning_radius=2.0).command == Twist.planar(0.5, 0.0, 0.25)
    for radius, turns in ((0.0, True), (1.06, False)):
        with rig(Sharp, on_floor(turning_radius=radius), PolicyParameters(), Pose.planar(4.0, 4.0)) as made:
            assert made.plugin.turns_on_the_spot is turns


LEVEL = LayeredCostmap(GridGeometry(80, 80, 0.1), [], Footprint([]))
ON_BOTH = pytest.mark.parametrize("navigation_map", [LEVEL, FLOOR], ids=["costmap", "mesh"])


@ON_BOTH
def test_a_path_that_ends_where_it_begins_is_driven_first(navigation_map):
    corners = [(2.0, 2.0, 0.0), (5.0, 2.0, 0.0), (5.0, 5.0, 0.0), (2.0, 5.0, 0.0), (2.0, 2.0, 0.0)]
    with rig(Blind, on_floor(navigation_map=navigation_map), None, Pose.planar(2.0, 2.0)) as made:
        assert not made.plugin.is_goal_reached(Pose.planar(2.0, 2.0), 0.3, 7.0)
        made.plugin.set_plan(Path.from_points(corners))
        reached = []
        for begin, end in pairwise(corners):
            for share in np.linspace(0.0, 1.0, 16):
                x, y, _ = (1.0 - share) * np.array(begin) + share * np.array(end)
                reached.append(made.plugin.is_goal_reached(Pose.planar(x, y, -0.5 * np.pi), 0.3, 0.1))
    assert not any(reached[:60]) and reached[-1]


@ON_BOTH
@pytest.mark.parametrize("height", [0.4, -0.4])
def test_a_goal_a_little_above_or_below_the_ground_is_reached_below_or_above_it(navigation_map, height):
    with rig(Blind, on_floor(navigation_map=navigation_map), None, Pose.planar(2.0, 2.0)) as made:
        made.plugin.set_plan(Path.from_points([(2.0, 2.0, 0.0), (4.0, 2.0, 0.0), (4.25, 2.0, height)]))
        made.plugin.is_goal_reached(Pose.planar(2.0, 2.0), 0.1, 0.1)
        assert not made.plugin.is_goal_reached(Pose.planar(4.0, 2.0), 0.1, 0.1)
        assert made.plugin.is_goal_reached(Pose.planar(4.2, 2.0), 0.1, 0.1)
        assert not made.plugin.is_goal_reached(Pose.planar(4.2, 2.0, 0.2), 0.1, 0.1)


def test_the_robot_stops_before_what_the_map_knows_unless_the_policy_drives_alone():
    blocked = answer(Ahead, at=(7.9, 4.0))
    assert blocked.outcome == ExePathOutcome.BLOCKED_PATH and blocked.message
    assert answer(Ahead, at=(7.9, 4.0), check_ahead_time=0.0).command == Twist.planar(0.5)
    assert answer(Ahead).command == Twist.planar(0.5)


def test_an_action_that_is_no_number_raises():
    with pytest.raises(ValueError, match="action: expected 2 finite numbers from -1 to 1, got"):
        answer(NoNumber)


def test_a_map_that_cannot_give_the_observation_is_refused_before_anything_moves(small_room, tmp_path):
    settings = {"controller": f"{__name__}:Patch"}
    with pytest.raises(Exception, match="patch_cells: expected 0 on a map without heights"):
        run_scenario(small_room(), RunOptions(tmp_path, "costmap", settings=settings))
