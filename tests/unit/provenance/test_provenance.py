"""What a run's folder records: the scenario as run, the code, the command line; and what is refused when it is read."""

import subprocess
from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

from mbf_abstract.config.findings import ConfigError
from terrain.commands.command_line import command_line
from terrain.description.parameters import UrdfRobot
from terrain.experiments.evaluation.command import People
from terrain.physics.robot_models import ROBOTS
from terrain.provenance.code import commit_of, hash_of_code
from terrain.provenance.named_files import InputCopies
from terrain.provenance.provenance import (
    Provenance,
    changed_files,
    read_provenance,
    write_provenance,
    write_scenario,
)
from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.scenario import load_scenario, robot_scenarios


@pytest.mark.parametrize("name", shipped_scenarios())
def test_a_scenario_as_run_is_read_back_as_it_was(name, tmp_path):
    scenario = load_scenario(name)
    views = robot_scenarios(scenario)
    for robot in views:
        (tmp_path / robot).mkdir(exist_ok=True)
        (tmp_path / robot / "navigation.yaml").write_text("backend: mesh")

    write_scenario(tmp_path, scenario, {robot: view.backend for robot, view in views.items()}, 7, InputCopies(tmp_path))

    own = {"seed", "navigation"}
    read = load_scenario(tmp_path / "scenario.yaml")
    assert read.seed == 7
    assert list(robot_scenarios(read)) == list(views)
    for robot, as_read in robot_scenarios(read).items():
        assert as_read.model_dump(exclude=own) == views[robot].model_dump(exclude=own)
        assert as_read.navigation == {views[robot].backend: tmp_path / robot / "navigation.yaml"}


def test_a_robot_of_a_urdf_is_in_the_folder_with_the_scenario(tmp_path):
    shipped, folder = load_scenario("indoor"), tmp_path / "run"
    folder.mkdir()
    (tmp_path / "mine.urdf").write_text(ROBOTS["turtlebot"].urdf.read_text())
    robot = UrdfRobot(urdf=str(tmp_path / "mine.urdf"))

    write_scenario(folder, shipped.model_copy(update={"robot": robot}), {"": "mesh"}, 0, InputCopies(folder))

    assert str(tmp_path) not in (folder / "scenario.yaml").read_text()
    assert (folder / "inputs" / "mine.urdf").read_bytes() == (tmp_path / "mine.urdf").read_bytes()


@pytest.mark.parametrize("name", ["run", "made/../run"])
def test_meshes_of_a_robot_are_recorded_in_a_relative_folder(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = Path(name)
    for part in ("made", "run"):
        (tmp_path / part).mkdir()
    (tmp_path / "body.stl").write_text("hull")
    (tmp_path / "mine.urdf").write_text('<robot><mesh filename="body.stl"/></robot>')
    (folder / "navigation.yaml").write_text("backend: mesh")
    scenario = load_scenario("indoor").model_copy(update={"robot": UrdfRobot(urdf=str(tmp_path / "mine.urdf"))})
    write_scenario(folder, scenario, {"": "mesh"}, 0, InputCopies(folder))

    write_provenance(folder, [], "", "move_base", wall_clock=False, live_page=False)

    files = read_provenance(folder).files
    assert {"scenario.yaml", "navigation.yaml", "inputs/mine.urdf", "inputs/body.stl"} <= files.keys()
    assert changed_files(folder, read_provenance(folder)) == []


def recorded_command(*arguments):
    app, lines = typer.Typer(), []

    @app.command()
    def run(
        context: typer.Context,
        scenario: str,
        seed: int = typer.Option(-1, "--seed"),
        settings: list[str] = typer.Option([], "--set"),
        page: bool = typer.Option(True, "--page/--no-page"),
        people: People = typer.Option(People.YIELDING, "--people"),
    ):
        lines.append(command_line(context))

    app.command("other")(lambda: None)
    result = CliRunner().invoke(app, ["run", *arguments])
    assert result.exit_code == 0, result.output
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["indoor"], "mbf run indoor"),
        (["--seed", "3", "indoor"], "mbf run indoor --seed 3"),
        (["a b.yaml", "--no-page"], "mbf run 'a b.yaml' --no-page"),
        (
            ["/home/me/lab.yaml", "--set", "a=1", "--set", "b=/home/me/c.ply"],
            "mbf run lab.yaml --set a=1 --set b=c.ply",
        ),
        (["here/lab.yaml"], "mbf run here/lab.yaml"),
        (["indoor", "--people", "blind"], "mbf run indoor --people blind"),
    ],
)
def test_the_command_line_is_recorded_without_folders_of_the_machine(arguments, expected):
    assert recorded_command(*arguments) == expected


