"""Map files: the published cell counts of real maps, and the facts of map_server's tests (F053-F060)."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mbf_costmap_nav.files.map_description import UNKNOWN_OCCUPANCY, MapError, MapMode
from mbf_costmap_nav.files.map_io import OccupancyMap, load_image, load_map
from mbf_costmap_nav.files.map_saver import save_map
from mbf_costmap_nav.grid import rotated_map as turned_map

# yaml file: (width, height, resolution, free, occupied, other cells)
COUNTS = {
    "costmap_tests/TenByTen": (10, 10, 1.0, 78, 20, 2),
    "map_server_tests/testmap": (10, 10, 0.1, 71, 29, 0),
    "nav2_bringup/depot": (604, 307, 0.05, 179481, 5947, 0),
    "nav2_bringup/depot_keepout": (604, 307, 0.05, 154215, 31213, 0),
    "nav2_bringup/depot_speed": (604, 307, 0.05, 0, 0, 185428),
    "nav2_bringup/tb3_sandbox": (384, 384, 0.05, 7903, 870, 138683),
    "nav2_bringup/warehouse": (1006, 1674, 0.03, 1422292, 30951, 230801),
    "nav2_system_tests/keepout_mask": (384, 384, 0.05, 8690, 171, 138595),
    "nav2_system_tests/map_circular": (384, 384, 0.05, 7930, 920, 138606),
    "nav2_system_tests/speed_mask": (384, 384, 0.05, 8690, 0, 138766),
    "turtlebot3/map": (384, 384, 0.05, 7939, 795, 138722),
}


@pytest.mark.parametrize("name", COUNTS)
def test_a_published_map_has_its_published_counts(shared_data: Path, name):
    file = shared_data / "maps" / f"{name}.yaml"
    width, height, resolution, free, occupied, other = COUNTS[name]
    content = load_map(file)
    counted = np.count_nonzero(content.occupancy == 0), np.count_nonzero(content.occupancy == 100)
    assert content.occupancy.shape == (height, width) and content.resolution == resolution
    assert (*counted, content.occupancy.size - sum(counted)) == (free, occupied, other)


@pytest.mark.parametrize("suffix", ["pgm", "png", "bmp"])
def test_f053_the_test_image_reads_the_same_in_every_format(shared_data: Path, suffix):
    image = shared_data / "maps" / "map_server_tests" / f"testmap.{suffix}"
    content = load_image(image, 0.1, occupied_thresh=0.65, free_thresh=0.1)
    assert content.occupancy.shape == (10, 10)
    assert content.occupancy[0].tolist() == [0] * 10, "the bottom row comes first"
    assert content.occupancy[1].tolist() == [100, 100, 100, 100, 0, 0, 100, 100, 100, 0]
    assert np.count_nonzero(content.occupancy == 100) == 29


@pytest.fixture
def spectrum(tmp_path: Path) -> Path:
    """All 256 grey values once, like map_server's spectrum.png."""
    file = tmp_path / "spectrum.png"
    Image.fromarray(np.arange(256, dtype=np.uint8).reshape(16, 16)).save(file)
    return file


@pytest.mark.parametrize(
    "mode", [pytest.param(MapMode.TRINARY, id="F055-trinary"), pytest.param(MapMode.SCALE, id="F056-scale")]
)
def test_every_grey_value_is_read_by_the_thresholds(spectrum, mode):
    occupancy = load_image(spectrum, 0.1, occupied_thresh=0.65, free_thresh=0.1, mode=mode).occupancy
    assert (np.count_nonzero(occupancy == 100), np.count_nonzero(occupancy == 0)) == (90, 26)
    between = occupancy[(occupancy != 100) & (occupancy != 0)]
    assert len(between) == 140
    assert set(between) == {255} if mode is MapMode.TRINARY else between.min() >= 1 and between.max() <= 99


def test_f057_raw_mode_keeps_every_value(spectrum):
    occupancy = load_image(spectrum, 0.1, mode=MapMode.RAW).occupancy
    assert sorted(occupancy.ravel().tolist()) == list(range(256))


def test_f058_a_missing_image_is_named(tmp_path):
    with pytest.raises(MapError, match=r"nowhere\.png.*No such file"):
        load_image(tmp_path / "nowhere.png", 0.1)


@pytest.mark.parametrize("name", ["map_server_tests/invalid_image.yaml", "nav2_system_tests/empty_room.yaml"])
def test_f059_a_description_of_a_missing_image_is_refused(shared_data: Path, name):
    with pytest.raises(MapError, match=r"image: expected an image, got .* \(no file "):
        load_map(shared_data / "maps" / name)


@pytest.mark.parametrize("name", ["mesh.ply", "folder", "map.yaml.bak"])
def test_what_is_neither_a_description_nor_an_image_is_refused_unread(tmp_path: Path, name):
    with pytest.raises(MapError, match=rf"{name}: expected a map of map_server or an image .*, got"):
        load_map(tmp_path / name)


