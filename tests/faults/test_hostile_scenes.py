"""Fault table, row 30: scenes made to harm: entities, other people's files, pictures that are programs, names."""

import base64
import json
import os
import re
import tracemalloc

import numpy as np
import pytest
import trimesh
import yaml
from PIL import EpsImagePlugin

from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.server import MeshNavigationServer

HILL, FACES = heightfield_mesh(0.1 * np.random.default_rng(3).random((4, 4)), 0.5, 0.5)
SECRET = "9876543210"


def collada(folder, prologue="", inside=""):
    """A COLLADA file with a prologue before its root, and ``inside`` as the name of its author."""
    file = folder / "hill.dae"
    trimesh.Trimesh(HILL, FACES, process=False).export(file)
    text = file.read_text()
    start = text.index("<COLLADA")
    text = text[:start] + prologue + text[start:].replace("<asset>", f"<asset><title>{inside}</title>", 1)
    file.write_text(text)
    return file


def laughs(levels: int) -> str:
    lines = [f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, levels)]
    return '<!DOCTYPE COLLADA [<!ENTITY l0 "ha">' + "".join(lines) + "]>"


def test_entities_that_grow_without_end_take_no_memory(tmp_path):
    file = collada(tmp_path, laughs(12), "&l11;")
    tracemalloc.start()
    try:
        read_mesh(file)
    except MeshError as error:
        assert len(str(error)) < 1000
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()


def test_entities_that_name_other_files_bring_nothing_of_them(tmp_path):
    (tmp_path / "secret").write_text(SECRET)
    prologue = f'<!DOCTYPE COLLADA [<!ENTITY secret SYSTEM "file://{tmp_path / "secret"}">]>'
    file = collada(tmp_path, prologue)
    text = file.read_text()
    first = text.index(">", text.index("<float_array")) + 1
    file.write_text(text[:first] + "&secret; " + text[first:])
    try:
        assert float(SECRET) not in read_mesh(file, up_axis="z")[0]
    except MeshError as error:
        assert SECRET not in str(error)


@pytest.mark.parametrize("unit", ['<unit meter="&secret;"/>', "<up_axis>&secret;</up_axis>"])
def test_axes_and_unit_are_read_without_entities(tmp_path, unit):
    (tmp_path / "secret").write_text(SECRET)
    file = collada(tmp_path, f'<!DOCTYPE COLLADA [<!ENTITY secret SYSTEM "file://{tmp_path / "secret"}">]>')
    text = file.read_text()
    file.write_text(text.replace("<asset>", f"<asset>{unit}", 1))
    try:
        read_mesh(file)
    except MeshError as error:
        assert SECRET not in str(error)


@pytest.mark.parametrize(
    "name", ["../secret.bin", "{folder}/secret.bin", "link.bin", "pipe.bin", "file://{folder}/secret.bin"]
)
def test_a_gltf_reads_numbers_from_its_own_folder_only(tmp_path, name):
    (tmp_path / "maps").mkdir()
    parts = trimesh.Trimesh(HILL, FACES, process=False).export(file_type="gltf", embed_buffers=True)
    document = json.loads(parts["model.gltf"])
    content = b"".join(base64.b64decode(one["uri"].partition(",")[2]) for one in document["buffers"])
    if len(document["buffers"]) > 1:
        starts = np.cumsum([0] + [one["byteLength"] for one in document["buffers"]])
        for view in document["bufferViews"]:
            view["byteOffset"] = view.get("byteOffset", 0) + int(starts[view["buffer"]])
            view["buffer"] = 0
    (tmp_path / "secret.bin").write_bytes(content)
    (tmp_path / "maps" / "link.bin").symlink_to(tmp_path / "secret.bin")
    os.mkfifo(tmp_path / "maps" / "pipe.bin")
    (tmp_path / "maps" / "own.bin").write_bytes(content)

    def named(uri):
        document["buffers"] = [{"byteLength": len(content), "uri": uri}]
        (tmp_path / "maps" / "hill.gltf").write_text(json.dumps(document))
        return tmp_path / "maps" / "hill.gltf"

    assert len(read_mesh(named("own.bin"))[1]) == len(FACES)
    with pytest.raises(MeshError, match=r"is not a file of numbers beside the mesh|No such file"):
        read_mesh(named(name.format(folder=tmp_path)))


