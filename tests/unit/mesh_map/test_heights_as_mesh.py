"""Heightfields as maps: arrays with holes in the grid's numbering, elevation models as mesh files."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.repair import MeshError
from terrain.worlds.elevation_files import TerrainFileError, read_dem

ASC = "ncols 4\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 2\nNODATA_value -9999\n1 2 3 4\n5 6 7 8\n9 10 11 -9999\n"


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 100_000))
def test_samples_keep_their_numbers_in_the_grid_and_holes_have_none(seed):
    rng = np.random.default_rng(seed)
    heights = np.where(rng.random((5, 6)) < 0.2, np.nan, rng.random((5, 6)))
    heights[:2, :2] = 0.5

    mesh = MeshMap.from_heights(heights, 0.5, 0.25, 10.0, 20.0)

    internal = mesh.input_to_internal.reshape(heights.shape)
    assert (internal[np.isnan(heights)] == -1).all()
    iy, ix = np.nonzero(internal >= 0)
    expected = np.column_stack([10.0 + 0.5 * ix, 20.0 + 0.25 * iy, heights[iy, ix].astype(np.float32)])
    np.testing.assert_array_equal(mesh.vertices[internal[iy, ix]], expected)
    assert len(iy) == len(mesh.vertices)
    assert mesh.to_input_order(mesh.snapshot().costs).size == heights.size


def test_one_hole_is_reported_and_takes_the_faces_around_it():
    heights = np.zeros((5, 6))
    heights[2, 3] = np.nan

    mesh = MeshMap.from_heights(heights, 0.5, 0.5)

    assert (len(mesh.vertices), len(mesh.input_to_internal)) == (29, 30)
    assert mesh.report["holes"].indices.tolist() == [15]
    assert mesh.report["holes"].harmless


def test_regions_that_touch_in_one_sample_are_parted_on_request():
    heights = np.full((5, 5), np.nan)
    heights[:3, :3] = heights[2:, 2:] = 0.0

    assert MeshMap.from_heights(heights, 1.0, 1.0).components.max() == 0
    assert MeshMap.from_heights(heights, 1.0, 1.0, repair=["non_manifold_vertices"]).components.max() == 1


def test_heights_without_a_face_or_a_spacing_are_refused():
    with pytest.raises(MeshError, match="no face"):
        MeshMap.from_heights(np.full((4, 4), np.nan), 0.5, 0.5)
    for spacing in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="spacing"):
            MeshMap.from_heights(np.zeros((4, 4)), spacing, 0.5)


def write_geotiff(file) -> None:
    """The heights of ``ASC`` as a GeoTIFF with a pixel scale of 2 m."""
    tags = ImageFileDirectory_v2()
    tags[33550], tags.tagtype[33550] = (2.0, 2.0, 0.0), 12
    tags[42113], tags.tagtype[42113] = "-9999", 2
    heights = np.array([[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, -9999]], np.float32)
    Image.fromarray(heights).save(file, tiffinfo=tags)


@pytest.mark.parametrize("ending", ["asc", "tif", "npz"])
def test_an_elevation_model_is_a_mesh_whose_voids_are_holes(tmp_path, ending):
    file = tmp_path / f"hill.{ending}"
    if ending == "asc":
        file.write_text(ASC)
    elif ending == "tif":
        write_geotiff(file)
    else:
        rows = [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, np.nan]]
        np.savez(file, z=np.array(rows, dtype=np.float64), dx=2.0, dy=2.0)

    mesh = build_mesh_map(MeshMapParameters(mesh_file=str(file)))

    assert mesh.input_to_internal.shape == (12,)
    assert np.flatnonzero(mesh.input_to_internal < 0).tolist() == [3]  # the last row of the file is the southern one
    np.testing.assert_array_equal(mesh.vertices[mesh.input_to_internal[[0, 11]]], [[0, 0, 9], [6, 4, 4]])
    assert len(mesh.faces) == 10


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        (
            "a.asc",
            "ncols 3\nnrows 2\n1 2 3 4 5 6\n",
            "cannot be read as an elevation model: expected cellsize in the header, got ncols, nrows",
        ),
        ("a.asc", "ncols 2\nnrows 2\ncellsize -1\n1 2 3 4\n", "expected a cellsize above 0 in the header, got -1"),
        ("a.asc", "ncols 2\nnrows 2\ncellsize 1\n1 2\n3 x\n", "an elevation model: line 5: expected heights"),
        ("a.asc", "ncols 2\nnrows 2\ncellsize 1\nnodata_value 0\n0 0 0 0\n", "got 2 x 2 voids"),
        ("a.tif", "no tiff", "cannot be read"),
        ("a.npz", "no zip", "cannot be read"),
    ],
)
def test_a_bad_elevation_model_is_one_error_that_begins_with_its_name(tmp_path, name, content, text):
    (tmp_path / name).write_text(content)
    with pytest.raises(MeshError, match=text) as error:
        read_mesh(tmp_path / name)
    assert str(error.value).count(f"{tmp_path / name}: ") == 1
    assert len(error.value.reasons) == 1


def write_voids(file, heights, no_data):
    """Heights (n, n) in the format of a file's ending."""
    if file.suffix == ".asc":
        rows = "\n".join(" ".join(map(str, row)) for row in heights.tolist())
        file.write_text(f"ncols {len(heights)}\nnrows {len(heights)}\ncellsize 1\nNODATA_value {no_data}\n{rows}\n")
    elif file.suffix == ".hgt":
        np.nan_to_num(heights, nan=-32768).astype(">i2").tofile(file)
    elif file.suffix == ".npz":
        np.savez(file, z=heights, dx=1.0, dy=1.0)
    else:
        tags = ImageFileDirectory_v2()
        tags[33550], tags.tagtype[33550] = (1.0, 1.0, 0.0), 12
        tags[42113], tags.tagtype[42113] = str(no_data), 2
        Image.fromarray(heights.astype(np.float32)).save(file, tiffinfo=tags)


