"""Files that texts name are found, hashed and copied so that the copy needs nothing outside of its folder."""

import json
import os
import shutil
import tempfile
from pathlib import Path

import yaml
from hypothesis import given
from hypothesis import strategies as st

from terrain.description.mesh_files import MAX_BYTES
from terrain.provenance.named_files import InputCopies, hash_with_named_files, with_named_files

NAMES = ("a.yaml", "b.yaml", "c.yaml", "image.png")
LINKS = st.fixed_dictionaries({name: st.lists(st.sampled_from(NAMES), max_size=3) for name in NAMES[:3]})
FOLDERS = st.lists(st.sampled_from(["", "x", "y"]), min_size=len(NAMES), max_size=len(NAMES))


def expanded(file, above=()):
    """Content of a file with the content of what it names in place of the names, read in the plainest manner."""
    if file.suffix != ".yaml":
        return file.read_bytes()
    if file in above:
        return "itself"
    texts = yaml.safe_load(file.read_text())["files"]
    return [expanded(Path(os.path.normpath(file.parent / text)), (*above, file)) for text in texts]


def write(folder, links, folders, absolute):
    files = {name: folder / below / name for name, below in zip(NAMES, folders, strict=True)}
    for name, file in files.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        texts = [str(files[to]) if absolute else os.path.relpath(files[to], file.parent) for to in links.get(name, ())]
        file.write_text(yaml.safe_dump({"files": texts}) if name in links else "pixels")
    return files["a.yaml"]


@given(links=LINKS, folders=FOLDERS, absolute=st.booleans())
def test_a_copy_holds_all_that_the_original_names(links, folders, absolute):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        (folder / "run").mkdir()
        original = write(folder / "originals", links, folders, absolute)
        content, named = expanded(original), {file.name for file in with_named_files(original)}

        copy = folder / "run" / InputCopies(folder / "run").copy(original)
        shutil.rmtree(folder / "originals")

        assert expanded(copy) == content
        assert {file.name for file in copy.parent.iterdir()} == named


def test_two_files_of_one_name_become_two_copies(tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "map.png").write_text(folder)
    value = {"maps": ["one/map.png", "two/map.png", "one/map.png"], "name": "map.png"}

    renamed = InputCopies(tmp_path).renamed(value, tmp_path)

    assert renamed == {"maps": ["inputs/map.png", "inputs/map_2.png", "inputs/map.png"], "name": "map.png"}
    assert [(tmp_path / name).read_text() for name in renamed["maps"][:2]] == ["one", "two"]


def test_a_file_in_the_home_folder_is_copied_with_what_names_it(tmp_path, monkeypatch):
    home, folder = tmp_path / "home", tmp_path / "configuration"
    for place in (home, folder, tmp_path / "run"):
        place.mkdir()
    monkeypatch.setenv("HOME", str(home))
    (home / "map.png").write_text("pixels")
    (folder / "a.yaml").write_text("{map_file: ~/map.png, other: ~nobody-of-this-name/map.png}")
    copy = tmp_path / "run" / InputCopies(tmp_path / "run").copy(folder / "a.yaml")
    shutil.rmtree(home)
    named = yaml.safe_load(copy.read_text())
    assert (copy.parent / named["map_file"]).read_text() == "pixels"
    assert named["other"] == "~nobody-of-this-name/map.png"


def test_numbers_of_a_gltf_beside_it_are_copied_with_it(tmp_path):
    (tmp_path / "scene.gltf").write_text(json.dumps({"buffers": [{"uri": "data/numbers.bin"}, {"uri": "data:,x"}]}))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "numbers.bin").write_bytes(b"123")

    copy = tmp_path / InputCopies(tmp_path).copy(tmp_path / "scene.gltf")

    assert json.loads(copy.read_text())["buffers"][0]["uri"] == "numbers.bin"
    assert (copy.parent / "numbers.bin").read_bytes() == b"123"


