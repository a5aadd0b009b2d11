"""Coordinates of another survey than that of the map are refused, with what to give instead."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_abstract.commands.coordinates import Place
from mbf_abstract.commands.survey_places import refuse_elsewhere
from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry.survey import Survey

UTM = Survey((376328.5, 3788642.0, 0.0), crs="EPSG:32611")
UNKNOWN = Survey((376328.5, 3788642.0, 0.0))
DEGREES = Survey((-72.0, 44.0, 0.0), (80_000.0, 111_320.0), "EPSG:4326")
ESRI = "ncols 3\nnrows 3\nxllcorner 500000\nyllcorner 5400000\ncellsize 1\n" + "0 0 0\n" * 3


@pytest.mark.parametrize(
    ("survey", "place", "hint"),
    [
        (UTM, (-118.2, 34.3), "Transformer.from_crs(4326, 'EPSG:32611', always_xy=True).transform(-118.2, 34.3)"),
        (UTM, (0.0, 9e6), ""),
        (UTM, (3788650.0, 376330.0), "easting comes before northing"),
        (UNKNOWN, (-118.2, 34.3), "degrees have to be transformed into the coordinates of the survey"),
        (DEGREES, (44.3, -71.5), "longitude comes before latitude"),
        (DEGREES, (376328.0, 3788642.0), "this map takes degrees: LON LAT"),
    ],
)
def test_a_place_in_other_coordinates_is_refused_with_what_is_meant(survey, place, hint):
    with pytest.raises(ConfigError) as refused:
        refuse_elsewhere(survey, Path("valley.tif"), start=Place(*place), goal=Place(*survey.origin))
    (finding,) = refused.value.findings
    assert finding.expected.startswith("--start near (") and hint in finding.hint and bool(hint) == bool(finding.hint)


@pytest.mark.parametrize("survey", [UTM, UNKNOWN, DEGREES])
@pytest.mark.parametrize("place", [(0.0, 0.0), (79_000.0, 111_000.0), (-1000.0, -1000.0)])
def test_places_on_and_beside_the_map_are_taken(survey, place):
    """A tile of SRTM is 137 km from corner to corner; what is beside a map has a verdict of its planner."""
    assert refuse_elsewhere(survey, Path("valley.tif"), start=Place(*survey.from_map(*place))) is None


def test_degrees_on_a_map_in_metres_are_one_error_of_a_plan(tmp_path):
    (tmp_path / "valley.asc").write_text(ESRI)
    options = ["--survey", "--start", "9.1", "48.7", "--goal", "500001.2", "5400001.5"]
    planned = CliRunner().invoke(make_app(), ["plan", str(tmp_path / "valley.asc"), *options])
    assert planned.exit_code == 2 and "1 mistake found" in planned.output
    assert "expected --start near (500000.5, 5400000.5), where the map begins in its survey (?)" in planned.output
