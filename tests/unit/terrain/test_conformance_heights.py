"""Facts about elevation models that Gazebo's tests publish; the number is in the test's name.

The published files are not in the data, so files of the published shape, place and heights are written here.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from terrain.worlds.elevation_files import read_dem
from terrain.worlds.heightfield import Heightfield

PIXEL_SCALE, TIE_POINT, GEO_KEYS = 33550, 33922, 34735
DOUBLE, SHORT = 12, 3
GEOGRAPHIC = (1, 1, 0, 1, 1024, 0, 1, 2)  # one key: the raster's axes are longitude and latitude


def write_survey(file: Path, heights: np.ndarray, arc_seconds: float, longitude: float, latitude: float) -> Path:
    """Write a GeoTIFF whose north-western corner lies at a longitude and latitude [degrees]."""
    tags = ImageFileDirectory_v2()
    tags[PIXEL_SCALE], tags.tagtype[PIXEL_SCALE] = (arc_seconds / 3600.0, arc_seconds / 3600.0, 0.0), DOUBLE
    tags[TIE_POINT], tags.tagtype[TIE_POINT] = (0.0, 0.0, 0.0, longitude, latitude, 0.0), DOUBLE
    tags[GEO_KEYS], tags.tagtype[GEO_KEYS] = GEOGRAPHIC, SHORT
    Image.fromarray(heights.astype(np.float32)).save(file, tiffinfo=tags)
    return file


@pytest.fixture
def squared(tmp_path: Path) -> Heightfield:
    """129 x 129 samples, one a second of arc, with the published corners and extremes; row 0 lies in the north."""
    heights = np.random.default_rng(0).uniform(100.0, 300.0, (129, 129))
    heights[0, 0], heights[0, -1], heights[-1, 0], heights[-1, -1] = 215.82324, 216.04961, 142.2274, 209.14784
    heights[40, 50], heights[90, 20] = 65.3583, 318.441
    return read_dem(write_survey(tmp_path / "squared.tif", heights, 1.0, -122.22278, 38.001667))


def test_f349_a_survey_in_degrees_has_its_size_in_metres_and_its_extremes(squared: Heightfield) -> None:
    assert (squared.ny, squared.nx) == (129, 129)
    # Gazebo counts 129 cells; ours spans the 128 gaps between samples. Their lengths of a degree differ by 0.1 %.
    assert squared.size[1] * 129 / 128 == pytest.approx(3984.4849, rel=2e-3)
    assert squared.size[0] * 129 / 128 == pytest.approx(3139.7456, rel=2e-3)
    assert (squared.heights.min(), squared.heights.max()) == (np.float32(65.3583), np.float32(318.441))


def test_f350_the_corners_of_a_survey_lie_where_north_is_at_large_y(squared: Heightfield) -> None:
    x, y = squared.size
    corners = squared.height_at([0.0, x, 0.0, x], [y, y, 0.0, 0.0])
    assert corners == pytest.approx([215.82324, 216.04961, 142.2274, 209.14784], abs=1e-4)


def test_f352_outside_the_survey_there_is_no_height(squared: Heightfield) -> None:
    # Gazebo answers infinity. Ours is NaN, so that arithmetic with it shows; asked for a pose there, it raises.
    x, y = squared.size
    assert np.isnan(squared.height_at([-1.0, x + 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, y + 1.0])).all()
    with pytest.raises(ValueError, match="off the terrain"):
        squared.pose_at(x + 1.0, 0.0)


@pytest.mark.parametrize("shape", [(250, 30), (30, 250)], ids=["F353-portrait", "F353-landscape"])
def test_a_survey_that_is_not_square_keeps_its_shape(tmp_path: Path, shape: tuple[int, int]) -> None:
    # Gazebo pads it to a square of 257 samples, as its renderer wants one. Nothing of ours does.
    terrain = read_dem(write_survey(tmp_path / "survey.tif", np.ones(shape), 1.0, 8.0, 52.0))
    assert (terrain.ny, terrain.nx) == shape
    assert terrain.size[1] / terrain.size[0] == pytest.approx(
        (shape[0] - 1) * terrain.dy / ((shape[1] - 1) * terrain.dx)
    )


def test_f354_heights_below_the_datum_stay_below_it(tmp_path: Path) -> None:
    # The published file is of the Moon, 80.0417 m wide. Ours knows the Earth's radius only, so metres are given here.
    heights = np.linspace(-212.29616, -205.44009, 33 * 33).reshape(33, 33)
    np.savez(tmp_path / "moon.npz", z=heights, dx=80.0417 / 33, dy=80.0417 / 33)
    terrain = read_dem(tmp_path / "moon.npz")
    assert terrain.heights.shape == (33, 33)
    assert terrain.size[0] * 33 / 32 == pytest.approx(80.0417)
    assert (terrain.heights.min(), terrain.heights.max()) == (np.float32(-212.29616), np.float32(-205.44009))
