"""``mbf map build``: from files of points to a map that is planned on, and what is left when it fails."""

import json

import numpy as np
import pytest
from cloud_files import write_las, write_pcd, write_text
from surveyed_ground import bridge, ground, hills, tree
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.building import decimation
from mbf_mesh_nav.building.map_build import build_map
from mbf_mesh_nav.building.map_facts import lines_of
from mbf_mesh_nav.files.map_header import MapHeader, read_map_header
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

UTM = np.array([498_700.0, 5_432_100.0, 0.0])


def run(*arguments):
    return CliRunner().invoke(make_app(), [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """Two tiles of hills with a tree, in a national grid."""
    rng = np.random.default_rng(4)
    points = np.vstack([ground(rng, hills), tree(rng, 8.0, 6.0, hills(8.0, 6.0))]) + UTM
    folder, west = tmp_path_factory.mktemp("survey"), points[:, 0] < UTM[0] + 8.0
    return [
        write_las(folder / "west.laz", points[west], offset=UTM),
        write_pcd(folder / "east.pcd", points[~west], "binary_compressed"),
    ]


def test_a_map_is_built_from_tiles_and_a_plan_leads_around_the_tree(tmp_path, survey):
    out = tmp_path / "map.ply"
    done = run("map", "build", *survey, "--out", out, "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["origin"] == UTM.tolist()
    assert facts["cell"] == 0.2
    assert 185.0 < facts["area"] < 193.0
    assert facts["error_rms"] < 0.025
    planned = run("plan", out, "--start", 2, 6, "--goal", 14, 6, "--json")
    assert planned.exit_code == 0, planned.output
    path = np.array(json.loads(planned.stdout)["poses"])
    assert np.hypot(path[:, 0] - 8.0, path[:, 1] - 6.0).min() > 0.45
    assert (
        "(0, 0, 0) of the map lies at (498700, 5432100, 0) of its survey (coordinate system unknown)" in planned.stdout
    )


def test_the_figures_are_printed(tmp_path, survey):
    done = run("map", "build", *survey, "--out", tmp_path / "map.ply")
    assert done.exit_code == 0, done.output
    names = [line.split()[0] for line in done.stdout.splitlines()]
    assert names == [
        "points",
        "density",
        "surface",
        "mesh",
        "holes",
        "obstacles",
        "left",
        "error",
        "heights",
        "origin",
        "coordinates",
    ]
    assert "taken as metres" in done.stdout


def floor_of(x0, x1, spacing):
    """Points of a level floor, 6 m wide, at a spacing [m]."""
    x, y = (one.ravel() for one in np.meshgrid(np.arange(x0, x1, spacing), np.arange(0.0, 6.0, spacing)))
    return np.column_stack([x, y, 0.001 * np.cos(7.0 * x + 3.0 * y)])


@pytest.mark.parametrize(("coarse", "is_told"), [(0.5, True), (0.1, False)])
def test_a_tile_that_is_too_coarse_for_the_cells_of_the_others_is_told(tmp_path, coarse, is_told):
    fine = write_text(tmp_path / "fine.xyz", floor_of(0.0, 11.0, 0.1))
    other = write_text(tmp_path / "other.xyz", floor_of(11.0, 20.0, coarse))
    facts, _, _ = build_map([fine, other], tmp_path / "map.ply")
    told = dict(lines_of(facts))["left out"]
    assert ("points too far apart for a surface, which a larger --cell joins" in told) == is_told
    assert (facts.area > 115.0) != is_told and (facts.sparse_points > 150) == is_told


def test_a_plan_on_a_built_bridge_crosses_on_the_deck_and_another_below_it(tmp_path):
    out = tmp_path / "bridge.ply"
    build_map([write_text(tmp_path / "bridge.xyz", bridge(np.random.default_rng(2)))], out)
    over = run("plan", out, "--start", 2, 6, 0.5, "--goal", 30, 6, 0.5, "--json")
    below = run("plan", out, "--start", 16, 2, 0, "--goal", 16, 10, 0, "--json")
    assert over.exit_code == below.exit_code == 0, over.output + below.output
    assert np.array(json.loads(over.stdout)["poses"])[:, 2].max() > 2.9
    assert np.array(json.loads(below.stdout)["poses"])[:, 2].max() < 0.2


def test_the_same_files_give_the_same_bytes_in_any_order(tmp_path, survey):
    for name, files in (("one", survey), ("again", survey), ("turned", survey[::-1])):
        build_map(files, tmp_path / f"{name}.ply")
    one, again, turned = ((tmp_path / f"{name}.ply").read_bytes() for name in ("one", "again", "turned"))
    assert one == again == turned


def test_the_map_file_keeps_origin_and_error(tmp_path, survey):
    facts, surface, _ = build_map(survey, tmp_path / "map.ply")
    header = read_map_header(tmp_path / "map.ply")
    assert header == MapHeader(tuple(UTM.tolist()), facts.error_rms, facts.error_95, facts.height_error)
    vertices, faces = read_mesh(tmp_path / "map.ply")
    np.testing.assert_array_equal(vertices, surface.vertices)
    np.testing.assert_array_equal(faces, surface.faces)


@pytest.mark.parametrize("content", [b"ply\ncomment mbf_origin 1 2\nend_header\n", b"ply\nend_header\n", b""])
def test_other_files_have_no_header_of_a_map(tmp_path, content):
    (tmp_path / "other.ply").write_bytes(content)
    assert read_map_header(tmp_path / "other.ply") is None


def test_a_failed_build_leaves_the_old_map_and_nothing_else(tmp_path):
    out = tmp_path / "map.ply"
    out.write_bytes(b"the old map")
    points = write_text(tmp_path / "line.xyz", np.linspace((0, 0, 0), (30, 10, 2), 500))
    done = run("map", "build", points, "--out", out)
    assert done.exit_code == 2
    assert done.stderr == f"error: {points}: all of its points lie on one line in the plan view\n"
    assert out.read_bytes() == b"the old map"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["line.xyz", "map.ply"]


def test_a_cancelled_build_leaves_the_old_map_and_nothing_else(tmp_path, survey):
    out = tmp_path / "map.ply"
    out.write_bytes(b"the old map")

    def cancel_at_the_end(step):
        if step.startswith("writing"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_map(survey, out, on_step=cancel_at_the_end)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"the old map"]


def test_where_a_map_cannot_be_written_it_is_not_begun(tmp_path, survey):
    steps = []
    for out, text in (
        (tmp_path / "map.stl", "a map is written as .ply, not as '.stl'"),
        (tmp_path / "nowhere" / "map.ply", "there is no such folder"),
    ):
        with pytest.raises(MeshError, match=text):
            build_map(survey, out, on_step=steps.append)
    (tmp_path / "cloud.ply").write_bytes(b"")
    with pytest.raises(MeshError, match="is one of the inputs, which are never changed"):
        build_map([tmp_path / "cloud.ply"], tmp_path / "cloud.ply", on_step=steps.append)
    assert steps == []


def test_a_map_that_is_a_folder_already_is_named_once(tmp_path, survey):
    (tmp_path / "map.ply").mkdir()
    with pytest.raises(MeshError, match=r"map\.ply: cannot be written: Is a directory$"):
        build_map(survey, tmp_path / "map.ply")


def test_a_package_that_decimation_needs_is_asked_for_before_a_file_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(decimation, "find_spec", lambda name: None)
    done = run("map", "build", tmp_path / "none.las", "--out", tmp_path / "map.ply", "--decimate", "0.02")
    assert done.exit_code == 2
    assert done.stderr == "error: --decimate: needs fast-simplification: pip install 'mbf-flex[maps]'\n"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--up", "w"], "expected x, y or z, got 'w'"),
        (["--step-height", "-1"], "Invalid value for --step-height: expected a number >= 0.02 and <= 2 m, got -1.0"),
        (
            ["--step-height", "1", "--clearance", "0.9"],
            "Invalid value for --step-height: expected less than the clearance of 0.9 m, got 1",
        ),
        (["--clearance", "0.2"], "Invalid value for --step-height: expected less than the clearance of 0.2 m, got 0.2"),
        (["--decimate", "5"], "Invalid value for --decimate: expected a number >= 0 and <= 1 m, got 5.0"),
        (["--scale", "inf"], "Invalid value for --scale: expected a finite length, got inf"),
        (["--from-run", "nowhere"], "error: nowhere: there is no such folder"),
        (["--report", "nowhere/page.html"], "error: nowhere/page.html: there is no such folder"),
        (["--report", "map.ply"], "error: map.ply: a report is written as .html, not as '.ply'"),
        (["--max-points", "10"], "the limit is 10 (max_points)"),
    ],
)
def test_bad_arguments_end_with_exit_code_2_and_a_text(tmp_path, survey, arguments, text):
    done = run("map", "build", *survey, "--out", tmp_path / "map.ply", *arguments)
    assert done.exit_code == 2
    assert text in " ".join(done.output.split())
    assert list(tmp_path.iterdir()) == []
