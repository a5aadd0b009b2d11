"""Point clouds of every format come out as the same points; whatever is wrong with a file is one clear error."""

import os
import re

import numpy as np
import pytest
from cloud_files import (
    POINTS,
    lzf_compressed,
    lzf_naive,
    refusal,
    write_las,
    write_pcd,
    write_ply,
    write_text,
)
from hypothesis import given
from hypothesis import strategies as st

from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.kernels.building.lzf import lzf_decompress
from mbf_mesh_nav.mesh.mesh_report import MeshError

PCD = (
    b"VERSION 0.7\nFIELDS a y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n"
    + bytes(24)
)
PCD_MISTAKES = [
    (b"SIZE 4 4 4", b"SIZE 4 4", "SIZE: expected 3 values, one for each of FIELDS, got 2"),
    (b"TYPE F F F", b"", "TYPE: expected 3 values, one for each of FIELDS, got 0"),
    (b"TYPE F F F", b"TYPE F Q F", "field y: TYPE Q of SIZE 4 x 1"),
    (b"COUNT 1 1", b"COUNT 1 -1", "field y: TYPE F of SIZE 4 x -1"),
    (b"WIDTH 2", b"WIDTH many", "WIDTH: expected a whole number, got 'many'"),
    (b"HEIGHT 1\n", b"", "HEIGHT: expected a whole number, got 'no such line'"),
    (b"DATA binary", b"DATA", "DATA: expected ascii, binary or binary_compressed, got ''"),
    (b"", b"", "its points have no x; they have: a, y, z"),
]
UTM = np.array([498_765.0, 5_432_100.0, 0.0])
EAST = np.array([1.0, 0.0, 0.0])
WRITERS = {
    "little.ply": write_ply,
    "big.ply": lambda file, points: write_ply(file, points, "binary_big_endian"),
    "text.ply": lambda file, points: write_ply(file, points, "ascii"),
    "binary.pcd": write_pcd,
    "text.pcd": lambda file, points: write_pcd(file, points, "ascii"),
    "compressed.pcd": lambda file, points: write_pcd(file, points, "binary_compressed"),
    "survey.las": lambda file, points: write_las(file, points, offset=np.floor(points.min(axis=0))),
    "survey.laz": lambda file, points: write_las(file, points, offset=np.floor(points.min(axis=0))),
    "blanks.xyz": write_text,
    "commas.csv": lambda file, points: write_text(file, points, ",", "X,Y,Z\n"),
    "semicolons.txt": lambda file, points: write_text(file, points, ";", "# a survey\n"),
    "counted.pts": lambda file, points: write_text(file, points, " ", f"{len(points)}\n"),
}

PLY_HEAD, TEXT_HEAD = b"ply\nformat binary_little_endian 1.0\n", b"ply\nformat ascii 1.0\n"
VERTEX = b"element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"


def cut(file, keep):
    os.truncate(file, int(keep * file.stat().st_size))
    return file


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_points_that_were_written(tmp_path, name):
    cloud = read_clouds([WRITERS[name](tmp_path / name, POINTS)])
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=1e-9)
    assert cloud.origin == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", WRITERS)
def test_coordinates_of_a_national_grid_lose_no_millimetre(tmp_path, name):
    cloud = read_clouds([WRITERS[name](tmp_path / name, POINTS + UTM)])
    assert np.abs(cloud.points).max() < 1000.0
    np.testing.assert_allclose(cloud.points + cloud.origin, POINTS + UTM, rtol=0, atol=1e-6)
    np.testing.assert_allclose(cloud.points.astype(np.float32) + np.float64(cloud.origin), POINTS + UTM, atol=5e-5)


def test_several_tiles_have_one_origin_whatever_their_order(tmp_path):
    west = write_las(tmp_path / "west.las", POINTS + UTM, offset=UTM)
    east = write_ply(tmp_path / "east.ply", POINTS + UTM + [30.0, 0.0, 0.0])
    one, other = read_clouds([west, east]), read_clouds([east, west])
    assert one.origin == other.origin == (498_700.0, 5_432_100.0, 0.0)
    assert np.ptp(one.points[:, 0]) > 55.0


