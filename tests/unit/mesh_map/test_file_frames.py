"""Axes and units of mesh files: every format ends up in metres with z up, and every rotation is reported."""

import json

import numpy as np
import pytest
import trimesh

from mbf_abstract.server.factory import read_config
from mbf_abstract.server.standing_server import standing_server
from mbf_mesh_nav.files.file_frames import FileFrame, file_frame, on_the_map
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters, default_layers
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

HILL, FACES = heightfield_mesh(0.1 * np.random.default_rng(3).random((6, 9)), 0.5, 0.5)
Y_UP = np.column_stack([HILL[:, 0], HILL[:, 2], -HILL[:, 1]])
"""The hill as a file with y up has it."""
X_UP = np.column_stack([HILL[:, 2], -HILL[:, 0], -HILL[:, 1]])


def exported(file, vertices, faces=FACES):
    trimesh.Trimesh(vertices, faces, process=False).export(file)
    return file


def collada(file, vertices, asset):
    """A COLLADA file with ``asset`` in the place of what the exporter says."""
    text = exported(file, vertices).read_text()
    head, _, rest = text.partition("<asset>")
    file.write_text(head + f"<asset>{asset}</asset>" + rest.partition("</asset>")[2])
    return file


@pytest.mark.parametrize("ending", ["glb", "gltf"])
def test_gltf_is_y_up_by_its_specification(tmp_path, ending):
    if ending == "glb":
        file = exported(tmp_path / "hill.glb", Y_UP)
    else:
        for name, content in trimesh.Trimesh(Y_UP, FACES, process=False).export(file_type="gltf").items():
            (tmp_path / name).write_bytes(content)
        file = tmp_path / "model.gltf"
    vertices, faces = read_mesh(file)
    np.testing.assert_allclose(vertices[faces], HILL[FACES], atol=1e-6)


@pytest.mark.parametrize(
    ("up", "unit", "vertices"),
    [
        ("<up_axis>Z_UP</up_axis>", '<unit name="meter" meter="1"/>', HILL),
        ("<up_axis> Y_UP </up_axis>", '<unit meter="0.01" name="centimeter"/>', 100.0 * Y_UP),
        ("<up_axis>X_UP</up_axis>", '<unit meter="0.0254" name="inch"/>', X_UP / 0.0254),
        ("<up_axis>Y_UP</up_axis>", "", Y_UP),
        ("", "<unit name='thing'/>", Y_UP),
    ],
)
def test_collada_says_its_up_axis_and_unit(tmp_path, up, unit, vertices):
    read, faces = read_mesh(collada(tmp_path / "hill.dae", vertices, unit + up))
    np.testing.assert_allclose(read[faces], HILL[FACES], atol=1e-5)


@pytest.mark.parametrize(
    ("asset", "text"),
    [
        ("<up_axis>UP</up_axis>", "asset/up_axis: expected one of X_UP, Y_UP, Z_UP, got 'UP'"),
        ('<unit meter="0"/>', r"asset/unit: expected 1e-06..1e\+06 metres, got '0'"),
        ('<unit meter="-1"/>', "got '-1'"),
        ('<unit meter="nan"/>', "got 'nan'"),
        ('<unit meter="1e308"/>', "got '1e308'"),
        ('<unit meter="inch"/>', "asset: could not convert string"),
    ],
)
def test_a_collada_file_that_says_nonsense_is_refused(tmp_path, asset, text):
    with pytest.raises(MeshError, match=text):
        read_mesh(collada(tmp_path / "hill.dae", HILL, asset))


@pytest.mark.parametrize("ending", ["ply", "obj", "stl", "off"])
def test_formats_that_say_nothing_are_taken_as_they_are_unless_the_configuration_speaks(tmp_path, ending):
    file = exported(tmp_path / f"hill.{ending}", Y_UP)
    assert file_frame(file) == FileFrame("z", 1.0)
    as_it_is = build_mesh_map(MeshMapParameters(mesh_file=str(file), repair=["facing_down"]))
    turned = build_mesh_map(MeshMapParameters(mesh_file=str(file), up_axis="y", unit=0.5))
    np.testing.assert_allclose(np.sort(as_it_is.vertices, axis=0), np.sort(Y_UP, axis=0), atol=1e-5)
    np.testing.assert_allclose(np.sort(turned.vertices, axis=0), np.sort(0.5 * HILL, axis=0), atol=1e-5)