@pytest.mark.parametrize("image_format", ["pgm", "png", "bmp"])
@pytest.mark.parametrize("mode", list(MapMode), ids=lambda mode: mode.value)
def test_f060_a_saved_map_loads_as_it_was(tmp_path, image_format, mode):
    values = {"trinary": [0, 100, 255], "scale": list(range(101)), "raw": list(range(256))}[mode.value]
    occupancy = np.random.default_rng(1).choice(values, size=(30, 20)).astype(np.uint8)
    content = OccupancyMap(occupancy, 0.25, (1.0, -2.0, 0.5))
    save_map(tmp_path / "map.yaml", content, image_format=image_format, mode=mode, occupied_thresh=0.6)
    again = load_map(tmp_path / "map.yaml")
    assert np.array_equal(again.occupancy, occupancy)
    assert (again.resolution, again.origin) == (content.resolution, content.origin)


def test_unknown_cells_survive_scale_mode_as_transparent_pixels(tmp_path):
    content = OccupancyMap(np.array([[0, 50], [255, 100]], dtype=np.uint8), 1.0)
    save_map(tmp_path / "map.yaml", content, image_format="png", mode=MapMode.SCALE)
    assert np.array_equal(load_map(tmp_path / "map.yaml").occupancy, content.occupancy)
    with pytest.raises(MapError, match=r"cannot express the occupancies \[255\]"):
        save_map(tmp_path / "map.yaml", content, image_format="pgm", mode=MapMode.SCALE)


def test_negate_turns_black_into_free(tmp_path):
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).save(tmp_path / "map.png")
    assert load_image(tmp_path / "map.png", 1.0, negate=True).occupancy.tolist() == [[0, 100]]


def test_rows_of_the_image_run_from_top_to_bottom(tmp_path):
    Image.fromarray(np.array([[0], [254], [254]], dtype=np.uint8)).save(tmp_path / "map.png")
    assert load_image(tmp_path / "map.png", 1.0).occupancy.ravel().tolist() == [0, 0, 100]


def test_a_costmap_of_a_map_scales_occupancy(tmp_path):
    content = OccupancyMap(np.array([[0, 50, 100, 255]], dtype=np.uint8), 1.0, (3.0, 4.0, 0.0))
    costmap = content.to_costmap()
    assert costmap.cells.tolist() == [[0, 127, 254, 255]] and (costmap.origin_x, costmap.origin_y) == (3.0, 4.0)
    assert content.to_costmap(track_unknown_space=False).cells.tolist() == [[0, 127, 254, 0]]


@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_in_raw_mode_everything_from_a_hundred_on_is_occupied_and_only_255_unknown(tmp_path, yaw):
    grey = np.repeat(np.repeat(np.array([[0, 50, 100, 101, 150, 254, 255]], dtype=np.uint8), 5, axis=0), 5, axis=1)
    Image.fromarray(grey).save(tmp_path / "map.png")
    content = load_image(tmp_path / "map.png", 1.0, (0.0, 0.0, yaw), mode=MapMode.RAW)
    for known, unknown_cost in ((True, 255), (False, 0)):
        costmap = content.to_costmap(track_unknown_space=known)
        middles = [(x * np.cos(yaw) - 2.5 * np.sin(yaw), x * np.sin(yaw) + 2.5 * np.cos(yaw)) for x in range(2, 35, 5)]
        costs = [costmap.cost_at(x + 0.4, y) for x, y in middles]
        assert costs == [0, 127, 254, 254, 254, 254, unknown_cost]


def test_a_quarter_turn_of_the_origin_turns_the_map():
    content = OccupancyMap(np.array([[100, 0, 0]], dtype=np.uint8), 1.0, (5.0, 5.0, np.pi / 2))
    costmap = content.to_costmap()
    assert costmap.cells.tolist() == [[254], [0], [0]]
    assert (costmap.origin_x, costmap.origin_y) == pytest.approx((4.0, 5.0))


@pytest.mark.parametrize("yaw", [0.3, 1.0, -1.0, 2.5])
def test_a_turned_map_keeps_every_obstacle_where_it_is(yaw):
    occupancy = np.where(np.random.default_rng(2).random((20, 30)) < 0.2, 100, 0).astype(np.uint8)
    costmap = OccupancyMap(occupancy, 0.1, (2.0, 3.0, yaw)).to_costmap()
    for row, column in np.argwhere(occupancy == 100):
        u, v = (column + 0.5) * 0.1, (row + 0.5) * 0.1
        x, y = 2.0 + np.cos(yaw) * u - np.sin(yaw) * v, 3.0 + np.sin(yaw) * u + np.cos(yaw) * v
        assert costmap.cost_at(x, y) == 254
    assert np.count_nonzero(costmap.cells == 0) == pytest.approx(np.count_nonzero(occupancy == 0), rel=0.15)


