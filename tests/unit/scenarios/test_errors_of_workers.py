"""What a worker process raises arrives in the parent as itself, with its text and what it carries."""

import ast
from pathlib import Path

import pytest

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.registry import PluginError
from mbf_costmap_nav.files.map_description import MapError
from mbf_mesh_nav.mesh.mesh_report import MeshError
from terrain.sweeps.worker_pool import run_in_workers
from terrain.worlds.elevation_files import TerrainFileError

REPOSITORY = Path(__file__).resolve().parents[3]
ERRORS = {
    "ConfigError": lambda: ConfigError([Finding("robot.yaml", 3, "planners", "a list", "5")]),
    "PluginError": lambda: PluginError("planners", "magic", "there is no such plugin"),
    "MapError": lambda: MapError(Path("map.yaml"), "has no image"),
    "MeshError": lambda: MeshError("hall.ply", ["holes", "slivers"], "allow repairs"),
    "TerrainFileError": lambda: TerrainFileError("hill.tif", "is empty"),
}


def fail(name):
    raise ERRORS[name]()


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_of_a_worker_arrives_as_itself(name):
    expected = ERRORS[name]()
    with pytest.raises(type(expected)) as raised:
        list(run_in_workers(fail, [name], 1))
    assert str(raised.value) == str(expected)
    assert {key: vars(raised.value).get(key) for key in vars(expected)} == vars(expected)


def test_every_public_error_with_a_constructor_of_its_own_is_tried():
    named = set()
    for package in ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "terrain"):
        for file in (REPOSITORY / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.ClassDef) and "__init__" in {getattr(one, "name", "") for one in node.body}:
                    if any(ast.unparse(base).endswith(("Error", "Exception")) for base in node.bases):
                        named.add(node.name)
    assert {name for name in named if not name.startswith("_")} == set(ERRORS)
