"""A file that is missing is named with the file, the line and the key which name it, by check and by run."""

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app

SCENARIO = """
name: trial
proves: Nothing.
backend: BACKEND
navigation: {mesh: nav_mesh.yaml, costmap: nav_costmap.yaml}
world:
  type: office
robot:
  turtlebot
start: {x: 3.0, y: 9.7}
goals: [{x: 5.0, y: 9.7}]
"""
CONFIGURATIONS = {
    "mesh": "mesh_map:\n  layers: []\n  mesh_file: $WORLD_MESH\n",
    "costmap": (
        "global_costmap:\n  robot_radius: 0.1\n  layers: [{name: walls, type: static}]\n"
        "  walls: {map_file: $WORLD_MAP}\nlocal_costmap: {rolling_window: true, robot_radius: 0.1, layers: []}\n"
    ),
}
PLUGINS = {"mesh": "path_follower", "costmap": "regulated_pure_pursuit"}
COMMANDS = {"check": [], "run": ["--quiet", "--out", "run"]}


@pytest.fixture
def written(tmp_path, monkeypatch):
    """``written(backend, **replaced)`` writes a scenario with its configurations."""
    monkeypatch.chdir(tmp_path)

    def write(backend, old, new):
        for name, text in CONFIGURATIONS.items():
            text = f"backend: {name}\nplanners: [{{name: a, type: astar}}]\n{text}"
            text += f"controllers: [{{name: c, type: {PLUGINS[name]}}}]\n"
            (tmp_path / f"nav_{name}.yaml").write_text(text.replace(old, new))
        (tmp_path / "trial.yaml").write_text(SCENARIO.strip().replace("BACKEND", backend).replace(old, new))

    return write


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("backend", "old", "new", "expected"),
    [
        ("mesh", "$WORLD_MESH", "gone.ply", "nav_mesh.yaml:5: mesh_map.mesh_file: expected a file, got 'gone.ply', "),
        (
            "costmap",
            "$WORLD_MAP",
            "gone.yaml",
            "nav_costmap.yaml:6: global_costmap.walls.map_file: expected a file, got 'gone.yaml', which is not there",
        ),
        (
            "costmap",
            "type: office",
            "type: map\n  file: gone.yaml",
            "trial.yaml:7: world.file: expected a map, got no file",
        ),
        ("mesh", "type: office", "type: map\n  file: .", "trial.yaml:7: world.file: expected a map, got no file"),
        ("mesh", "type: office", "type: mesh\n  file: gone.ply", "trial.yaml:7: world.file: expected a mesh to drive"),
        ("mesh", "type: office", "type: heightfield\n  file: gone.tif", "trial.yaml:7: world.file: expected an elevat"),
        ("mesh", "  turtlebot", "  gone.urdf", "trial.yaml:7: robot: expected a URDF, got 'gone.urdf' (no file"),
    ],
    ids=["mesh_file", "map_file", "map", "folder", "mesh", "heightfield", "urdf"],
)
def test_a_missing_file_has_the_line_that_names_it(written, command, backend, old, new, expected):
    written(backend, old, new)

    result = CliRunner().invoke(make_app(), [command, "trial.yaml", *COMMANDS[command]])

    assert result.exit_code == 2 and expected in result.output, result.output
    assert "mbf_check_" not in result.output and "run/" not in result.output
    assert command == "check" or "1 mistake found" in result.output


def test_a_missing_image_has_the_line_of_its_map(tmp_path):
    (tmp_path / "floor.yaml").write_text("resolution: 0.05\norigin: [0.0, 0.0, 0.0]\nimage: gone.png\n")

    result = CliRunner().invoke(make_app(), ["check", str(tmp_path / "floor.yaml")])

    expected = f"floor.yaml:3: image: expected an image, got 'gone.png' (no file {tmp_path / 'gone.png'})"
    assert result.exit_code == 2 and expected in result.output


LONG = 5000 * "x"


@pytest.mark.parametrize("name", ["gone.yaml", f"{LONG}.yaml"])
def test_a_run_of_a_file_that_is_not_there_is_one_line(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(make_app(), ["run", name])
    assert result.exit_code == 2 and f"{name}:1: expected a readable file, got " in result.output


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("nav_mesh.yaml", f"{LONG}.yaml", "trial.yaml:4: navigation.mesh: expected a configuration file, got "),
        (
            "type: office",
            f"type: mesh\n  file: {LONG}.ply",
            "trial.yaml:7: world.file: expected a mesh to drive on, got ",
        ),
        ("  turtlebot", f"  urdf: {LONG}.urdf", "trial.yaml:7: robot: expected a URDF, got "),
        ("$WORLD_MESH", f"{LONG}.ply", "nav_mesh.yaml:5: mesh_map.mesh_file: expected a file, got "),
    ],
    ids=["configuration", "world", "robot", "map"],
)
def test_a_name_that_is_too_long_for_a_file_is_named_with_its_key(written, command, old, new, place):
    written("mesh", old, new)
    result = CliRunner().invoke(make_app(), [command, "trial.yaml", *COMMANDS[command]])
    assert result.exit_code == 2 and place in result.output and "File name too long" not in result.output
