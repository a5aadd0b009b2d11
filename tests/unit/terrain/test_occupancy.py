"""Maps become walls: reading, merging, extruding, and the office that ships with the package."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy import ndimage

from mbf_abstract.config.findings import ConfigError
from terrain.physics.robot_models import TURTLEBOT
from terrain.physics.world import BulletWorld
from terrain.worlds.floor_plan import (
    DATA_FOLDER,
    OFFICE_MAP,
    FloorPlanError,
    read_floor_plan,
    write_map,
)
from terrain.worlds.occupancy import OccupancyGrid, merge_rectangles, read_occupancy, wall_surface


@settings(max_examples=80, deadline=None)
@given(arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_rectangles_cover_each_occupied_cell_once_and_nothing_else(occupied: np.ndarray) -> None:
    painted = np.zeros(occupied.shape, dtype=int)
    for ix_begin, iy_begin, ix_end, iy_end in merge_rectangles(occupied):
        painted[iy_begin:iy_end, ix_begin:ix_end] += 1
    assert np.array_equal(painted, occupied.astype(int))


def test_a_wall_of_many_cells_is_one_rectangle() -> None:
    occupied = np.zeros((20, 30), dtype=bool)
    occupied[5:8, 2:28] = True
    assert merge_rectangles(occupied).tolist() == [[2, 5, 28, 8]]


def test_walls_stand_where_the_map_has_them() -> None:
    occupied = np.zeros((4, 6), dtype=bool)
    occupied[1:3, 2:5] = True
    vertices, faces = wall_surface(OccupancyGrid(occupied, ~occupied, 0.5, -1.0, 2.0), 1.5)
    assert vertices.min(axis=0).tolist() == [0.0, 2.5, 0.0]
    assert vertices.max(axis=0).tolist() == [1.5, 3.5, 1.5]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.sum(np.cross(a, b) * c) / 6.0  # positive where faces look outwards
    assert volume == pytest.approx(1.5 * 1.0 * 1.5)


def test_a_map_survives_writing_and_reading(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    occupied = rng.uniform(size=(13, 21)) < 0.3
    free = ~occupied & (rng.uniform(size=occupied.shape) < 0.7)
    grid = read_occupancy(write_map(OccupancyGrid(occupied, free, 0.05, -3.0, 1.5), tmp_path, "random"))
    assert np.array_equal(grid.occupied, occupied) and np.array_equal(grid.free, free)
    assert (grid.resolution, grid.origin_x, grid.origin_y) == (0.05, -3.0, 1.5)


def test_the_shipped_office_is_what_its_plan_draws(tmp_path: Path) -> None:
    drawn = write_map(read_floor_plan().draw(), tmp_path, "office")
    assert drawn.read_bytes() == OFFICE_MAP.read_bytes()
    # pixels, not bytes: another release of zlib may pack the same picture differently
    pictures = [np.asarray(Image.open(folder / "office.png")) for folder in (tmp_path, DATA_FOLDER)]
    assert np.array_equal(pictures[0], pictures[1])


def test_the_office_is_large_enough_and_its_places_are_free_and_connected() -> None:
    grid, plan = read_occupancy(OFFICE_MAP), read_floor_plan()
    x_min, x_max, y_min, y_max = grid.bounds
    assert x_max - x_min >= 25.0 and y_max - y_min >= 20.0
    clearance = ndimage.distance_transform_edt(~grid.occupied) * grid.resolution
    rooms, _ = ndimage.label(grid.free & (clearance > 0.4))  # a door of 0.9 m leaves 0.45 m to each side
    cells = [(int(y / grid.resolution), int(x / grid.resolution)) for x, y, _ in plan.places.values()]
    assert len(cells) > 8 and all(grid.is_free(x, y) for x, y, _ in plan.places.values())
    assert {rooms[cell] for cell in cells} == {rooms[cells[0]]} and rooms[cells[0]] > 0
    assert TURTLEBOT.circumscribed_radius < 0.4


def test_a_real_building_becomes_walls_that_rays_meet(shared_data: Path) -> None:
    grid = read_occupancy(shared_data / "maps/turtlebot3/map.yaml")
    iy, ix = (int(value[0]) for value in np.nonzero(grid.occupied))
    x, y = grid.origin_x + (ix + 0.5) * grid.resolution, grid.origin_y + (iy + 0.5) * grid.resolution
    with BulletWorld() as world:
        world.add_building(grid)
        assert world.vertical_rays([[x, y]])[0] == pytest.approx(2.0, abs=1e-3)


def test_a_narrow_or_misplaced_door_is_refused(tmp_path: Path) -> None:
    plan = tmp_path / "plan.yaml"
    for door, text in (("at: 2.0, width: 0.6", "0.6 m wide"), ("at: 9.0, width: 1.0", "does not fit")):
        plan.write_text(
            "size: [5, 5]\nwall_thickness: 0.1\n"
            f"rooms: [{{name: cell, from: [1, 1], to: [4, 4], doors: [{{side: north, {door}}}]}}]\n"
        )
        with pytest.raises(FloorPlanError, match=text):
            read_floor_plan(plan)


def test_a_floor_plan_without_a_key_is_refused_by_its_name(tmp_path: Path) -> None:
    plan = tmp_path / "plan.yaml"
    plan.write_text("size: [5, 5]\nwall_thickness: 0.1\n")
    with pytest.raises(FloorPlanError, match=r"plan.yaml: expected the key 'rooms', got none$"):
        read_floor_plan(plan)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("image: a.png\n", "resolution"),
        ("- 1\n", "mapping"),
        ("image: a.png\nresolution: x\norigin: [0, 0, 0]\n", "resolution"),
        ("image: a.png\nresolution: 0\norigin: [0, 0, 0]\n", "resolution"),
        ("image: b.png\nresolution: 1\norigin: [0, 0, 0]\n", "b.png"),
        ("image: a.png\nresolution: 1\norigin: [0, 0, 0]\noccupied_thresh: 65\nfree_thresh: 19.6\n", "thresh"),
        ("image: a.png\nresolution: 1\norigin: [0, 0, 0]\noccupied_thresh: 0.2\nfree_thresh: 0.6\n", "free_thresh"),
        ("image: deep.png\nresolution: 1\norigin: [0, 0, 0]\n", "pixels of type"),
        ("a: [\n", "map.yaml"),
    ],
)
def test_a_bad_map_is_refused_with_its_name_and_reason(tmp_path: Path, text: str, reason: str) -> None:
    Image.fromarray(np.zeros((3, 3), np.uint8)).save(tmp_path / "a.png")
    Image.fromarray(np.zeros((3, 3), np.uint16)).save(tmp_path / "deep.png")
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(ConfigError, match=reason) as caught:
        read_occupancy(tmp_path / "map.yaml")
    assert "map.yaml" in str(caught.value) or reason == "b.png" or reason == "pixels of type"


def test_worlds_read_a_map_as_the_costmap_server_does_raw_and_turned_ones_too(tmp_path: Path) -> None:
    values = np.array([[0, 0, 100], [0, 255, 0]], dtype=np.uint8)  # occupancies of mode raw, top row first
    Image.fromarray(values).save(tmp_path / "a.png")
    description = "image: a.png\nresolution: 0.5\norigin: [1, 2, {yaw}]\nmode: raw\n"
    (tmp_path / "raw.yaml").write_text(description.format(yaw=0))
    (tmp_path / "turned.yaml").write_text(description.format(yaw=math.pi / 2))
    grid, turned = read_occupancy(tmp_path / "raw.yaml"), read_occupancy(tmp_path / "turned.yaml")
    assert grid.occupied.tolist() == [[False, False, False], [False, False, True]]
    assert grid.free.tolist() == [[True, False, True], [True, True, False]]
    assert turned.is_free(0.75, 2.25) and not turned.is_free(0.25, 3.25)
    assert turned.bounds[:2] == pytest.approx((0.0, 1.0), abs=0.51)


def test_a_far_map_keeps_all_digits_in_the_file_that_is_written(tmp_path: Path) -> None:
    occupied = np.zeros((2, 3), dtype=bool)
    grid = OccupancyGrid(occupied, ~occupied, 1.0 / 30.0, 4500123.62, -512345.678901)
    written = read_occupancy(write_map(grid, tmp_path, "far"))
    assert (written.resolution, written.origin_x, written.origin_y) == (1.0 / 30.0, 4500123.62, -512345.678901)


def test_a_floor_without_walls_is_a_plane() -> None:
    free = np.ones((4, 4), dtype=bool)
    with BulletWorld() as world:
        world.add_building(OccupancyGrid(~free, free, 1.0))
        assert world.vertical_rays([[2.0, 2.0]])[0] == pytest.approx(0.0, abs=1e-6)