def test_a_map_with_more_cells_than_asked_for_is_refused(spectrum):
    with pytest.raises(MapError, match="16 x 16 pixels are more than the limit of 255"):
        load_image(spectrum, 0.1, max_cells=255)


def test_a_turned_map_larger_than_the_limit_is_refused_before_memory_is_taken(tmp_path):
    Image.fromarray(np.full((1, 2000), 254, dtype=np.uint8)).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text("{image: map.png, resolution: 0.05, origin: [0, 0, 0.785]}")
    says = "1416 x 1415 cells, more than the limit of 1000000"
    with pytest.raises(MapError, match=rf"map\.png: rotated by 0\.785 rad it needs {says}"):
        load_map(tmp_path / "map.yaml", max_cells=1_000_000)
    with pytest.raises(ValueError, match=says):
        OccupancyMap(np.zeros((1, 2000), np.uint8), 0.05, (0.0, 0.0, 0.785)).axis_aligned(max_cells=1_000_000)
    assert load_map(tmp_path / "map.yaml").axis_aligned().occupancy.shape == (1415, 1416)


@pytest.mark.parametrize("block_cells", [1, 40, 100_000])
def test_a_map_turned_in_blocks_is_the_same_as_turned_at_once(monkeypatch, block_cells):
    occupancy = np.random.default_rng(4).choice(np.array([0, 40, 100, 150, 255], dtype=np.uint8), (17, 23))
    content = OccupancyMap(occupancy, 0.2, (1.0, 2.0, 2.2))
    at_once = content.axis_aligned()
    monkeypatch.setattr(turned_map, "BLOCK_CELLS", block_cells)
    assert np.array_equal(content.axis_aligned().occupancy, at_once.occupancy)
    assert content.axis_aligned().origin == at_once.origin


BAD_SAVES = {
    "the image's own name": ("map.png", {"image_format": "png"}, "is the name of the image"),
    "an unknown format": ("map.yaml", {"image_format": "jpg"}, "must be pgm, png or bmp"),
    "an unknown mode": ("map.yaml", {"mode": "binary"}, "mode: expected 'trinary', 'scale' or 'raw'"),
}


@pytest.mark.parametrize("case", BAD_SAVES)
def test_a_map_that_cannot_be_saved_so_is_refused_and_nothing_is_written(tmp_path, case):
    name, options, says = BAD_SAVES[case]
    with pytest.raises(MapError, match=says):
        save_map(tmp_path / name, OccupancyMap(np.zeros((3, 3), np.uint8), 0.1), **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("occupancy", [np.zeros((0, 0), np.uint8), np.zeros((3, 3), int), np.zeros(3, np.uint8)])
def test_occupancies_that_are_no_map_are_not_saved(tmp_path, occupancy):
    with pytest.raises(MapError, match="at least one cell"):
        save_map(tmp_path / "map.yaml", OccupancyMap(occupancy, 0.1))


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_a_mode_may_be_given_by_its_name(tmp_path, mode):
    save_map(tmp_path / "map.yaml", OccupancyMap(np.array([[0, 100]], np.uint8), 0.1), mode=mode)
    assert load_map(tmp_path / "map.yaml").occupancy.tolist() == [[0, 100]]


@pytest.mark.parametrize(
    ("pixel", "trinary", "raw"),
    [
        ((0, 0, 0, 255), 100, 0),
        ((255, 255, 255, 255), 0, 255),
        ((255, 255, 255, 0), UNKNOWN_OCCUPANCY, 255),
        ((0, 0, 0, 0), 100, 0),
        ((90, 90, 90, 255), UNKNOWN_OCCUPANCY, 90),
    ],
)
def test_in_mode_trinary_opacity_is_averaged_in_with_the_colours_as_nav2_does(tmp_path, pixel, trinary, raw):
    file = tmp_path / "pixel.png"
    Image.new("RGBA", (1, 1), pixel).save(file)
    assert load_image(file, 0.1).occupancy[0, 0] == trinary
    assert load_image(file, 0.1, mode=MapMode.RAW).occupancy[0, 0] == raw


@pytest.mark.parametrize(("grey", "expected"), [(70, UNKNOWN_OCCUPANCY), (30, 100)])
def test_an_opaque_dark_pixel_of_an_image_with_opacity_is_lighter_than_it_looks(tmp_path, grey, expected):
    for mode, pixel in (("RGBA", (grey, grey, grey, 255)), ("RGB", (grey, grey, grey))):
        Image.new(mode, (1, 1), pixel).save(tmp_path / f"{mode}.png")
    assert load_image(tmp_path / "RGB.png", 0.1).occupancy[0, 0] == 100
    assert load_image(tmp_path / "RGBA.png", 0.1).occupancy[0, 0] == expected