def test_columns_are_found_by_their_names(tmp_path):
    file = tmp_path / "survey.csv"
    rows = "".join(f"{number};{z};{x};{y}\n" for number, (x, y, z) in enumerate(POINTS.tolist()))
    file.write_text("id;height;easting;northing\n" + rows)
    np.testing.assert_array_equal(read_clouds([file]).points, POINTS)


@pytest.mark.parametrize("head", ["X,Y,Z\r\n", ""])
def test_the_byte_order_mark_of_a_spreadsheet_is_no_part_of_the_table(tmp_path, head):
    file = tmp_path / "survey.csv"
    rows = "".join(f"{x},{y},{z}\r\n" for x, y, z in POINTS.tolist())
    file.write_bytes(("\ufeff" + head + rows).encode())
    np.testing.assert_array_equal(read_clouds([file]).points, POINTS)


def test_the_up_axis_and_the_unit_are_applied(tmp_path):
    x, y, z = (1000.0 * POINTS).T
    file = write_text(tmp_path / "millimetres.xyz", np.column_stack([x, z, -y]))
    np.testing.assert_allclose(read_clouds([file], up_axis="y", unit=0.001).points, POINTS, atol=1e-9)


@pytest.mark.parametrize(("unit", "length"), [('"metre",1', 1.0), ('"US survey foot",0.3048006096', 0.3048006096)])
def test_the_unit_of_a_las_file_is_that_of_its_coordinate_system(tmp_path, unit, length):
    text = f'PROJCS["a grid",GEOGCS["a globe",UNIT["degree",0.0174532925]],UNIT[{unit}]]'
    cloud = read_clouds([write_las(tmp_path / "survey.las", POINTS, well_known_text=text)])
    np.testing.assert_allclose(cloud.points, length * POINTS, atol=1e-6)
    assert cloud.unit == length


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_file_that_mixes_metres_and_millimetres_is_refused(tmp_path, share):
    scale = np.where(np.arange(len(POINTS)) < share * len(POINTS), 1.0, 1000.0)
    text = refusal(write_text(tmp_path / "mixed.xyz", POINTS * scale[:, None]))
    assert "mixed.xyz: expected one unit" in text and f"{share:.0%} of its points lie within 4" in text
    assert "Bring all of its points to metres first" in text


def test_a_dense_scan_in_a_wide_survey_and_a_scan_from_one_place_are_of_one_unit(tmp_path):
    rng = np.random.default_rng(2)
    wide = rng.uniform((0, 0, 0), (4000, 3000, 90), (400, 3))
    yard = rng.uniform((1500, 1200, 40), (1510, 1210, 44), (600, 3))
    far, bearing = 1.8 / np.tan(rng.uniform(0.002, 1.0, 2000)), rng.uniform(0.0, 6.3, 2000)
    scan = np.column_stack([far * np.cos(bearing), far * np.sin(bearing), 0.02 * rng.normal(size=2000)])
    for name, points in (("yard", np.vstack([wide, yard])), ("scan", scan)):
        assert len(read_clouds([write_text(tmp_path / f"{name}.xyz", points)]).points) == len(points)


def test_noise_that_the_survey_marks_is_left_out_and_reported(tmp_path):
    classes = np.where(np.arange(len(POINTS)) % 10 == 0, 7, 2)
    cloud = read_clouds([write_las(tmp_path / "survey.laz", POINTS, classes=classes)])
    assert len(cloud.points) == 360
    assert cloud.notes == ("survey.laz: 40 points are classified as noise or withheld",)


def test_pixels_of_an_organised_cloud_without_return_are_left_out(tmp_path):
    points = POINTS.copy()
    points[::4] = np.nan
    cloud = read_clouds([write_pcd(tmp_path / "camera.pcd", points, height=20)])
    np.testing.assert_array_equal(cloud.points, points[np.isfinite(points[:, 0])])
    assert cloud.notes == ("camera.pcd: 100 of 400 pixels of the organised cloud have no return",)