def test_the_configuration_wins_over_the_file(tmp_path):
    file = collada(tmp_path / "hill.dae", HILL, '<unit meter="0.01"/><up_axis>Y_UP</up_axis>')
    for given, scale in (({"up_axis": "z", "unit": 1.0}, 1.0), ({"up_axis": "z"}, 0.01)):
        vertices, faces = read_mesh(file, **given)
        np.testing.assert_allclose(vertices[faces], scale * HILL[FACES], atol=1e-5)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_turning_mirrors_nothing(axis):
    corner = on_the_map(np.eye(3), FileFrame(axis))
    assert np.linalg.det(corner) == pytest.approx(1.0)
    assert corner["xyz".index(axis)].tolist() == [0.0, 0.0, 1.0]


def test_an_elevation_model_is_not_turned(tmp_path):
    (tmp_path / "hill.asc").write_text("ncols 2\nnrows 2\ncellsize 1\n1 2 3 4\n")
    with pytest.raises(MeshError, match="takes neither up_axis nor unit"):
        read_mesh(tmp_path / "hill.asc", up_axis="y")


def test_what_was_turned_is_reported(tmp_path):
    found = build_mesh_map(MeshMapParameters(mesh_file=str(exported(tmp_path / "hill.glb", Y_UP)))).report
    assert "the file has y up, a unit of 1 m; it is turned" in found["file_frame"].text
    plain = build_mesh_map(MeshMapParameters(mesh_file=str(exported(tmp_path / "hill.ply", HILL)))).report
    assert "file_frame" not in plain


def test_a_map_on_which_nearly_everything_is_lethal_says_so_and_guesses_the_axis(tmp_path):
    parameters, blocks = default_layers(0.2)
    guards = parameters.model_copy(update={"mesh_file": str(exported(tmp_path / "hill.obj", Y_UP))})

    lying = build_mesh_map(guards.model_copy(update={"repair": ("facing_down",)}), blocks).report
    standing = build_mesh_map(guards.model_copy(update={"up_axis": "y"}), blocks).report

    assert "nearly every vertex is lethal" in lying["lethal"].text and "steepness" in lying["lethal"].text
    assert lying["lethal"].text.endswith("most faces look along y: if that is up in the file, set up_axis: y")
    assert lying["lethal"].harmless and lying["lethal"].count > 40
    assert "lethal" not in standing


@pytest.mark.parametrize("scale", [0.01, 1.0])
def test_a_mesh_hardly_larger_than_the_robot_says_how_large_it_is(tmp_path, scale):
    layers = [{"name": "border", "type": "border"}, {"name": "safe", "type": "inflation", "inputs": ["border"]}]
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), scale, scale)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "floor.ply")
    parameters = MeshMapParameters(mesh_file=str(tmp_path / "floor.ply"), layers=layers, inscribed_radius=0.3)

    report = build_mesh_map(parameters, {"safe": {"inscribed_radius": 0.3, "inflation_radius": 0.5}}).report

    expected = (
        "nearly every vertex is lethal or costs 1, the usual cost_limit, so nothing can be planned (layers: safe 100%)"
    )
    size = "; the mesh is 0.2 m x 0.2 m, hardly room for the robot: see unit"
    assert report["lethal"].text == expected + size if scale < 1.0 else "lethal" not in report


ROOM = np.array([(x, y, z) for x in (0.0, 4.0) for y in (0.0, 5.0) for z in (0.0, 1.5)])
FLOOR, WALLS = [(0, 4, 6), (0, 6, 2)], [(0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 2, 1), (1, 2, 3)]


@pytest.mark.parametrize(
    ("turned", "up_axis", "says"),
    [
        ([0, 1, 2], "", ""),
        (
            [1, 2, 0],
            "",
            "51% of the surface look to one side along y, at most 19% along z: if y is up in the file, set up_axis: y",
        ),
        ([1, 2, 0], "z", ""),
    ],
)
def test_a_room_that_lies_on_its_side_says_so_even_if_there_is_free_ground(tmp_path, turned, up_axis, says):
    vertices = ROOM[:, turned]
    trimesh.Trimesh(vertices, FLOOR + WALLS, process=False).export(tmp_path / "room.obj")
    report = build_mesh_map(MeshMapParameters(mesh_file=str(tmp_path / "room.obj"), up_axis=up_axis)).report
    assert says in report["lying"].text if says else "lying" not in report


