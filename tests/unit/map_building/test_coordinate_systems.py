"""The coordinate system of a map: stated by its files or given, checked, kept, and never transformed."""

import re
import sys

import pytest
from cloud_files import (
    POINTS,
    refusal,
    write_las,
)

from mbf_mesh_nav.building.clouds.coordinate_system import given_system
from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.mesh.mesh_report import MeshError


@pytest.mark.parametrize(
    ("text", "crs"),
    [
        ('PROJCS["a grid",UNIT["metre",1],AUTHORITY["EPSG","25832"]]', "EPSG:25832"),
        ('PROJCS["a  grid of Ö",GEOGCS["b",AUTHORITY["EPSG","4258"]],UNIT["metre",1]]', "a grid of ?"),
        pytest.param(f'PROJCS["a\x1b[31m{"g" * 60_000}",UNIT["metre",1]]', "a?[31m" + "g" * 194, id="long"),
        ("", ""),
    ],
)
def test_the_coordinate_system_is_the_one_that_the_file_states_or_that_is_given(tmp_path, text, crs):
    file = write_las(tmp_path / "survey.las", POINTS, well_known_text=text)
    assert read_clouds([file]).crs == crs
    assert read_clouds([file], crs="EPSG:32632").crs == "EPSG:32632"


def test_files_of_different_coordinate_systems_are_refused(tmp_path):
    files = [
        write_las(
            tmp_path / f"{code}.las", POINTS, well_known_text=f'PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","{code}"]]'
        )
        for code in (25832, 25833)
    ]
    with pytest.raises(
        MeshError, match=r"systems \(25832.las EPSG:25832, 25833.las EPSG:25833\). Transform them to one"
    ):
        read_clouds(files)


ZONE_32 = 'PROJCS["ETRS89 / UTM zone 32N",UNIT["metre",1]]'


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ('PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","25832"]]', "EPSG:25833"),
        ('PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","25832"]]', "EPSG:25833+7837"),
        ('PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","25832"]]', "EPSG:31466"),
        ('PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","25832"]]', "EPSG:23032"),
        ('PROJCS["a",UNIT["metre",1],AUTHORITY["EPSG","25832"]]', "+proj=utm +zone=31 +ellps=GRS80"),
        (ZONE_32, "EPSG:25833"),
    ],
)
def test_a_given_coordinate_system_that_contradicts_that_of_a_file_is_refused(tmp_path, text, given):
    file = write_las(tmp_path / "survey.las", POINTS, well_known_text=text)
    expected = (
        r"the files state another coordinate system \(survey.las .*\) than the one given .*Leave crs out, or transform"
    )
    with pytest.raises(MeshError, match=f"(?s){expected}"):
        read_clouds([file], crs=given)


@pytest.mark.parametrize("given", ["EPSG:25832", "EPSG:25832+7837", "EPSG:32632", "+proj=utm +zone=32 +ellps=GRS80"])
@pytest.mark.parametrize("text", [ZONE_32, 'PROJCS["zone 32",UNIT["metre",1]]'])
def test_a_given_coordinate_system_of_the_same_places_is_kept_with_a_note(tmp_path, text, given):
    cloud = read_clouds([write_las(tmp_path / "survey.las", POINTS, well_known_text=text)], crs=given)
    assert cloud.crs == given
    assert [note.split(",")[1] for note in cloud.notes] == [f" the map keeps {given} as given"]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("EPSG:1164", "crs: the EPSG register has no such system, got 'EPSG:1164'"),
        ("+proj=mercury +lat_0=3", "crs: PROJ knows no such system, got '+proj=mercury +lat_0=3'"),
        ('PROJCS["a grid",UNIT["metre",1]]', "crs: PROJ knows no such system, got"),
        ("EPSG:7837", "crs: EPSG:7837 is of heights alone"),
    ],
)
def test_a_coordinate_system_that_does_not_exist_is_refused(given, text):
    with pytest.raises(MeshError, match=re.escape(text)):
        given_system(given)