@pytest.mark.parametrize("name", [name for name in WRITERS if not name.endswith((".txt", ".csv", ".xyz", ".pts"))])
@pytest.mark.parametrize("keep", [0.01, 0.5, 0.99])
def test_a_truncated_file_is_refused(tmp_path, name, keep):
    file = cut(WRITERS[name](tmp_path / name, POINTS), keep)
    assert re.match(re.escape(f"{file}: "), refusal(file))


def test_a_truncated_las_file_names_what_is_missing(tmp_path):
    file = cut(write_las(tmp_path / "survey.las", POINTS), 0.5)
    assert re.search(r"the file is cut off: expected 400 points, found 1\d\d", refusal(file))


@pytest.mark.parametrize("keep", [0.95, 0.99])
def test_a_truncated_laz_file_names_what_is_missing(tmp_path, keep):
    whole = write_las(tmp_path / "survey.laz", POINTS)
    size = int(keep * whole.stat().st_size)
    text = refusal(cut(whole, keep))
    assert re.search(
        rf"the file is cut off: expected 400 compressed points up to byte \d+ and .*, found {size} bytes", text
    )


@pytest.mark.parametrize("name", [name for name in WRITERS if not name.startswith("survey")])  # LAS: whole numbers
def test_points_that_are_not_finite_are_refused_unless_they_shall_be_dropped(tmp_path, name):
    points = POINTS.copy()
    points[[7, 9]] = [[np.nan], [np.inf]]
    file = WRITERS[name](tmp_path / name, points)
    assert "2 of 400 points are not finite, the first is point 7. Leave them out with --drop-invalid" in refusal(file)
    cloud = read_clouds([file], drop_invalid=True)
    np.testing.assert_array_equal(cloud.points, np.delete(points, [7, 9], axis=0))
    assert cloud.notes == (f"{name}: 2 points that are not finite are left out",)


@pytest.mark.parametrize("form", ["binary_little_endian", "ascii"])
def test_a_header_that_promises_a_thousand_million_points_is_refused_unread(tmp_path, form):
    file = write_ply(tmp_path / "huge.ply", POINTS, form, promised=10**9)
    assert "1000000000 points, the limit is 50000000 (max_points)" in refusal(file)
    assert "the file is cut off: expected 1000000000 points, found 4" in refusal(file, max_points=2 * 10**9)


@pytest.mark.parametrize(
    ("vertices", "text"),
    [("", "there is no element 'vertex' in its header"), ("element vertex 0\nproperty float x\n", "no point in it")],
)
def test_a_ply_file_with_faces_and_no_vertex_is_refused_for_its_vertices(tmp_path, vertices, text):
    file = tmp_path / "faces.ply"
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n3 0 1 2\n"
    file.write_text(f"ply\nformat ascii 1.0\n{vertices}{faces}")
    assert text in refusal(file)


def test_a_row_of_a_pcd_file_is_named_by_its_line_in_the_file(tmp_path):
    file = write_pcd(tmp_path / "short.pcd", POINTS, "ascii")
    lines = file.read_text().splitlines()
    first = next(number for number, line in enumerate(lines, 1) if line.startswith("DATA")) + 1
    lines[first] = "1"
    file.write_text("\n".join(lines))
    assert re.search(rf"line {first + 1}: expected at least \d columns, got 1", refusal(file))


def test_a_pcd_file_cut_off_before_its_compressed_block_names_what_is_missing(tmp_path):
    file = write_pcd(tmp_path / "cut.pcd", POINTS, "binary_compressed")
    head, mark, body = file.read_bytes().partition(b"DATA binary_compressed\n")
    file.write_bytes(head + mark + body[:2])
    assert "expected the sizes of a compressed block in 8 bytes, found 2" in refusal(file)


@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_header_that_promises_too_much_is_refused_unread(tmp_path, form):
    file = write_pcd(tmp_path / "huge.pcd", POINTS, form, promised=10**9)
    assert "1000000000 points, the limit is 50000000 (max_points)" in refusal(file)


