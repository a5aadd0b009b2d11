"""``mbf new`` writes packages whose own tests pass."""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from command_line import mbf
from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.registry import PluginRegistry
from terrain.session.executives import make_executive
from terrain.session.session import Session, SessionOptions

REPOSITORY = Path(__file__).resolve().parents[2]
INSTALL = ("install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation")
ON_A_MAP = ("planner", "controller", "recovery", "refiner", "layer")
ON_EVERY_MAP = ("controller", "recovery", "refiner", "executive")


def test_the_tests_of_new_packages_pass(tmp_path):
    names = []
    for map_name, kinds in {"mesh": ON_A_MAP, "costmap": ON_A_MAP, "": ON_EVERY_MAP}.items():
        for kind in kinds:
            names.append(f"fresh_{map_name or 'any'}_{kind}")
            written = mbf("new", kind, names[-1], *(["--map", map_name] if map_name else []), "--out", tmp_path)
            assert written.exit_code == 0, written.output

    paths = [str(REPOSITORY), *(str(tmp_path / name) for name in names)]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-v",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        str(tmp_path),
        str(tmp_path),
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)

    assert result.returncode == 0, result.stdout + result.stderr
    for name in names:  # every package's own test ran
        assert f"{name}/tests/" in result.stdout


@pytest.mark.timeout(300)
def test_the_types_of_new_packages_are_strict(tmp_path):
    pytest.importorskip("mypy")
    paths = [str(REPOSITORY)]
    for kind, map_name in [*((kind, one) for kind in ON_A_MAP for one in ("mesh", "costmap")), ("executive", "")]:
        name = f"typed_{map_name}_{kind}"
        mbf("new", kind, name, *(["--map", map_name] if map_name else []), "--out", tmp_path)
        paths.append(str(tmp_path / name))
    files = [str(file) for file in sorted(tmp_path.rglob("*.py"))]
    assert len(files) == 2 * (len(paths) - 1)

    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, *files]
    environment = {**os.environ, "MYPYPATH": os.pathsep.join(paths)}
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_ruff_finds_the_imports_of_new_packages_sorted(tmp_path):
    pytest.importorskip("ruff")
    for map_name, kinds in {"mesh": ON_A_MAP, "costmap": ON_A_MAP, "": ON_EVERY_MAP}.items():
        for kind in kinds:
            name = f"sorted_{map_name or 'any'}_{kind}"
            mbf("new", kind, name, *(["--map", map_name] if map_name else []), "--out", tmp_path)
    assert len(list(tmp_path.rglob("*.py"))) == 2 * (2 * len(ON_A_MAP) + len(ON_EVERY_MAP))

    command = [sys.executable, "-m", "ruff", "check", "--no-cache", "--extend-select", "I", "."]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("planner", "numpy", "--map", "mesh"), "the name 'numpy' is taken by the module "),
        (("executive", "json"), "the name 'json' is taken by the module "),
        (("planner", "astar", "--map", "mesh"), "is taken by the plugin mbf_mesh_nav.planners.astar:AStarPlanner"),
        (("layer", "voxel", "--map", "costmap"), "is taken by the plugin mbf_costmap_nav.layers.voxel:VoxelLayer"),
        (("recovery", "back_up"), "is taken by the plugin mbf_abstract.maps.recoveries.back_up:BackUpRecovery"),
    ],
)
def test_a_name_that_would_replace_or_clash_with_what_is_installed_is_refused(tmp_path, arguments, text):
    refused = mbf("new", *arguments, "--out", tmp_path)
    assert refused.exit_code == 2 and text in " ".join(refused.output.split()), refused.output
    assert not list(tmp_path.iterdir())