@pytest.mark.parametrize("name", ["void.asc", "void.tif", "N44W072.hgt", "void.npz"])
@pytest.mark.parametrize("value", [np.nan, -9999.0])
def test_a_file_of_voids_is_one_error_with_what_was_expected_and_what_came(tmp_path, name, value):
    file, heights = tmp_path / name, np.full((6, 6), np.nan if name[-3:] in ("hgt", "npz") else value)
    write_voids(file, heights, -9999)
    reason = (
        "expected four known heights side by side, got 6 x 6 voids; no number and the file's no-data value are voids"
    )
    with pytest.raises(MeshError) as error:
        read_mesh(file)
    assert (str(error.value), error.value.reasons) == (f"{file}: {reason}", [reason])
    with pytest.raises(TerrainFileError) as error:
        read_dem(file)
    expected = (
        "expected heights at half of the samples or more, got 36 voids of 6 x 6; no number and the file's no-data"
    )
    assert str(error.value).startswith(f"{file}: {expected}")


def test_known_heights_of_which_no_four_are_neighbours_are_counted(tmp_path):
    heights = np.full((6, 6), np.nan)
    heights[::2, ::2] = 1.0
    write_voids(tmp_path / "sparse.tif", heights, -9999)
    with pytest.raises(MeshError, match="expected four known heights side by side, got 9 known ones of 6 x 6"):
        read_mesh(tmp_path / "sparse.tif")


def test_an_elevation_model_with_too_many_faces_is_refused(tmp_path):
    (tmp_path / "hill.asc").write_text(ASC)
    with pytest.raises(MeshError, match="heights, the limit is 5"):
        read_mesh(tmp_path / "hill.asc", max_faces=10)


def test_a_server_drives_on_an_elevation_model(tmp_path):
    rows = "\n".join(" ".join(f"{0.05 * x:.2f}" for x in range(21)) for _ in range(21))
    (tmp_path / "slope.asc").write_text(f"ncols 21\nnrows 21\ncellsize 0.5\n{rows}\n")
    (tmp_path / "mesh.yaml").write_text(
        "backend: mesh\nplanners: [{name: cvp, type: cvp}]\n"
        "mesh_map: {mesh_file: slope.asc, layers: [{name: slopes, type: steepness}], slopes: {threshold: 0.5}}\n"
    )
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(1.0, 1.0, z=0.1))
    with Navigator.from_file(tmp_path / "mesh.yaml", robot, clock, transforms) as navigator:
        clock.sleep(0.1)
        assert navigator.get_path(Pose.planar(8.0, 7.0, z=0.8)).success
    robot.close()