def test_a_compressed_block_that_cannot_hold_what_it_promises_is_refused_before_it_is_unpacked(tmp_path):
    file = write_pcd(tmp_path / "bomb.pcd", POINTS, "binary_compressed")
    head, _, body = file.read_bytes().partition(b"DATA binary_compressed\n")
    head = head.replace(b"WIDTH 400", b"WIDTH 40000000").replace(b"POINTS 400", b"POINTS 40000000")
    sizes = np.array([len(body) - 8, 40_000_000 * 27], "<u4").tobytes()
    file.write_bytes(head + b"DATA binary_compressed\n" + sizes + body[8:])
    assert "compressed bytes cannot hold 1080000000" in refusal(file)


def test_a_las_header_that_promises_too_much_is_refused_unread(tmp_path):
    file = write_las(tmp_path / "huge.las", POINTS)
    content = bytearray(file.read_bytes())
    content[247:255] = (10**9).to_bytes(8, "little")
    file.write_bytes(content)
    assert "1000000000 points, the limit is" in refusal(file)
    assert "the file is cut off: expected 1000000000 points, found 400" in refusal(file, max_points=2 * 10**9)


@pytest.mark.parametrize(
    ("place", "value", "text"),
    [
        (131, np.nan, "expected scales above 0 in its header, got [nan, 0.001, 0.001]"),
        (139, 0.0, "expected scales above 0 in its header, got [0.001, 0.0, 0.001]"),
        (163, np.inf, "expected finite offsets in its header, got [0.0, inf, 0.0]"),
    ],
)
def test_a_las_header_without_sound_scales_is_refused(tmp_path, place, value, text):
    file = write_las(tmp_path / "odd.las", POINTS)
    content = bytearray(file.read_bytes())
    content[place : place + 8] = np.float64(value).tobytes()
    file.write_bytes(content)
    assert text in refusal(file)


def test_the_limit_is_on_all_files_together(tmp_path):
    files = [write_text(tmp_path / f"{number}.xyz", POINTS) for number in range(3)]
    with pytest.raises(MeshError, match=r"2.xyz: 400 points, the limit is 200"):
        read_clouds(files, max_points=1000)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("", "there is no point in it"),
        ("1 2 3\n1 2\n", "line 2: expected at least 3 columns, got 2"),
        ("x;y;z\n# far\n1;2;3\n\n1;2; three\n", "line 5, column 3: expected a number, got 'three'"),
        ("name,z,y,x\na,1,2,3\nb,4,,6\n", "line 3, column 3: expected a number, got ''"),
        ("a b c\n1 2 3\n", "line 1: expected numbers or the names x, y, z, got 'a b c'"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path, content, text):
    file = tmp_path / "table.xyz"
    file.write_text(content)
    assert text in refusal(file)


def test_coordinates_that_four_bytes_cannot_hold_are_refused(tmp_path):
    file = write_ply(tmp_path / "lost.ply", POINTS + UTM, kind="float")
    assert "coordinates of 5432120 in four-byte floats are only 0.5 m exact" in refusal(file)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        (POINTS[:1], "there is a single point in it, of which no map can be made"),
        (POINTS * 1e4, "its unit is probably not the metre. Give the unit, e.g. --scale 0.001 for millimetres"),
        (POINTS * [0.0, 0.0, 1.0], "all of its points lie at one place in the plan view"),
        (POINTS * 0.001, "too small for a map. If its unit is not the metre, give it with --scale"),
        (POINTS * [1e-5, 1e-5, 10.0] + [8.05, 52.27, 60.0], "x and y look like degrees"),
    ],
)
def test_extents_that_no_map_has_are_refused(tmp_path, points, text):
    assert text in refusal(write_text(tmp_path / "odd.xyz", points))