def test_the_server_passes_these_findings_on(tmp_path):
    exported(tmp_path / "hill.glb", HILL)  # z up, which no glTF is
    (tmp_path / "robot.yaml").write_text(
        "backend: mesh\nplanners: [{name: p, type: dijkstra}]\n"
        "mesh_map: {mesh_file: hill.glb, layers: [{name: slopes, type: steepness}], repair: [facing_down]}\n"
    )
    with standing_server(*read_config(tmp_path / "robot.yaml")) as server:
        messages = "\n".join(server.notes)
    assert "file_frame: the file has y up" in messages
    assert "lethal: nearly every vertex is lethal, so nothing can be planned (layers: slopes 100%)" in messages


def gltf(file, change):
    """The hill as .gltf with its numbers in the text; ``change`` edits the document."""
    parts = trimesh.Trimesh(Y_UP, FACES, process=False).export(file_type="gltf", embed_buffers=True)
    document = json.loads(parts["model.gltf"])
    change(document)
    file.write_text(json.dumps(document))
    return file


def without_views(document):
    del document["bufferViews"]


def without_numbers(document):
    del document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]["bufferView"]


def a_cycle(document):
    document["nodes"] = [{"children": [1]}, {"children": [2]}, {"children": [0], "mesh": 0}]
    document["scenes"] = [{"nodes": [0]}]


def its_own_child(document):
    document["nodes"] = [{"children": [0], "mesh": 0}]


def two_parents(document):
    document["nodes"] = [{"children": [2]}, {"children": [2]}, {"mesh": 0}]


def an_unknown_child(document):
    document["nodes"][0]["children"] = [77]


def a_huge_count(document):
    document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]["count"] = 10**12


def a_negative_count(document):
    document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]["count"] = -1


def an_unknown_accessor(document):
    document["meshes"][0]["primitives"][0]["indices"] = 9


def compressed(document):
    document["extensionsUsed"] = ["KHR_draco_mesh_compression"]


def no_mesh(document):
    document["meshes"] = []
    del document["bufferViews"]


def nodes_of_text(document):
    document["nodes"] = "all"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (without_views, r"meshes\[0\].primitives\[0\].*names bufferViews\[\d\], there are 0"),
        (without_numbers, r"accessors\[\d\] has no bufferView, so nothing is in it"),
        (a_cycle, r"the nodes do not form a tree: nodes\[1\] -> nodes\[2\] -> nodes\[0\] -> nodes\[1\]$"),
        (its_own_child, r"the nodes do not form a tree: nodes\[0\] -> nodes\[0\]$"),
        (two_parents, r"nodes\[1\]: has the child 2, which is a child of nodes\[0\], too"),
        (an_unknown_child, r"nodes\[0\]: names nodes\[77\], there are"),
        (a_huge_count, r"needs 12000000000000 bytes of a view of"),
        (a_negative_count, r"count: expected a whole number of at least 0, got -1"),
        (an_unknown_accessor, r"primitives\[0\].indices: names accessors\[9\], there are"),
        (compressed, "compressed by KHR_draco_mesh_compression, which is not read"),
        (no_mesh, r"nodes\[\d\]: names meshes\[0\], there are 0"),
        (nodes_of_text, "is not a glTF file: nodes: expected a list of objects"),
    ],
)
def test_a_gltf_whose_references_lead_nowhere_is_one_clear_error(tmp_path, change, text):
    with pytest.raises(MeshError, match=text) as error:
        read_mesh(gltf(tmp_path / "hill.gltf", change))
    assert len(error.value.reasons) <= 2 and str(error.value).startswith(f"{tmp_path / 'hill.gltf'}: ")


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"[" * 100_000, b"glTF", b"glTF" + bytes(16), b'{"meshes": [3]}']
)
@pytest.mark.parametrize("ending", ["gltf", "glb"])
def test_what_is_no_gltf_is_refused_as_such(tmp_path, ending, content):
    (tmp_path / f"hill.{ending}").write_bytes(content)
    with pytest.raises(MeshError, match="is not a glTF file"):
        read_mesh(tmp_path / f"hill.{ending}")


def test_a_mesh_placed_a_thousand_times_counts_a_thousand_times(tmp_path):
    def change(document):
        document["nodes"] = [{"mesh": 0} for _ in range(1000)]
        document["scenes"] = [{"nodes": list(range(1000))}]

    with pytest.raises(MeshError, match=f"{1000 * len(FACES)} faces, the limit is {100 * len(FACES)}"):
        read_mesh(gltf(tmp_path / "many.gltf", change), max_faces=100 * len(FACES))