def package(folder, text="x = 1\n"):
    (folder / "plugin").mkdir(parents=True)
    (folder / "plugin" / "__init__.py").write_text(text)
    (folder / "plugin" / "gains.yaml").write_text("a: 1")
    return folder / "plugin"


def test_the_hash_of_code_is_that_of_its_files_and_not_of_caches(tmp_path):
    one, two = package(tmp_path / "one"), package(tmp_path / "two")
    (two / "__pycache__").mkdir()
    (two / "__pycache__" / "cached.pyc").write_text("anything")
    (two / ".hidden").write_text("anything")
    assert hash_of_code(one) == hash_of_code(two)

    (two / "gains.yaml").write_text("a: 2")
    assert hash_of_code(one) != hash_of_code(two)
    (two / "gains.yaml").rename(two / "other.yaml")
    assert len({hash_of_code(place) for place in (one, two, one / "__init__.py")}) == 3


def test_a_file_that_goes_while_code_is_hashed_is_no_part_of_it(tmp_path, monkeypatch):
    """An editor's copy that is there when the package is listed, and gone when it is read."""
    place = package(tmp_path)
    before = hash_of_code(place)
    copy = place / "4913"
    copy.write_text("an editor tries whether it can write here")
    really_read = Path.read_bytes

    def gone(file):
        if file == copy:
            copy.unlink()
        return really_read(file)

    monkeypatch.setattr(Path, "read_bytes", gone)
    assert hash_of_code(place) == before


def git(folder, *arguments):
    identity = ("-c", "user.name=a", "-c", "user.email=a@b")
    done = subprocess.run(["git", "-C", folder, *identity, *arguments], check=True, capture_output=True, text=True)
    return done.stdout.strip()


def test_a_commit_is_that_of_the_repository_that_tracks_the_file(tmp_path):
    place = package(tmp_path)
    assert commit_of(place) == ""
    git(tmp_path, "init", "-q")
    assert commit_of(place) == "", "an environment in a folder of somebody's repository is no part of that"

    git(tmp_path, "add", "plugin")
    git(tmp_path, "commit", "-q", "-m", "first")

    assert commit_of(place) == commit_of(place / "gains.yaml") == git(tmp_path, "rev-parse", "HEAD")


RECORDED = {
    "executive": "move_base",
    "clock": "simulated",
    "versions": {"python": "3.11"},
    "code": {"terrain": {"sha256": "0"}},
    "files": {"scenario.yaml": "1", "inputs/map.png": "2"},
}


def test_files_that_changed_or_are_missing_are_named(tmp_path):
    (tmp_path / "scenario.yaml").write_text("name: x")

    assert changed_files(tmp_path, Provenance(**RECORDED)) == ["scenario.yaml", "inputs/map.png"]


@pytest.mark.parametrize(
    ("change", "key", "expected"),
    [
        ({"clock": "lunar"}, "clock", "'simulated' or 'real'"),
        ({"files": {"../secret.txt": "1"}}, "files.../secret.txt", "inside the folder"),
        ({"files": {"/etc/passwd": "1"}}, "files./etc/passwd", "inside the folder"),
        ({"code": {"terrain": {}}}, "code.terrain.sha256", "a value"),
        ({"colour": "red"}, "colour", "a known key"),
    ],
)
def test_a_damaged_record_is_refused_with_its_key(change, key, expected, tmp_path):
    (tmp_path / "provenance.yaml").write_text(yaml.safe_dump({**RECORDED, **change}))

    with pytest.raises(ConfigError) as error:
        read_provenance(tmp_path)

    assert len(error.value.findings) == 1
    assert error.value.findings[0].key == key
    assert expected in error.value.findings[0].expected


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"the folder of a run, with provenance.yaml, got a folder without it"):
        read_provenance(tmp_path)
    with pytest.raises(ConfigError, match="no such folder"):
        read_provenance(tmp_path / "nowhere")
