"""Readers of elevation models: the raster facts of real files, and refusals that name file and reason."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from terrain.worlds.elevation_files import TerrainFileError, jacksboro, read_dem, read_elevation


def test_jacksboro_is_shrunk_isotropically() -> None:
    terrain = jacksboro()
    assert terrain.heights.shape == (344, 403)
    assert terrain.size[0] == pytest.approx(100.0) and 105.0 < terrain.size[1] < 108.0
    assert 0.24 < terrain.dx < 0.26 and 0.30 < terrain.dy < 0.32
    report = terrain.slope_report()  # central differences give median 13, p99 28; single triangles are steeper
    assert 11.0 < report.median < 15.0 and 26.0 < report.p99 < 30.0 and report.maximum < 50.0
    assert 2.6 < report.relief < 3.0


def test_jacksboro_has_north_at_large_y(shared_data: Path) -> None:
    terrain = jacksboro()
    z = np.load(shared_data / "terrain/dem/jacksboro.npz")["z"]
    scale = 100.0 / (402 * 74.48475549)
    assert np.allclose(terrain.heights[-1] - terrain.heights.min(), (z[0] - z.min()) * scale, atol=0.01)


def test_jacksboro_can_be_refined_and_roughened_by_seed() -> None:
    fine = jacksboro(60.0, spacing=0.2, roughness=0.02, rng=np.random.default_rng(3))
    again = jacksboro(60.0, spacing=0.2, roughness=0.02, rng=np.random.default_rng(3))
    assert fine.dx == pytest.approx(0.2, rel=0.01) and np.array_equal(fine.heights, again.heights)
    smooth = jacksboro(60.0, spacing=0.2)
    assert np.std(fine.heights - smooth.heights) == pytest.approx(0.02, rel=0.01)
    with pytest.raises(ValueError, match="generator"):
        jacksboro(roughness=0.02)


@pytest.mark.parametrize(
    ("name", "shape", "dx", "dy", "low", "high"),
    [
        ("dem/kootenai_1m.asc", (37, 50), 1.0, 1.0, 537.36, 543.81),
        ("dem/kootenai_1m.npz", (37, 50), 1.0, 1.0, 537.36, 543.81),
        ("dem/bigtujunga.tif", (643, 1197), 30.0, 30.0, 315.0, 2295.0),
        ("dem/bigtujunga.npz", (643, 1197), 30.0, 30.0, 315.0, 2295.0),
        ("dem/tidal_2m.npz", (452, 300), 2.0, 2.0, -2.609347, 8.461376),
        ("dem/N44W072.hgt", (1201, 1201), 66.2, 92.8, None, None),
        ("mars/gale_aeolis_mount_sharp_aeolis_palus_center.npz", (513, 513), 2.0215, 2.0215, -10.2085, 11.8506),
        ("mars/jezero_neretva_neretva_center.npz", (513, 513), 2.0174, 2.0174, -15.1626, 39.4124),
    ],
)
def test_real_rasters_have_their_facts(
    shared_data: Path,
    name: str,
    shape: tuple[int, int],
    dx: float,
    dy: float,
    low: float | None,
    high: float | None,
) -> None:
    terrain = read_dem(shared_data / "terrain" / name)
    assert terrain.heights.shape == shape
    assert terrain.dx == pytest.approx(dx, rel=2e-3) and terrain.dy == pytest.approx(dy, rel=2e-3)
    if low is not None:
        assert terrain.heights.min() == pytest.approx(low, abs=0.01)
        assert terrain.heights.max() == pytest.approx(high, abs=0.01)


def test_two_formats_of_one_survey_agree(shared_data: Path) -> None:
    folder = shared_data / "terrain/dem"
    for stem, ending in (("kootenai_1m", "asc"), ("bigtujunga", "tif")):
        a, b = read_dem(folder / f"{stem}.{ending}"), read_dem(folder / f"{stem}.npz")
        assert np.allclose(a.heights, b.heights, atol=0.01)


def test_voids_are_filled_from_the_nearest_sample(tmp_path: Path) -> None:
    file = tmp_path / "hole.asc"
    file.write_text("ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 2\nNODATA_value -9999\n1 2 3\n4 -9999 6\n")
    terrain = read_dem(file)
    assert terrain.heights[1].tolist() == [1, 2, 3]  # first row of the file is the north
    assert terrain.heights[0, 1] in (2, 4, 6) and terrain.dx == 2.0


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.asc", b"ncols 3\nnrows 2\n1 2 3 4 5 6\n", "cellsize"),
        ("a.asc", b"ncols 3\nnrows 2\ncellsize 1\n1 2 3\n", "expected 2 x 3 heights as in the header, got 3"),
        (
            "a.asc",
            b"ncols 3\nnrows 2\ncellsize 1\n1 2 3\n4 x 6\n",
            "line 5: expected heights with spaces between them, got 'x'",
        ),
        ("a.asc", b"ncols three\nnrows 2\ncellsize 1\n1 2 3\n", "line 1: ncols: expected a number, got 'three'"),
        ("a.asc", b"ncols 3000000\nnrows 2000000\ncellsize 1\n1\n", "the limit is"),
        ("a.asc", b"\xff\xfe\x00", "cannot be read"),
        ("N10E010.hgt", b"12345", "a square of 16-bit heights, got 5 bytes"),
        ("tile.hgt", b"12345678", "N44W072"),
        ("a.tif", b"no tiff", "cannot be read"),
        ("a.npz", b"no zip", "cannot be read"),
        ("a.las", b"", "unknown ending"),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_reason(tmp_path: Path, name: str, content: bytes, reason: str) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(TerrainFileError, match=reason) as caught:
        read_dem(file)
    assert str(file) in str(caught.value)


def test_other_refusals(tmp_path: Path) -> None:
    with pytest.raises(TerrainFileError, match="no such file"):
        read_dem(tmp_path / "missing.npz")
    np.savez(tmp_path / "x.npz", height=np.zeros((3, 3)))
    with pytest.raises(TerrainFileError, match="expected the arrays z, dx, dy, got no z, no dx, no dy"):
        read_dem(tmp_path / "x.npz")
    np.savez(tmp_path / "v.npz", z=np.full((3, 3), np.nan), dx=1.0, dy=1.0)
    with pytest.raises(TerrainFileError, match="void"):
        read_dem(tmp_path / "v.npz")
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "colour.tif")
    with pytest.raises(TerrainFileError, match="expected one band of heights, got 3"):
        read_dem(tmp_path / "colour.tif")
    Image.fromarray(np.zeros((4, 4), np.float32)).save(tmp_path / "plain.tif")
    with pytest.raises(TerrainFileError, match="33550"):
        read_dem(tmp_path / "plain.tif")


def test_an_ascii_grid_that_names_no_void_has_the_formats_own(tmp_path: Path) -> None:
    file = tmp_path / "survey.asc"
    file.write_text("ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 2\n1 2 3\n4 -9999 6\n7 8 9\n")
    assert np.isnan(read_elevation(file).heights).sum() == 1
    assert read_dem(file).heights.min() == 1.0


@pytest.mark.parametrize("ending", ["asc", "hgt", "tif", "npz"])
def test_a_raster_larger_than_allowed_is_refused_in_every_format(tmp_path: Path, ending: str) -> None:
    heights, file = np.ones((20, 20), np.int16), tmp_path / f"N44W072.{ending}"
    if ending == "asc":
        file.write_text("ncols 20\nnrows 20\ncellsize 1\n" + "1 " * 400)
    elif ending == "hgt":
        heights.astype(">i2").tofile(file)
    elif ending == "tif":
        Image.fromarray(heights.astype(np.float32)).save(file, tiffinfo={33550: (1.0, 1.0, 0.0)})
    else:
        np.savez_compressed(file, z=heights, dx=1.0, dy=1.0)
    assert read_elevation(file, 400).heights.shape == (20, 20)
    with pytest.raises(TerrainFileError, match="the limit is") as caught:
        read_elevation(file, 399 if ending != "npz" else 40)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize(("corner", "dx"), [("8.5\nyllcorner 60", 55.65), ("500000\nyllcorner 60", 0.001)])
def test_cells_of_a_grid_in_degrees_get_their_length_in_metres(tmp_path: Path, corner: str, dx: float) -> None:
    file = tmp_path / "degrees.asc"
    file.write_text(f"ncols 2\nnrows 2\nxllcorner {corner}\ncellsize 0.001\n1 2\n3 4\n")
    assert read_elevation(file).dx == pytest.approx(dx, rel=0.01)


def test_a_grid_with_more_text_than_heights_is_refused_before_it_is_read(tmp_path: Path) -> None:
    (tmp_path / "long.asc").write_text("ncols 2\nnrows 2\ncellsize 1\n1 2 3 4" + " 5" * 1000)
    with pytest.raises(TerrainFileError, match="expected 2 x 2 heights, got"):
        read_elevation(tmp_path / "long.asc")


def test_jacksboro_without_matplotlib_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"Jacksboro come with matplotlib: pip install 'mbf-flex\[sim\]'"):
        jacksboro(100.0)
