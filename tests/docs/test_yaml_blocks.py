"""Every YAML block of the pages is read without a finding by the model it belongs to, in a configuration around it."""

import importlib
import re
from pathlib import Path

import pytest
import yaml

from mbf_abstract.config.configuration import PLUGIN_LISTS
from mbf_abstract.config.reading import load_config, validate_config
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.factory import server_class
from terrain.description.parameters import UrdfRobot

DOCS = Path(__file__).resolve().parents[2] / "docs"
BLOCK = re.compile(r"^```yaml\n(.*?)^```", re.DOTALL | re.MULTILINE)
BASES = {
    "costmap": {"global_costmap": {"width": 5.0, "height": 5.0}, "local_costmap": {"width": 5.0, "height": 5.0}},
    "mesh": {"mesh_map": {"mesh_file": "hill.ply"}},
    "tiles": {"tiled_map": {"folder": "island"}},
}
"""The least configuration of each backend; validation opens no map."""
INSTALLED = {"straight_on_mesh": (PluginKind.PLANNER, "straight_on_mesh:StraightOnMesh")}
"""Types that a page's reader has installed as a package, and where they are here."""


def blocks():
    for page in sorted(DOCS.glob("*.md")):
        for number, text in enumerate(BLOCK.findall(page.read_text("utf-8"))):
            yield pytest.param(yaml.safe_load(text), id=f"{page.stem}-{number}")


def backends_of(block):
    """The backends that a block is for: the one it names, those of its sections, or else both maps."""
    if "backend" in block:
        return [block["backend"]]
    if any("costmap" in item for key in PLUGIN_LISTS for item in block.get(key, [])):
        return ["costmap"]
    return [name for name, base in BASES.items() if base.keys() & block.keys()] or ["costmap", "mesh"]


def around(block, backend):
    """The block as part of a whole configuration."""
    whole = {"backend": backend, **BASES.get(backend, {})}
    sections = {key: whole[key] | block[key] for key in whole.keys() & block.keys() if isinstance(whole[key], dict)}
    return whole | block | sections


def validated(file):
    raw = load_config(file)
    cls = server_class(raw)
    registry = cls.plugin_registry(raw.allow_module_types)
    for name, (kind, target) in INSTALLED.items():
        module, _, class_name = target.partition(":")
        registry.register(kind, name, getattr(importlib.import_module(module), class_name))
    return validate_config(raw, cls.config_sections, registry, cls.plugin_declaration, cls.map_names)


@pytest.mark.parametrize("block", blocks())
def test_a_block_is_read_without_a_finding(block, tmp_path):
    for backend in backends_of(block):
        file = tmp_path / "configuration.yaml"
        file.write_text(yaml.safe_dump(around(block, backend), sort_keys=False))

        config = validated(file)

        listed = [item["name"] for key in PLUGIN_LISTS for item in block.get(key, [])]
        assert [spec.name for spec in config.plugins] == listed


def test_blocks_are_found_and_a_mistake_in_one_is_a_finding(tmp_path):
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(around({"mesh_map": {"dense": 0.2}}, "mesh")))

    assert len(list(blocks())) > 15
    with pytest.raises(Exception, match=r"mesh_map.dense: expected a known key"):
        validated(tmp_path / "robot.yaml")


def test_the_robot_of_the_page_about_urdfs_is_one():
    texts = re.findall(r"```yml\n(.*?)```", (DOCS / "your_robot.md").read_text("utf-8"), re.DOTALL)
    short, long = (yaml.safe_load(text)["robot"] for text in texts)

    assert short == long["urdf"]
    assert UrdfRobot.model_validate(long).drive == "skid"