def test_a_coordinate_system_that_cannot_be_checked_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(MeshError, match=r"needs pyproj: pip install 'mbf-flex\[maps\]'"):
        given_system("EPSG:25832")


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("epsg:25832", "EPSG:25832"),
        ("EPSG:25832+7837", "EPSG:25832+7837"),
        ("urn:ogc:def:crs:EPSG::25832", "EPSG:25832"),
        ("+proj=utm +zone=32 +ellps=GRS80 +units=m +no_defs", "+proj=utm +zone=32 +ellps=GRS80 +units=m +no_defs"),
        ('PROJCS["a grid",UNIT["metre",1],\n AUTHORITY["EPSG","25832"]]', "EPSG:25832"),
        ('PROJCRS["a grid",BASEGEOGCRS["b"],ID["EPSG",25832]]', "EPSG:25832"),
        (f'LOCAL_CS["the yard",UNIT["metre",1],EXTENSION["{"x" * 300}"]]', "the yard"),
    ],
)
def test_a_given_coordinate_system_is_kept_by_its_code_or_name(given, kept):
    assert given_system(given) == kept


@pytest.mark.parametrize(
    "given",
    ["banana", "25832", "EPSG:abc", 'PROJCS["x', "+proj=", "+zone=32", "two\nlines"],
)
def test_what_is_no_coordinate_system_is_refused_before_a_file_is_read(tmp_path, given):
    text = refusal(tmp_path / "none.las", crs=given)
    assert text.startswith("crs: expected a code such as EPSG:25832, well-known text or a PROJ string")
    assert text.endswith(f"got {given!r}")


@pytest.mark.parametrize("given", ["EPSG:99999999", "EPSG:12", "EPSG:25832+1", "urn:ogc:def:crs:EPSG::40000"])
def test_a_code_that_epsg_does_not_give_is_refused_as_one(tmp_path, given):
    text = refusal(tmp_path / "none.las", crs=given)
    assert text == f"crs: expected a code of EPSG from 1024 to 32766, got {given!r}"


@pytest.mark.parametrize(
    "given",
    [
        "EPSG:4326",
        "EPSG:7844",
        "EPSG:4903",
        "+proj=longlat +datum=WGS84",
        'GEOGCS["a globe",UNIT["degree",0.017]]',
        'COMPD_CS["a globe + heights",GEOGCS["a globe",UNIT["degree",0.017]],VERT_CS["heights",UNIT["metre",1]]]',
    ],
)
def test_no_map_is_in_degrees(given):
    with pytest.raises(MeshError, match="is in degrees, a map is in metres"):
        given_system(given)


@pytest.mark.parametrize("given", ["EPSG:4978", "+proj=geocent +ellps=WGS84", 'GEOCCS["a globe",UNIT["metre",1]]'])
def test_no_map_is_around_the_centre_of_the_earth(given):
    with pytest.raises(MeshError, match="has its origin in the earth's centre, where z is not up"):
        given_system(given)


@pytest.mark.parametrize(
    ("given", "zone"), [("+proj=utm +zone=99", "99"), ("+zone=0 +proj=utm", "0"), ("+proj=utm +zone=32N", "32N")]
)
def test_a_zone_that_there_is_not_is_refused(given, zone):
    with pytest.raises(MeshError, match=f"crs: expected a zone of UTM from 1 to 60, got '{zone}'"):
        given_system(given)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            'COMPD_CS["both",GEOGCS["a globe",UNIT["degree",0.017]],VERT_CS["b",UNIT["metre",1]]]',
            "its coordinates are degrees",
        ),
        ('GEOGCS["a globe",UNIT["degree",0.0174532925]]', "its coordinates are degrees"),
        (
            'COMPD_CS["both",PROJCS["a",UNIT["metre",1]],VERT_CS["b",UNIT["foot",0.3048]]]',
            "mixes units (1 m, 0.3048 m)",
        ),
    ],
)
def test_a_las_file_in_degrees_or_mixed_units_is_refused(tmp_path, text, reason):
    assert reason in refusal(write_las(tmp_path / "survey.las", POINTS, well_known_text=text))


@pytest.mark.parametrize(("vertical", "is_mixed"), [(9001, False), (9002, True)])
def test_a_las_file_whose_keys_give_heights_another_unit_is_refused(tmp_path, vertical, is_mixed):
    file = write_las(tmp_path / "survey.las", POINTS, geo_keys=((3072, 25832), (3076, 9001), (4099, vertical)))
    if is_mixed:
        assert "mixes units (1 m, 0.3048 m)" in refusal(file)
    else:
        assert read_clouds([file]).crs == "EPSG:25832"