@pytest.mark.parametrize("ending", ["obj", "ply", "dae"])
def test_pictures_that_a_mesh_names_are_not_opened(tmp_path, monkeypatch, ending):
    victim, ghostscript = tmp_path / "victim", tmp_path / "gs"
    ghostscript.write_text(f"#!/bin/sh\ntouch {victim}\n")
    ghostscript.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(EpsImagePlugin, "gs_binary", None)
    (tmp_path / "skin.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 20 20\n%%EndComments\n%%EOF\n")
    os.mkfifo(tmp_path / "pipe.mtl")
    file = tmp_path / f"hill.{ending}"
    if ending == "obj":
        file.write_text("mtllib pipe.mtl\nusemtl skin\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
    elif ending == "ply":
        trimesh.Trimesh(HILL, FACES, process=False).export(file)
        file.write_bytes(
            file.read_bytes().replace(b"\nelement vertex", b"\ncomment TextureFile skin.png\nelement vertex", 1)
        )
    else:
        image = '<library_images><image id="skin"><init_from>skin.png</init_from></image></library_images>'
        text = collada(tmp_path).read_text()
        file.write_text(text.replace("<library_effects", image + "<library_effects", 1))
    assert len(read_mesh(file)[1]) in (1, len(FACES))
    assert not victim.exists()


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", "a\nb", "{0.__class__}", "../../up", "\x1b[2J"])
def test_names_of_parts_are_only_text(tmp_path, name):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.Trimesh(HILL, FACES, process=False), node_name=name, geom_name="ground")
    scene.export(tmp_path / "hill.glb")
    with pytest.raises(MeshError, match="no part 'cellar', the parts are: "):
        read_mesh(tmp_path / "hill.glb", "cellar")
    assert MeshMapParameters(mesh_file=name).mesh_file == name


def test_a_mesh_whose_name_is_yaml_is_only_a_name(tmp_path):
    file = tmp_path / "a: !!python_object [b], '#c.ply"
    text = MeshNavigationServer.config_for_map(file)
    assert text is not None and yaml.safe_load(text)["mesh_map"]["mesh_file"] == str(file)


def unfolding(folder, levels, each=10):
    """A COLLADA file whose node of each level uses the one below ``each`` times; the lowest one holds the mesh."""
    file = collada(folder)
    text = file.read_text()
    geometry = re.search(r"<instance_geometry.*?</instance_geometry>", text, re.S).group(0)
    nodes = [f'<node id="l0">{geometry}</node>']
    for level in range(1, levels):
        uses = f'<instance_node url="#l{level - 1}"/>' * each
        nodes.append(f'<node id="l{level}">{uses}</node>')
    text = text.replace(geometry, f'<instance_node url="#l{levels - 1}"/>')
    file.write_text(
        text.replace(
            "<library_visual_scenes>", f"<library_nodes>{''.join(nodes)}</library_nodes><library_visual_scenes>"
        )
    )
    return file


def test_a_collada_scene_is_not_unfolded_before_its_uses_are_counted(tmp_path):
    file = unfolding(tmp_path, 10)
    tracemalloc.start()
    with pytest.raises(MeshError, match="1000000000 uses of geometries through its nodes, the limit is 100000"):
        read_mesh(file)
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()


def test_a_collada_scene_of_few_uses_is_read(tmp_path):
    assert len(read_mesh(unfolding(tmp_path, 3, each=2))[1]) == 4 * len(FACES)


def test_collada_nodes_that_instance_each_other_in_a_cycle_are_refused(tmp_path):
    file = unfolding(tmp_path, 3)
    file.write_text(file.read_text().replace('<node id="l1">', '<node id="l1"><instance_node url="#l2"/>'))
    with pytest.raises(MeshError, match="its nodes instance each other in a cycle"):
        read_mesh(file)
