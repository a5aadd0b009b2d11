"""The commands as a user calls them: what they print and how they exit."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from command_line import mbf
from mbf_abstract.commands import doctor
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from terrain.worlds.heightfield import Heightfield

OFFICE = Path(__file__).resolve().parents[2] / "terrain" / "data" / "office.yaml"
HEAVY = ("numba", "scipy", "trimesh", "pybullet", "numpy", "pydantic", "matplotlib", "viser", "rich")


@pytest.fixture(scope="module")
def hill(tmp_path_factory):
    """A mesh file of a hill, up to two metres high."""
    x, y = np.meshgrid(np.linspace(0.0, 12.0, 41), np.linspace(0.0, 12.0, 41))
    heights = 2.0 * np.exp(-((x - 6.0) ** 2 + (y - 6.0) ** 2) / 12.0)
    vertices, faces = Heightfield(heights.astype(np.float32), 0.3, 0.3).surface()
    file = tmp_path_factory.mktemp("meshes") / "hill.ply"
    trimesh.Trimesh(vertices, faces, process=False).export(file)
    return file


def test_a_plan_on_a_bare_map_is_reported_and_succeeds():
    result = mbf("plan", OFFICE, "--start", 3, 9.7, "--goal", 12, 9.7)

    assert result.exit_code == 0, result.output
    assert "SUCCESS" in result.stdout and "length_m" in result.stdout


def test_a_goal_where_the_outline_does_not_fit_is_refused_at_once(tmp_path):
    """On a map that stays as it is the planner was asked again and again until its patience was over."""
    config = tmp_path / "car.yaml"
    assert mbf("config", "costmap_car", "--map", OFFICE, "--out", config).exit_code == 0
    text, narrow = config.read_text(), "[[0.4, 0.15], [0.4, -0.15], [-0.1, -0.15], [-0.1, 0.15]]"
    assert narrow in text
    config.write_text(text.replace(narrow, "[[2.2, 0.7], [2.2, -0.7], [-0.8, -0.7], [-0.8, 0.7]]"))
    result = mbf("plan", config, "--start", 3, 9.7, "--goal", 9, 9.7)

    assert result.exit_code == 1
    assert "BLOCKED_GOAL" in result.stdout and "does not fit at the goal (9.00, 9.70" in result.stdout


@pytest.fixture(scope="module")
def half_known(tmp_path_factory):
    """A picture of 10 m x 5 m whose middle nobody has seen."""
    pixels = np.full((100, 200), 254, dtype=np.uint8)
    pixels[:, 90:110] = 205
    file = tmp_path_factory.mktemp("maps") / "half.png"
    Image.fromarray(pixels).save(file)
    return file


def test_unknown_cells_of_a_bare_map_count_as_free_and_this_is_said(half_known):
    ends = ("--start", 1, 2, "--goal", 9, 2)
    silent, free, lethal = (mbf("plan", half_known, *ends, *extra) for extra in ([], FREE, LETHAL))

    assert silent.exit_code == 0 and "2000 cells (10 %) are unknown and count as free" in silent.stderr
    assert free.exit_code == 0 and "unknown" not in free.stderr
    assert lethal.exit_code == 1 and "NO_PATH_FOUND" in lethal.stdout


FREE, LETHAL = ["--unknown", "free"], ["--unknown", "lethal"]


def test_a_configuration_says_itself_what_unknown_is(tmp_path):
    (tmp_path / "nav.yaml").write_text("backend: costmap\n")
    result = mbf("plan", tmp_path / "nav.yaml", "--start", 1, 2, "--goal", 9, 2, *FREE)

    assert result.exit_code == 2 and "track_unknown_space" in result.stderr


def test_a_bare_map_is_checked_with_the_configuration_of_plan(half_known, hill):
    for file, backend in ((half_known, "costmap"), (hill, "mesh")):
        result = mbf("check", file)
        assert result.exit_code == 0 and f"good; backend {backend}" in result.stdout, result.stderr
    assert "2000 cells (10 %) are unknown" in mbf("check", half_known).stdout


def test_a_robot_is_no_configuration_and_the_command_that_shows_it_is_named(tmp_path):
    (tmp_path / "bot.urdf").write_text("<robot name='b'><link name='base_link'/></robot>")
    result = mbf("check", tmp_path / "bot.urdf")
    assert result.exit_code == 2 and "got a robot (mbf robot show bot.urdf" in result.stderr


@pytest.mark.parametrize("unknown", [FREE, LETHAL])
def test_a_mesh_has_no_unknown_cells(hill, unknown):
    result = mbf("plan", hill, "--start", 2, 2, "--goal", 9, 9, *unknown)

    assert result.exit_code == 2 and f"got {' '.join(unknown)} with" in result.stderr and "cells" in result.stderr


def test_on_a_grid_the_third_of_three_numbers_is_the_yaw(half_known):
    result = mbf("plan", half_known, "--start", 1, 2, 1.5, "--goal", 4, 2, -0.5, "--json", "--unknown", "free")

    poses = json.loads(result.stdout)["poses"]
    assert [pose[2] for pose in poses] == [0.0] * len(poses)
    yaws = [2.0 * math.atan2(pose[5], pose[6]) for pose in (poses[0], poses[-1])]
    assert yaws == pytest.approx([1.5, -0.5])


def test_a_plan_on_a_bare_mesh_takes_the_height_of_the_ground(hill, tmp_path):
    result = mbf("plan", hill, "--start", 2, 2, "--goal", 9, 9, "--json", "--png", tmp_path / "plan.png")

    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["outcome_name"]) == (0, "SUCCESS")
    poses = np.array(answer["poses"])
    assert answer["length_m"] == pytest.approx(np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1).sum(), abs=1e-4)
    assert poses[0, 2] == pytest.approx(2.0 * np.exp(-32.0 / 12.0), abs=0.05)
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_a_plan_on_a_bare_mesh_goes_straight_where_nothing_costs(tmp_path):
    vertices, faces = heightfield_mesh(np.zeros((36, 36)), 0.2, 0.2)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "plain.ply")
    result = mbf("plan", tmp_path / "plain.ply", "--start", 1.5, 1.5, "--goal", 5.3, 3.1, "--json")
    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["outcome_name"]) == (0, "SUCCESS"), answer
    assert answer["length_m"] == pytest.approx(np.hypot(3.8, 1.6), abs=1e-4)


@pytest.fixture(scope="module")
def two_storeys(tmp_path_factory):
    """A mesh file of a floor with a hole of 2 m x 2 m, and a roof above half of it."""
    lower, upper = np.zeros((31, 31)), np.full((31, 14), 3.0)
    lower[10:21, 5:16] = np.nan
    surfaces = [heightfield_mesh(heights, 0.2, 0.2) for heights in (lower, upper)]
    parts = [trimesh.Trimesh(vertices, faces, process=False) for vertices, faces in surfaces]
    parts[1].apply_translation([3.2, 0.0, 0.0])
    file = tmp_path_factory.mktemp("meshes") / "storeys.ply"
    trimesh.util.concatenate(parts).export(file)
    return file


def test_a_plan_over_a_hole_says_that_there_is_no_ground(two_storeys):
    result = mbf("plan", two_storeys, "--start", 2, 3, "--goal", 1, 5, "--json")
    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["outcome_name"]) == (1, "OUT_OF_MAP")
    assert any("no ground at the start" in note for note in answer["notes"])


def test_a_plan_without_z_stays_on_the_lowest_free_floor_and_names_the_others(two_storeys):
    result = mbf("plan", two_storeys, "--start", 1, 1, "--goal", 5, 1, "--json")
    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["outcome_name"]) == (0, "SUCCESS"), answer
    assert np.array(answer["poses"])[:, 2] == pytest.approx(0.0, abs=1e-6)
    assert any(
        "the goal is put on the ground at z = 0.00 m; there is more at 3.00 m" in note for note in answer["notes"]
    )


def test_a_bare_image_without_description_has_cells_of_five_centimetres(tmp_path):
    image = tmp_path / 'floor: "1" #b.png'  # a name YAML would trip over
    Image.fromarray(np.full((100, 200), 254, np.uint8)).save(image)

    result = mbf("plan", image, "--start", 1, 1, "--goal", 9, 4, "--json")

    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["length_m"] == pytest.approx(np.hypot(8, 3), rel=0.1)


def test_no_path_is_exit_code_1_with_the_planners_words():
    result = mbf("plan", OFFICE, "--start", 3, 9.7, "--goal", 12, -9.7)

    assert result.exit_code == 1
    assert "OUT_OF_MAP" in result.stdout and "-9.70" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("plan", "missing.yaml", "--start", "1", "2", "--goal", "3", "4"), "no such file"),
        (("plan", OFFICE, "--start", "1", "--goal", "3", "4"), "X Y [Z] [YAW]"),
        (("plan", OFFICE, "--goal", "3", "4"), "--start"),
        (
            ("plan", OFFICE, "--start", 3, 9.7, "--goal", 12, 9.7, "--tolerance", "1e200"),
            "Invalid value for '--tolerance': Input should be less than or equal to 1000",
        ),
        (
            ("plan", OFFICE, "--start", 3, 9.7, "--goal", 12, 9.7, "--planner", "typo"),
            "for --planner: expected one of astar, dijkstra, theta_star, got 'typo'",
        ),
        (("plugins", "--kind", "wheels"), "wheels"),
        (("check", "missing.yaml"), "missing.yaml"),
    ],
)
def test_bad_arguments_are_exit_code_2_without_a_traceback(arguments, words):
    result = mbf(*arguments)

    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
    assert "Traceback" not in result.output


def test_a_file_that_is_neither_map_nor_mesh_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "broken.ply").write_text("hello")

    for name in ("notes.txt", "broken.ply"):
        result = mbf("plan", tmp_path / name, "--start", 1, 2, "--goal", 3, 4)
        assert (result.exit_code, name in result.output) == (2, True), result.output
        assert "Traceback" not in result.output


def test_a_heading_in_degrees_is_noted():
    result = mbf("plan", OFFICE, "--start", 3, 9.7, 90, "--goal", 12, 9.7)
    assert "note: the heading at the start is 90 rad, more than a turn: degrees are not meant" in result.output


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("cloud.pcd", "cloud.pcd:1: expected a configuration, map or mesh (.asc, .bmp, .dae,"),
        ("cloud.pcd", "of a point cloud, mbf map build makes a mesh, got a file that ends with '.pcd'"),
        ("photo.png", "photo.png:1: expected an image (pgm, png, bmp), got a file of another kind"),
    ],
)
def test_a_file_of_a_kind_that_is_not_read_is_refused_with_what_is(tmp_path, name, said):
    (tmp_path / name).write_text("hello")
    result = mbf("plan", tmp_path / name, "--start", 1, 2, "--goal", 3, 4)
    assert result.exit_code == 2 and said in " ".join(result.output.split()), result.output


def test_plan_and_check_report_what_was_found_in_the_mesh_and_what_was_repaired(hill, tmp_path):
    mesh = trimesh.load(hill, process=False)
    faces = np.vstack([mesh.faces, mesh.faces[-1]])
    trimesh.Trimesh(mesh.vertices, faces, process=False).export(tmp_path / "twice.ply")
    config = tmp_path / "twice.yaml"
    config.write_text(
        "backend: mesh\nmesh_map: {mesh_file: twice.ply, inscribed_radius: 0.3, repair: [duplicate_faces]}\n"
    )

    ends = ("--start", 2, 2, "--goal", 9, 9)
    plain, as_json = mbf("plan", tmp_path / "twice.ply", *ends), mbf("plan", tmp_path / "twice.ply", *ends, "--json")
    checked = mbf("check", config)

    repaired = "duplicate_faces: 1 faces have the corners of an earlier face (indices 3200) - repaired"
    coarse = "more than half the inscribed radius (0.15 m)"
    assert f"note: {repaired}" in plain.stderr and coarse in plain.stderr
    assert repaired in json.loads(as_json.stdout)["notes"]
    assert f"note: {repaired}" in checked.stdout and coarse in checked.stdout
    assert (plain.exit_code, checked.exit_code) == (0, 0)


def test_check_reports_all_mistakes_with_file_and_line(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(
        "backend: mesh\ncontroler_frequency: 20.0\nplanner_patience: -1\nplanners:\n  - {name: a, type: nope}\n"
    )

    result = mbf("check", file)

    assert result.exit_code == 2
    for words in (f"{file}:2", f"{file}:3", f"{file}:5", "controller_frequency", "nope", "mistakes found"):
        assert words in result.output, words


def test_check_finds_a_missing_map_file_of_a_configuration_without_mistakes(hill, tmp_path):
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text(f"backend: mesh\nmesh_map: {{mesh_file: {hill}}}\n")
    bad.write_text("backend: mesh\nmesh_map: {mesh_file: no_such_mesh.ply}\n")

    assert (mbf("check", good).exit_code, mbf("check", bad).exit_code) == (0, 2)
    assert "no_such_mesh.ply" in mbf("check", bad).output
    assert mbf("check", bad, "--no-load").exit_code == 0


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_tilde_in_the_name_of_a_map_is_the_home_folder(backend, half_known, hill, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(half_known.parent if backend == "costmap" else hill.parent))
    section = {
        "costmap": "global_costmap: {layers: [{name: walls, type: static}], walls: {map_file: ~FOLDER/half.png}}",
        "mesh": "mesh_map: {mesh_file: ~FOLDER/hill.ply, layers: []}",
    }[backend]
    config = tmp_path / "server.yaml"
    for folder, exit_code in (("", 0), ("nobody-of-this-name", 2)):
        config.write_text(f"backend: {backend}\n" + section.replace("FOLDER", folder))
        result = mbf("check", config)
        assert result.exit_code == exit_code, result.output
    assert f"{config}:2: " in result.output and "'~nobody-of-this-name/" in result.output


def test_check_finds_a_choice_of_maps_where_there_is_one_only_without_loading_it(hill, tmp_path):
    file = tmp_path / "robot.yaml"
    text = "backend: mesh\nrecovery_behaviors: [{{name: clear, type: clear}}]\nclear: {{costmaps: {}}}\n"
    expected = "clear.costmaps: expected \"both\", as the server has one map only, got 'local'"
    for costmaps, code in (("local", 2), ("both", 0)):
        file.write_text(text.format(costmaps) + f"mesh_map: {{mesh_file: {hill}}}\n")
        result = mbf("check", file, "--no-load")
        assert (result.exit_code, f"{file}:3: {expected}" in result.output.replace("\n", "")) == (code, code == 2)


def test_cached_layers_lie_beside_the_configuration_wherever_it_is_read_from(hill, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    file = tmp_path / "robot.yaml"
    layers = "[{name: rough, type: roughness}]"
    file.write_text(f"backend: mesh\nmesh_map: {{mesh_file: {hill}, cache_dir: cache, layers: {layers}}}\n")

    monkeypatch.chdir(tmp_path / "elsewhere")
    assert mbf("check", file).exit_code == 0

    assert len(list((tmp_path / "cache").glob("RoughnessLayer-*.npz"))) == 1
    assert not list((tmp_path / "elsewhere").iterdir())


def test_check_names_the_file_whose_layers_make_no_map(hill, tmp_path):
    file = tmp_path / "circle.yaml"
    layers = "[{name: a, type: mean, inputs: [b]}, {name: b, type: mean, inputs: [a]}]"
    file.write_text(f"backend: mesh\nmesh_map: {{mesh_file: {hill}, layers: {layers}}}\n")

    result = mbf("check", file)

    assert result.exit_code == 2
    assert f"{file}: mesh_map: layers read each other in a cycle: a -> b -> a" in result.output.replace("\n", "")


def test_plugins_lists_planners_of_both_maps():
    result = mbf("plugins", "--kind", "planners", "--json")

    names = {entry["name"] for entry in json.loads(result.stdout)}
    assert {"costmap.astar", "mesh.dijkstra"} <= names
    assert result.exit_code == 0


def test_doctor_finds_this_installation_healthy():
    result = mbf("doctor")

    assert result.exit_code == 0, result.output
    assert "python" in result.stdout and "kernel cache" in result.stdout


def test_nothing_that_doctor_imports_prints_between_its_lines():
    """PyBullet prints the time of its build when it is imported, past Python's own output."""
    done = subprocess.run([sys.executable, "-m", "mbf_abstract", "doctor"], capture_output=True, text=True)
    assert done.stdout.startswith("ok  python") and not done.stderr
    assert all(line[:4] in ("ok  ", "--  ", "!!  ", "    ") for line in done.stdout.splitlines()), done.stdout


def test_doctor_names_the_package_that_is_too_old_and_how_to_replace_it(monkeypatch):
    monkeypatch.setitem(doctor.oldest_versions(), "numpy", "99.1")

    result = mbf("doctor")

    assert result.exit_code == 1
    assert "99.1 is needed" in result.stdout and "pip install 'numpy>=99.1'" in result.stdout


def test_doctor_knows_the_least_version_of_every_package_it_looks_at():
    names = {doctor.DISTRIBUTIONS.get(name, name.replace("_", "-")) for name in doctor.NEEDED + doctor.SIMULATION}

    assert names <= set(doctor.oldest_versions())


@pytest.mark.parametrize(("command", "printed"), [("--help", "check"), ("plugins", "mesh.dijkstra")])
def test_what_needs_no_numbers_imports_nothing_heavy(command, printed):
    avoided = [name for name in HEAVY if (command, name) != ("plugins", "pydantic")]  # typer reads options with it
    code = (
        "import sys\nfrom mbf_abstract.cli import main\n"
        f"sys.argv = ['mbf', {command!r}]\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        f"print([name for name in {avoided!r} if name in sys.modules], file=sys.stderr)\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert printed in result.stdout
    assert result.stderr.strip() == "[]"