@pytest.fixture
def fresh_environment(tmp_path):
    """Run programs of a new virtual environment that has this package, installed from a wheel, and nothing else.

    Third-party packages are borrowed from the environment of the tests by a path file; path files in that folder are
    not read, so neither the editable installation of this repository nor any plugin comes along.
    """
    venv.create(tmp_path / "venv", with_pip=True)
    programs = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(program, *arguments):
        command = [programs / program, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=variables, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    own = run("python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    (Path(own) / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    run("pip", *INSTALL, REPOSITORY)
    return run


@pytest.mark.timeout(300)
def test_a_new_plugin_is_installed_and_tested_in_a_fresh_virtual_environment(fresh_environment):
    run = fresh_environment
    run("mbf", "new", "planner", "fresh", "--map", "costmap")
    run("pip", *INSTALL, "-e", "fresh")

    listed = [line.split() for line in run("mbf", "plugins").splitlines()]
    assert ["costmap.fresh", "planners", "fresh:Fresh", "fresh", "0.1.0"] in listed
    assert "venv" in Path(run("python", "-c", "import mbf_abstract; print(mbf_abstract.__file__)")).parts
    assert "1 passed" in run("python", "-m", "pytest", "-p", "no:cacheprovider", "fresh")


def test_the_entry_point_leads_to_the_class(tmp_path, monkeypatch):
    mbf("new", "planner", "my-planner", "--map", "mesh", "--out", tmp_path)
    monkeypatch.syspath_prepend(tmp_path / "my_planner")

    project = (tmp_path / "my_planner" / "pyproject.toml").read_text()
    loaded = PluginRegistry("mesh").load("planners", "my_planner:MyPlanner")

    assert '[project.entry-points."mbf.planners"]\n"mesh.my_planner" = "my_planner:MyPlanner"' in project
    assert loaded.__name__ == "MyPlanner"


def test_without_a_map_the_type_has_no_prefix_and_is_found_on_every_backend(tmp_path):
    mbf("new", "controller", "carrot", "--out", tmp_path)

    project = (tmp_path / "carrot" / "pyproject.toml").read_text()

    assert '[project.entry-points."mbf.controllers"]\n"carrot" = "carrot:Carrot"' in project
    assert 'description = "Controller for mbf-flex on every map"' in project


def test_a_new_executive_drives_a_scenario_and_one_that_is_none_is_named(tmp_path, monkeypatch):
    mbf("new", "executive", "my_executive", "--out", tmp_path)
    monkeypatch.syspath_prepend(tmp_path / "my_executive")

    with Session("indoor", SessionOptions(backend="costmap")) as session:
        executive = make_executive("my_executive:make_tree", session.navigator)
        result = executive.drive(session.goals[0])  # around boxes that are on no map
        assert result.success, result
        with pytest.raises(ConfigError, match=r"module 'my_executive' has no attribute 'make_three'"):
            make_executive("my_executive:make_three", session.navigator)
    assert "entry-points" not in (tmp_path / "my_executive" / "pyproject.toml").read_text()


def test_the_layers_go_to_the_group_of_their_map(tmp_path):
    mbf("new", "layer", "wet", "--map", "costmap", "--out", tmp_path)

    assert '[project.entry-points."mbf.costmap_layers"]' in (tmp_path / "wet" / "pyproject.toml").read_text()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ("critic", "x", "--map", "mesh"),
            "no kind 'critic'; known: planner, controller, recovery, refiner, layer, executive",
        ),
        (("planner", "x"), "a planner needs a map: --map costmap or --map mesh"),
        (("layer", "x"), "a layer needs a map: --map costmap or --map mesh"),
        (("executive", "x", "--map", "mesh"), "an executive runs on every map: leave out --map mesh"),
        (("planner", "x", "--map", "octomap"), "no map 'octomap' is installed; known: costmap, mesh"),
        (("planner", "2fast", "--map", "mesh"), "'2fast' is not a valid module name"),
        (("planner", "class", "--map", "mesh"), "'class' is not a valid module name"),
    ],
)
def test_a_bad_argument_is_named_and_nothing_is_written(arguments, text, tmp_path):
    result = mbf("new", *arguments, "--out", tmp_path)

    assert result.exit_code == 2 and text in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_there_is_not_overwritten(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep me")

    result = mbf("new", "planner", "mine", "--map", "mesh", "--out", tmp_path)

    assert result.exit_code == 2
    assert [file.name for file in (tmp_path / "mine").iterdir()] == ["notes.txt"]
