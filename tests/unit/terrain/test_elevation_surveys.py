"""Where elevation models lie: tie points, corners, names of tiles, and plans in the coordinates of a survey."""

import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.files.surveys import survey_of as survey_of_map
from terrain.worlds.elevation_files import read_elevation
from terrain.worlds.elevation_surveys import survey_of

AREA, POINT = (1025, 0, 1, 1), (1025, 0, 1, 2)
UTM_32 = [(1024, 0, 1, 1), (3072, 0, 1, 25832), (3076, 0, 1, 9001)]
FLORIDA_EAST_FEET = [(1024, 0, 1, 1), (3072, 0, 1, 2236), (3076, 0, 1, 9003)]
DEGREES = [(1024, 0, 1, 2), (2048, 0, 1, 4258)]


def geotiff(file, heights, size, tie, keys):
    """Write heights (ny, nx) with the northern row first."""
    stored = [1, 1, 0, len(keys), *(number for key in keys for number in key)]
    tags = {33550: (size, size, 0.0), 33922: tie, 34735: stored}
    Image.fromarray(np.asarray(heights, np.float32)).save(file, tiffinfo=tags)
    return file


@pytest.mark.parametrize(
    ("size", "tie", "keys", "origin", "unit", "crs"),
    [
        (2.0, (0.0, 0.0, 0.0, 500000.0, 5400100.0, 0.0), [*UTM_32, AREA], (500001.0, 5400081.0), 1.0, "EPSG:25832"),
        (2.0, (0.0, 0.0, 0.0, 500000.0, 5400100.0, 0.0), [*UTM_32, POINT], (500000.0, 5400082.0), 1.0, "EPSG:25832"),
        (2.0, (3.0, 4.0, 0.0, 500006.0, 5400092.0, 0.0), UTM_32, (500001.0, 5400081.0), 1.0, "EPSG:25832"),
        (10.0, (0.0, 0.0, 0.0, 6e5, 5e5, 0.0), FLORIDA_EAST_FEET, (600005.0, 499905.0), 0.3048006, "EPSG:2236"),
        (1.0, (0.0, 0.0, 0.0, 10.0, 20.0, 0.0), [], (10.5, 10.5), 1.0, ""),
    ],
)
def test_a_geotiff_states_its_south_western_sample_its_unit_and_its_system(
    size, tie, keys, origin, unit, crs, tmp_path
):
    file = geotiff(tmp_path / "dem.tif", np.zeros((10, 8)), size, tie, keys)

    survey = survey_of(file)

    assert survey.origin == (*origin, 0.0) and survey.crs == crs
    assert survey.units == pytest.approx((unit, unit))
    assert read_elevation(file).dx == pytest.approx(size * unit)


def test_degrees_have_their_length_at_the_middle_of_the_raster(tmp_path):
    file = geotiff(
        tmp_path / "dem.tif", np.zeros((11, 11)), 0.001, (0.0, 0.0, 0.0, 8.0, 60.0055, 0.0), [*DEGREES, AREA]
    )
    survey, elevation = survey_of(file), read_elevation(file)
    assert survey.origin == pytest.approx((8.0005, 59.995, 0.0)) and survey.crs == "EPSG:4258"
    assert survey.units == pytest.approx((55_660.0, 111_320.0))
    assert survey.to_map(8.0105, 60.005) == pytest.approx((10 * elevation.dx, 10 * elevation.dy))
    assert survey.from_map(*survey.to_map(8.003, 60.001)) == pytest.approx((8.003, 60.001))


@pytest.mark.parametrize(
    ("header", "origin"),
    [
        ("xllcorner 100\nyllcorner 200", (101.0, 201.0, 0.0)),
        ("xllcenter 100\nyllcenter 200", (100.0, 200.0, 0.0)),
        ("xllcorner 100", None),
    ],
)
def test_a_corner_of_an_ascii_grid_is_that_of_a_cell(header, origin, tmp_path):
    file = tmp_path / "dem.asc"
    file.write_text(f"ncols 2\nnrows 2\n{header}\ncellsize 2\n1 2\n3 4\n")
    survey = survey_of(file)
    assert (None if survey is None else survey.origin) == origin
    assert survey is None or survey.units == (1.0, 1.0)


def test_real_rasters_lie_where_their_surveys_say(shared_data):
    folder = shared_data / "terrain/dem"
    assert survey_of(folder / "N44W072.hgt").origin == (-72.0, 44.0, 0.0)
    assert survey_of(folder / "bigtujunga.tif").crs == "EPSG:32611"
    assert survey_of(folder / "kootenai_1m.asc") is not None
    assert survey_of(folder / "kootenai_1m.npz") is None


@pytest.mark.parametrize("corner", ["nan", "inf"])
def test_a_corner_that_is_no_number_is_no_survey(corner, tmp_path):
    file = tmp_path / "dem.asc"
    file.write_text(f"ncols 2\nnrows 2\nxllcorner {corner}\nyllcorner 0\ncellsize 2\n1 2\n3 4\n")
    assert survey_of_map(str(file)) is None


def plan(*arguments):
    return CliRunner().invoke(make_app(), ["plan", *map(str, arguments)])


def test_a_plan_in_coordinates_of_the_survey_is_that_of_the_map_moved_there(tmp_path):
    tie = (0.0, 0.0, 0.0, 500000.0, 5400010.0, 0.0)
    file = geotiff(tmp_path / "dem.tif", np.zeros((21, 21)), 0.5, tie, [*UTM_32, AREA])
    x, y = 500000.25, 5399999.75

    here = plan(file, "--start", 2, 2, "--goal", 8, 6, "--json")
    there = plan(file, "--start", x + 2, y + 2, "--goal", x + 8, y + 6, "--json", "--survey")
    lost = plan(file, "--start", x + 2, y + 2, "--goal", 8, 6)

    assert here.exit_code == there.exit_code == 0, there.output
    on_map, surveyed = (np.array(json.loads(one.stdout)["poses"]) for one in (here, there))
    assert np.allclose(surveyed - on_map, [x, y, 0, 0, 0, 0, 0])
    notes = "\n".join(json.loads(there.stdout)["notes"])
    assert "(0, 0, 0) of the map lies at (500000.25, 5399999.75, 0) of its survey (EPSG:25832)" in notes
    assert "the goal is at (8.00, 6.00) of the map" in notes
    assert lost.exit_code == 1 and "--survey takes coordinates of the survey" in lost.output


def test_longitude_and_latitude_are_coordinates_of_a_survey(tmp_path):
    step = 1e-5
    file = geotiff(tmp_path / "dem.tif", np.zeros((21, 21)), step, (0.0, 0.0, 0.0, 8.0, 50.0, 0.0), [*DEGREES, POINT])
    south = 50.0 - 20 * step

    result = plan(
        file, "--start", 8 + 5 * step, south + 5 * step, "--goal", 8 + 15 * step, south + 5 * step, "--json", "--survey"
    )

    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["length_m"] == pytest.approx(10 * step * 71_556, rel=0.01)
    assert answer["poses"][-1][:2] == pytest.approx((8 + 15 * step, south + 5 * step), abs=1e-9)


def test_a_map_that_states_no_survey_takes_no_coordinates_of_one(tmp_path):
    Image.fromarray(np.full((40, 40), 254, np.uint8)).save(tmp_path / "floor.png")
    result = plan(tmp_path / "floor.png", "--start", 0.5, 0.5, "--goal", 1.5, 1.5, "--survey")
    assert result.exit_code == 2
    assert "floor.png:1: expected a map whose file states its survey" in result.output
