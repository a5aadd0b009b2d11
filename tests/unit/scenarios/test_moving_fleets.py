"""Fleets of ``benchmarks/moving.py`` whose robots are not alike: drawn by a seed, with room, and configured rightly."""

import sys

import numpy as np
import pytest

from mbf_abstract.config.findings import ConfigError
from terrain.session.fleet import FleetSession
from tests.unit.scenarios.test_moving_cases import moving

fleets = sys.modules["moving_fleets"]


def test_a_seed_gives_one_fleet_for_each_case_and_robots_differ():
    fleet = fleets.drawn_fleet("wide", 3, 4, "costmap")
    assert fleet == fleets.drawn_fleet("wide", 3, 4, "costmap")
    assert fleet != fleets.drawn_fleet("bay", 3, 4, "costmap")
    assert len(set(fleet.robots)) == 4
    assert fleets.drawn_fleet("wide", 3, 6, "costmap").robots[:4] == fleet.robots


@pytest.mark.parametrize("seed", range(20))
def test_the_largest_robot_has_the_room_that_the_usual_one_has(seed):
    fleet = fleets.drawn_fleet("head_on", seed, 2, "both")
    assert fleet.stretch >= max(robot.half_width for robot in fleet.robots) / fleets.USUAL_HALF_WIDTH
    assert {robot.backend for robot in fleet.robots} <= {"costmap", "mesh"}


def test_a_stretched_floor_has_the_same_cells_farther_apart():
    free = np.array([[True, False], [False, True]])
    assert fleets.stretched(free, 1.0).tolist() == free.tolist()
    assert fleets.stretched(free, 2.0).tolist() == np.repeat(np.repeat(free, 2, 0), 2, 1).tolist()
    assert fleets.stretched(free, 1.5).shape == (3, 3)


def test_commands_beyond_what_a_robot_can_do_are_counted():
    fleet = fleets.drawn_fleet("wide", 3, 1, "mesh")
    (robot,) = fleet.robots
    fast, slow = (robot.max_speed * 1.1, 0.0, 0.0), (0.0, 0.0, -robot.max_yaw_rate)
    assert fleets.commands_beyond(fleet, [np.array([fast, slow, (0.0, 0.01, 0.0)])]) == 2


@pytest.mark.parametrize(("seed", "on"), [(100, "costmap"), (100, "mesh"), (104, "mesh"), (100, "both")])
def test_their_configurations_are_without_fault_on_maps_of_both_kinds(tmp_path, seed, on):
    fleet = fleets.drawn_fleet("crossing", seed, 4, on)
    scenario = moving.scenario_of("crossing", seed, tmp_path, "mesh" if on == "mesh" else "costmap", fleet)
    try:
        FleetSession(scenario).close()
    except ConfigError as error:
        pytest.fail(str(error))
    assert {robot.backend for robot in scenario.robots} == ({"costmap", "mesh"} if on == "both" else {on})