def test_meshes_of_a_urdf_are_copied_with_it(tmp_path):
    (tmp_path / "my_robot" / "meshes").mkdir(parents=True)
    (tmp_path / "my_robot" / "urdf").mkdir()
    (tmp_path / "my_robot" / "meshes" / "a & b.stl").write_text("hull")
    urdf = tmp_path / "my_robot" / "urdf" / "robot.urdf"
    beside, packaged, gone = "../meshes/a &amp; b.stl", "package://my_robot/meshes/a &amp; b.stl", "gone.stl"
    text = f"""<r><mesh filename="{beside}"/><mesh filename = '{packaged}'/><mesh filename="{gone}"/></r>"""
    urdf.write_text(text)
    hashes = [hash_with_named_files(urdf)]

    copy = tmp_path / InputCopies(tmp_path).copy(urdf)
    (tmp_path / "my_robot" / "meshes" / "a & b.stl").write_text("another hull")
    hashes.append(hash_with_named_files(urdf))

    own = '"a &amp; b.stl"'
    assert copy.read_text() == f'<r><mesh filename={own}/><mesh filename = {own}/><mesh filename="gone.stl"/></r>'
    assert [file.name for file in with_named_files(copy)] == ["robot.urdf", "a & b.stl"]
    assert (copy.parent / "a & b.stl").read_text() == "hull"
    assert hashes[0] != hashes[1]


def test_a_urdf_lets_no_files_but_meshes_and_textures_be_copied(tmp_path):
    for name in ("secret.yaml", "plugin.stl", "old.stl", "notes.txt", "body.stl", "skin.png"):
        (tmp_path / name).write_text(name)
    (tmp_path / "robot.urdf").write_text(
        f"""<r><!-- <mesh filename="old.stl"/> --><plugin filename="plugin.stl"/><mesh filename="secret.yaml"/>
        <mesh filename="file://{tmp_path}/notes.txt"/><mesh filename="skin.png"/><texture filename="body.stl"/>
        <mesh filename="file://{tmp_path}/body.stl"/><texture filename="skin.png"/></r>"""
    )

    copy = tmp_path / InputCopies(tmp_path).copy(tmp_path / "robot.urdf")

    assert {file.name for file in copy.parent.iterdir()} == {"robot.urdf", "body.stl", "skin.png"}
    assert '<mesh filename="body.stl"/><texture filename="skin.png"/>' in copy.read_text()


def test_a_mesh_that_is_too_large_to_be_read_is_not_copied(tmp_path):
    with (tmp_path / "body.stl").open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    (tmp_path / "robot.urdf").write_text('<r><mesh filename="body.stl"/></r>')

    assert [file.name for file in with_named_files(tmp_path / "robot.urdf")] == ["robot.urdf"]


def test_a_gltf_lets_no_files_but_buffers_and_images_be_copied(tmp_path):
    for name in ("numbers.bin", "skin.png", "secret.txt", "other.png"):
        (tmp_path / name).write_text(name)
    content = {
        "buffers": [{"uri": "numbers.bin"}, {"uri": "secret.txt"}, {"uri": 5}, "numbers.bin"],
        "images": [{"uri": "skin.png"}],
        "extras": {"uri": "other.png"},
    }
    (tmp_path / "scene.gltf").write_text(json.dumps(content))

    found = with_named_files(tmp_path / "scene.gltf")

    assert {file.name for file in found} == {"scene.gltf", "numbers.bin", "skin.png"}


def test_damaged_files_are_copied_as_they_are(tmp_path):
    for name, text in {"list.yaml": "[1, 2]", "broken.yaml": "a: [", "broken.gltf": "{", "broken.urdf": "<r>"}.items():
        (tmp_path / name).write_text(text)
        assert (tmp_path / InputCopies(tmp_path).copy(tmp_path / name)).read_text() == text


def test_a_plugin_type_is_not_taken_for_a_file(tmp_path):
    (tmp_path / "astar").write_text("a file without a suffix")

    assert InputCopies(tmp_path).renamed({"type": "astar"}, tmp_path) == {"type": "astar"}


def test_the_hash_changes_with_a_file_that_is_named_by_a_named_file(tmp_path):
    (tmp_path / "top.yaml").write_text("map: map.yaml")
    (tmp_path / "map.yaml").write_text("image: map.png")
    hashes = []
    for pixels in ("black", "white", "black"):
        (tmp_path / "map.png").write_text(pixels)
        hashes.append(hash_with_named_files(tmp_path / "top.yaml"))

    assert hashes[0] == hashes[2] != hashes[1]
