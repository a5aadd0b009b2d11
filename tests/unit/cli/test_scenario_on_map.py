"""A scenario taken to another building starts and ends where the robot fits."""

import numpy as np
import pytest

from mbf_abstract.config.findings import ConfigError
from terrain.scenarios.on_map import far_apart_places, on_map
from terrain.scenarios.scenario import load_scenario
from terrain.scenarios.world_types import MapWorld
from terrain.worlds.floor_plan import write_map
from terrain.worlds.occupancy import OccupancyGrid


def test_start_and_goal_are_free_far_apart_and_in_one_room():
    free = np.zeros((60, 200), dtype=bool)
    free[5:55, 5:120] = True  # the larger of two rooms without a door
    free[5:55, 125:195] = True
    grid = OccupancyGrid(~free, free, 0.1, origin_x=-3.0, origin_y=2.0)

    start, goal = far_apart_places(grid, 0.4)

    for place in (start, goal):
        assert grid.is_free(place.x, place.y)
        assert -3.0 + 0.9 < place.x < -3.0 + 11.6
    assert np.hypot(goal.x - start.x, goal.y - start.y) > 10.0


def test_a_map_without_room_for_the_robot_has_no_places():
    free = np.zeros((20, 20), dtype=bool)
    free[9:11, :] = True

    assert far_apart_places(OccupancyGrid(~free, free, 0.1), 0.4) is None


def test_a_shipped_scenario_moves_to_a_real_building(shared_data):
    file = shared_data / "maps" / "nav2_bringup" / "warehouse.yaml"

    moved = on_map(load_scenario("indoor"), file)

    assert moved.world.file == file.resolve()
    assert moved.obstacles == () and len(moved.goals) == 1


def far_room(folder):
    """A free room of 10 m x 6 m far from zero, and the files of its map."""
    free = np.ones((60, 100), dtype=bool)
    return write_map(OccupancyGrid(~free, free, 0.1, 4500123.62, 512345.6), folder, "far")


def test_a_map_far_from_zero_is_put_at_zero_where_the_physics_is_precise(tmp_path):
    moved = on_map(load_scenario("indoor"), far_room(tmp_path))

    grid = moved.world.grid()
    assert grid.bounds == pytest.approx((0.0, 10.0, 0.0, 6.0))
    assert all(grid.is_free(place.x, place.y) for place in (moved.start, *moved.goals))


def test_the_message_for_a_scenario_that_leaves_a_map_far_from_zero_names_what_to_write(tmp_path):
    with pytest.raises(ConfigError, match=r"corner: \[0, 0\]"):
        MapWorld(type="map", file=far_room(tmp_path)).grid()


def test_a_file_that_is_no_map_is_a_finding(tmp_path):
    (tmp_path / "map.yaml").write_text("image: missing.png\n")

    with pytest.raises(ConfigError, match=r"map\.yaml:1: resolution: expected a value >= 0\.0001 and <= 1000 m"):
        on_map(load_scenario("indoor"), tmp_path / "map.yaml")
