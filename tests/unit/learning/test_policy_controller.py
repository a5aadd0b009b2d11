"""A policy is a controller as any other: it is driven, checked and judged by the navigation, on both maps."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.navigation_map import MapContext
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest
from mbf_abstract.testing.contract.controller import check_controller
from mbf_abstract.testing.contract.rig import rig
from mbf_mesh_nav.map.mesh_map import MeshMap
from terrain.learning.command_range import CommandRange
from terrain.learning.observation import ObservationParameters
from terrain.learning.policy_controller import PolicyController, PolicyParameters
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


class Ahead(Blind):
    """Always drives ahead."""

    def act(self, observation):
        return [1.0, 0.0]


def on_floor(scans=()):
    return lambda base: MapContext(**vars(base), navigation_map=FLOOR, scans={one.source: one for one in scans})


def answer(controller, at=(4.0, 4.0), scans=(), **parameters):
    """What a controller answers to its first call, on a floor from 0 to 8 m, 10 s after the beginning."""
    start = Pose.planar(*at)
    with rig(controller, on_floor(scans), PolicyParameters(**parameters), start) as made:
        made.clock.sleep(10.0)
        made.plugin.set_plan(Path.from_points([start.position, (7.0, 4.0, 0.0)]))
        return made.plugin.compute_velocity_commands(ControlRequest(start, Twist()))


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_policy_drives_a_scenario_to_a_success(small_room, tmp_path, backend):
    settings = {"controller": f"{__name__}:Steering"}
    result = run_scenario(small_room(), RunOptions(tmp_path, backend, 3, settings=settings))
    assert result.success, result.verdict


def test_a_policy_sees_the_same_in_an_environment_and_in_a_run(small_room, make_environment, tmp_path):
    """Both begin at the same instant: the first observation of the one is the first of the other."""
    Steering.seen.clear()
    run_scenario(small_room(), RunOptions(tmp_path, seed=3, settings={"controller": f"{__name__}:Steering"}))
    first, _ = make_environment(observation=Steering.observation).reset(seed=3)
    assert all(np.array_equal(first[name], Steering.seen[0][name]) for name in first)


def test_a_policy_keeps_the_contract_of_controllers():
    path = Path.from_points([(x, 4.0, 0.0) for x in np.linspace(1.0, 6.0, 26)])
    check_controller(Blind, path, make_context=on_floor(), parameters=PolicyParameters())


def test_the_robot_stops_where_no_scan_comes_or_only_an_old_one():
    old = RangeScan.of_points("lidar", [(5.0, 4.0, 0.3)], (4.0, 4.0, 0.3), 9.0)
    assert answer(Steering).outcome == ExePathOutcome.NO_VALID_CMD
    assert answer(Steering, scans=[old]).message == "the newest scan is 1.00 s old"
    assert answer(Steering, scans=[old], max_scan_age=2.0).success
    assert answer(Steering, max_scan_age=0.0).success


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