def test_files_of_different_units_are_refused(tmp_path):
    metres, millimetres = write_text(tmp_path / "m.xyz", POINTS), write_text(tmp_path / "mm.xyz", 1000.0 * POINTS)
    with pytest.raises(MeshError, match=r"probably have different units: mm.xyz is 29\d*.?\d* m long, m.xyz 29"):
        read_clouds([metres, millimetres])
    feet = 'PROJCS["a grid",UNIT["foot",0.3048]]'
    with pytest.raises(MeshError, match=r"different units \(m.xyz none, f.las 0.3048 m\); give one unit for all"):
        read_clouds([metres, write_las(tmp_path / "f.las", POINTS, well_known_text=feet)])


def test_files_far_from_each_other_are_refused_by_name(tmp_path):
    """One of them has another coordinate system, whatever unit they state."""
    grid = 'PROJCS["a grid",UNIT["metre",1]]'
    here, there = (write_las(tmp_path / f"{x}.las", POINTS + x * EAST, well_known_text=grid) for x in (0, 50_100))
    with pytest.raises(MeshError, match=r"0.las lies 500\d\d.* m from 50100.las, expected at most 50000 m"):
        read_clouds([here, there])
    between = write_las(tmp_path / "between.las", POINTS + 25_000 * EAST, well_known_text=grid)
    assert len(read_clouds([here, between, there]).points) == 3 * len(POINTS)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.ply", b"solid\n", "is not a PLY file"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "there is no element 'vertex'"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex -4\nend_header\n", "its header promises -4 points"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex many\n", "a line that is not PLY: 'element vertex many'"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "have no y, z"),
        ("a.ply", PLY_HEAD + b"element vertex 9\nend_header\n", "its points have no properties"),
        ("a.ply", TEXT_HEAD + b"element a 999999999999\n" + VERTEX + b"end_header\n", "cut off before its points"),
        ("a.ply", PLY_HEAD + b"element vertex 9\n" + 2 * b"property float x\n" + b"end_header\n", "cannot be read"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "cut off within its header: there is no end_header"),
        *(("a.pcd", PCD.replace(old, new), text) for old, new, text in PCD_MISTAKES),
        ("a.pcd", b"nothing", "is not a PCD"),
        ("a.las", b"LASF" + bytes(100), "cut off within its header: expected at least 227 bytes, found 104"),
        ("a.las", bytes(300), "is cut off, damaged or no LAS"),
        ("a.e57", b"", "unknown ending '.e57'; known: .bt, .csv, .dae, .glb"),
    ],
)
def test_a_file_that_is_not_what_its_name_says_is_refused(tmp_path, name, content, text):
    file = tmp_path / name
    file.write_bytes(content)
    assert text in refusal(file)


def test_a_file_that_is_given_twice_is_refused_by_whatever_name(tmp_path):
    file = write_text(tmp_path / "scan.xyz", POINTS)
    (tmp_path / "link.xyz").symlink_to(file)
    with pytest.raises(MeshError, match=r"link\.xyz: is given twice"):
        read_clouds([file, tmp_path / "link.xyz"])


def test_a_missing_file_and_a_pipe_are_refused(tmp_path):
    assert "there is no such file" in refusal(tmp_path / "none.las")
    os.mkfifo(tmp_path / "pipe.xyz")
    assert "expected a file, got a pipe" in refusal(tmp_path / "pipe.xyz")


@given(st.binary(max_size=600).map(lambda block: block + block[:300] + bytes(40)))
def test_lzf_blocks_are_decompressed_as_by_the_definition(content):
    packed = lzf_compressed(content)
    out = np.zeros(len(content), dtype=np.uint8)
    assert lzf_decompress(np.frombuffer(packed, np.uint8).copy(), out) == len(content)
    assert out.tobytes() == content == lzf_naive(packed)


@given(st.binary(max_size=80), st.integers(0, 200))
def test_a_damaged_lzf_block_writes_nothing_outside(block, room):
    out = np.zeros(room + 8, dtype=np.uint8)
    written = lzf_decompress(np.frombuffer(block, np.uint8).copy(), out[:room])
    assert -1 <= written <= room
    assert not out[room:].any()
