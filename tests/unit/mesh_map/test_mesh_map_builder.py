"""Building a map from a configuration: all findings at once, cache, coarse-mesh warning, files in and out."""

import importlib
import re
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_mesh_nav.files.lvr2_io import write_lvr2_mesh
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.layers.roughness import RoughnessLayer
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters, default_layers
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import MeshError

VERTICES, FACES = heightfield_mesh(np.random.default_rng(0).random((12, 10)) * 0.1, 0.1, 0.1)


def test_default_layers_leave_a_floor_free_inside_and_close_its_border():
    vertices, faces = heightfield_mesh(np.zeros((30, 30)), 0.1, 0.1)

    mesh = build_mesh_map(*default_layers(0.3), vertices=vertices, faces=faces)

    snapshot = mesh.snapshot()
    middle = np.linalg.norm(mesh.vertices[:, :2] - 1.45, axis=1) < 0.8
    boundary = (mesh.vertices[:, :2] == 0.0).any(axis=1)
    assert (snapshot.costs[middle] == 0.0).all()
    assert snapshot.lethal[boundary].all()
    assert np.isinf(snapshot.costs[boundary]).all()


def test_every_mistake_in_the_layers_is_reported_at_once():
    parameters = MeshMapParameters(
        layers=[
            {"name": "a", "type": "nonsense"},
            {"name": "b", "type": "steepness", "inputs": ["a"]},
            {"name": "c", "type": "inflation", "inputs": ["c"]},
            {"name": "c", "type": "border"},
            {"name": "d", "type": "roughness"},
        ],
        default_layer="final",
    )

    with pytest.raises(LayerListError) as error:
        build_mesh_map(parameters, {"d": {"radius": -1.0, "radios": 2}, "e": {}}, vertices=VERTICES, faces=FACES)

    for part in (
        "'c' is used twice",
        "parameters for 'e', but no such layer",
        "default_layer 'final' is not a layer",
        "nonsense: unknown type; known types: border, ",
        "'b' of type steepness takes 0 inputs, got 1",
        "layer 'd': radius",
        "layer 'd': radios",
    ):
        assert part in str(error.value)


def test_unknown_repair_is_refused_with_the_configuration():
    with pytest.raises(ValidationError, match=r"names of repairs \(.*duplicate_faces.*\), not duplicate"):
        MeshMapParameters(repair=("zero_area", "duplicate"))


def three_patches() -> tuple[np.ndarray, np.ndarray]:
    """A floor, a wall on its edge and a wall below that edge, which touch without being joined."""
    floor, faces = heightfield_mesh(np.zeros((5, 5)), 1.0, 1.0)
    wall = floor[:, [0, 2, 1]] + [0.0, 4.0, 0.0]
    vertices = np.vstack([floor, wall, wall * [1.0, 1.0, -1.0]])
    return vertices, np.vstack([faces, faces + 25, faces + 50])


@pytest.mark.parametrize(
    ("ending", "repair", "joined"),
    [
        ("ply", [], False),
        ("ply", ["duplicate_vertices"], True),
        ("off", [], False),
        ("obj", [], True),
        ("glb", [], True),
        ("stl", [], True),
        ("obj", ["-duplicate_vertices"], False),
        ("obj", ["zero_area"], True),
    ],
)
def test_vertices_are_joined_where_the_format_shares_none_or_the_configuration_says_so(
    tmp_path, ending, repair, joined
):
    file = tmp_path / f"sheets.{ending}"
    trimesh.Trimesh(*three_patches(), process=False).export(file)
    parameters = MeshMapParameters(mesh_file=str(file), repair=repair)

    if joined:
        with pytest.raises(MeshError, match="non_manifold: 4 faces are the third"):
            build_mesh_map(parameters)
        return
    mesh = build_mesh_map(parameters)
    assert len(mesh.vertices) == 75
    assert "10 vertices lie on one of another component" in mesh.report["components"].text


def test_joining_and_keeping_apart_exclude_each_other():
    with pytest.raises(ValidationError, match="either duplicate_vertices or -duplicate_vertices"):
        MeshMapParameters(repair=("duplicate_vertices", "-duplicate_vertices"))


def test_arrays_are_joined_only_if_asked_for_and_within_the_distance_given():
    apart = np.vstack([VERTICES, VERTICES + np.array([0.92, 0.0, 0.0])])
    faces = np.vstack([FACES, FACES + len(VERTICES)])
    apart[:, 2] = 0.0
    joining = MeshMapParameters(repair=("duplicate_vertices",), join_distance=0.03)

    assert len(build_mesh_map(MeshMapParameters(), vertices=apart, faces=faces).vertices) == 240
    assert len(build_mesh_map(joining, vertices=apart, faces=faces).vertices) == 228


def test_one_layer_type_may_be_used_under_several_names():
    names = ["gentle", "usual", "strict"]
    layers = [{"name": name, "type": "steepness"} for name in names]
    limits = dict(zip(names, ({"threshold": value} for value in (1.2, 0.6, 0.1)), strict=True))

    mesh = build_mesh_map(
        MeshMapParameters(layers=layers, default_layer="usual"), limits, vertices=VERTICES, faces=FACES
    )

    lethal = [int(mesh.layers[name].lethal.sum()) for name in names]
    assert lethal[0] < lethal[1] < lethal[2]
    np.testing.assert_array_equal(mesh.snapshot().lethal, mesh.layers["usual"].lethal)


def test_layer_class_can_be_named_by_module():
    path = f"{RoughnessLayer.__module__}:RoughnessLayer"
    parameters = MeshMapParameters(layers=[{"name": "mine", "type": path}])

    assert isinstance(build_mesh_map(parameters, vertices=VERTICES, faces=FACES).layers["mine"], RoughnessLayer)
    wrong = MeshMapParameters(layers=[{"name": "mine", "type": "pathlib:Path"}])
    with pytest.raises(LayerListError, match="class Path is no MeshLayer"):
        build_mesh_map(wrong, vertices=VERTICES, faces=FACES)


@pytest.mark.parametrize("path", ["no_such_module:Layer", f"{RoughnessLayer.__module__}:NoSuchLayer", ":Layer"])
def test_a_layer_class_that_cannot_be_loaded_is_named_beside_the_other_findings(path):
    parameters = MeshMapParameters(layers=[{"name": "mine", "type": path}], default_layer="other")

    with pytest.raises(LayerListError, match="default_layer 'other' is not a layer") as error:
        build_mesh_map(parameters, vertices=VERTICES, faces=FACES)
    assert f"layer 'mine': mesh_layers: {path}: import failed: " in str(error.value)


def test_a_cached_layer_is_computed_anew_when_its_code_has_changed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    code = (
        "import numpy as np\nfrom mbf_mesh_nav.map.layer import MeshLayer\n\n\nclass Flat(MeshLayer):\n"
        "    cacheable = True\n\n    def compute(self):\n"
        "        return np.full(self.topology.vertex_count, {cost}, np.float32), self._lethal\n"
    )
    parameters = MeshMapParameters(
        layers=[{"name": "flat", "type": "flat_layer:Flat"}], cache_dir=str(tmp_path / "cache")
    )
    costs = []
    for cost in (0.25, 0.75):
        (tmp_path / "flat_layer.py").write_text(code.format(cost=cost))
        monkeypatch.delitem(sys.modules, "flat_layer", raising=False)
        importlib.invalidate_caches()
        costs.append(build_mesh_map(parameters, vertices=VERTICES, faces=FACES).layers["flat"].costs[0])
    assert costs == [0.25, 0.75]


def test_cached_layer_is_reused_for_the_same_mesh_and_parameters_only(tmp_path, monkeypatch):
    parameters = MeshMapParameters(layers=[{"name": "rough", "type": "roughness"}], cache_dir=str(tmp_path))

    def build(radius: float, vertices: np.ndarray = VERTICES):
        return build_mesh_map(parameters, {"rough": {"radius": radius}}, vertices=vertices, faces=FACES)

    first = build(0.3)
    assert len(list(tmp_path.iterdir())) == 1
    other = build(0.15)
    assert not np.array_equal(first.layers["rough"].costs, other.layers["rough"].costs)
    build(0.3, VERTICES * [1.0, 1.0, 1.1])
    assert len(list(tmp_path.iterdir())) == 3

    monkeypatch.setattr(RoughnessLayer, "compute", lambda self: pytest.fail("computed although cached"))
    np.testing.assert_array_equal(build(0.3).layers["rough"].costs, first.layers["rough"].costs)


def test_damaged_cache_file_is_computed_anew(tmp_path):
    parameters = MeshMapParameters(layers=[{"name": "rough", "type": "roughness"}], cache_dir=str(tmp_path))
    first = build_mesh_map(parameters, vertices=VERTICES, faces=FACES)
    next(tmp_path.iterdir()).write_bytes(b"PK damaged")

    again = build_mesh_map(parameters, vertices=VERTICES, faces=FACES)

    np.testing.assert_array_equal(again.layers["rough"].costs, first.layers["rough"].costs)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 100_000))
def test_whatever_stands_in_a_cache_file_the_map_loads(tmp_path_factory, seed):
    folder, rng = tmp_path_factory.mktemp("cache"), np.random.default_rng(seed)
    parameters = MeshMapParameters(layers=[{"name": "rough", "type": "roughness"}], cache_dir=str(folder))
    first = build_mesh_map(parameters, vertices=VERTICES, faces=FACES)
    (file,) = folder.iterdir()
    content = bytearray(file.read_bytes())
    for place in rng.integers(0, len(content), rng.integers(0, 4)):
        content[place] ^= rng.integers(1, 256)
    file.write_bytes(content[: rng.choice([0, rng.integers(len(content)), len(content)])])

    again = build_mesh_map(parameters, vertices=VERTICES, faces=FACES)

    np.testing.assert_array_equal(again.layers["rough"].costs, first.layers["rough"].costs)
    assert not again.report.findings


def test_a_cache_folder_that_cannot_be_used_is_reported_once_and_the_map_loads(tmp_path):
    (tmp_path / "file").write_text("no folder")
    layers = [{"name": "rough", "type": "roughness"}, {"name": "height", "type": "height_diff"}]

    mesh = build_mesh_map(
        MeshMapParameters(layers=layers, cache_dir=str(tmp_path / "file")), vertices=VERTICES, faces=FACES
    )

    (finding,) = mesh.report.findings
    assert (finding.name, finding.harmless, finding.count) == ("cache", True, 0)
    assert "computed at every start" in str(finding)
    assert set(mesh.layers) == {"rough", "height"}


def test_a_mesh_too_coarse_for_a_robot_whose_size_only_an_inflation_knows_is_reported():
    layers = [{"name": "border", "type": "border"}, {"name": "near", "type": "inflation", "inputs": ["border"]}]
    blocks = {"near": {"inscribed_radius": 0.15}}
    unknown = build_mesh_map(MeshMapParameters(layers=layers), blocks, vertices=VERTICES, faces=FACES)
    assert "half the inscribed radius of layer 'near' (0.075 m)" in unknown.report["coarse"].text
    known, wide = MeshMapParameters(layers=layers, inscribed_radius=0.4), {"near": {"inscribed_radius": 0.4}}
    assert "coarse" not in build_mesh_map(known, wide, vertices=VERTICES, faces=FACES).report


def test_layers_whose_radius_is_shorter_than_the_edges_are_reported_by_name():
    vertices, faces = heightfield_mesh(np.zeros((9, 9)), 0.5, 0.5)
    layers = [{"name": "near", "type": "roughness"}, {"name": "far", "type": "roughness"}]
    blocks = {"near": {"radius": 0.3}, "far": {"radius": 1.0}}
    mesh_map = build_mesh_map(MeshMapParameters(layers=layers), blocks, vertices=vertices, faces=faces)
    assert [finding.name for finding in mesh_map.report.findings] == ["coarse"]
    assert "'near'" in mesh_map.report.findings[0].text


def test_a_map_whose_edges_are_longer_than_a_robot_is_reported_with_its_tilt_layer():
    vertices, faces = heightfield_mesh(np.zeros((9, 9)), 0.5, 0.5)
    layers = [{"name": "stance", "type": "tilt"}]
    for wheelbase, reported in ((0.512, True), (0.7, False)):
        parameters = MeshMapParameters(layers=layers)
        mesh_map = build_mesh_map(parameters, {"stance": {"wheelbase": wheelbase}}, vertices=vertices, faces=faces)
        texts = [finding.text for finding in mesh_map.report.findings if finding.name == "coarse"]
        assert any("the wheelbase of layer 'stance' (0.512 m)" in text for text in texts) is reported


@pytest.mark.parametrize("wheels", [False, True])
def test_the_radius_of_a_robot_says_what_is_coarse_unless_a_layer_stands_its_wheels_on_the_faces(wheels):
    vertices, faces = heightfield_mesh(np.zeros((9, 9)), 0.3, 0.3)
    parameters = MeshMapParameters(
        layers=[{"name": "ground", "type": "tilt" if wheels else "steepness"}], inscribed_radius=0.34
    )
    mesh_map = build_mesh_map(parameters, {}, vertices=vertices, faces=faces)
    assert ("coarse" in mesh_map.report) is not wheels


def test_closed_bodies_beside_other_parts_are_reported_as_plans_lead_through_them():
    wall = trimesh.creation.box((0.1, 0.5, 0.5))
    wall.apply_translation((0.5, 0.5, 0.3))
    floor = trimesh.Trimesh(VERTICES, FACES, process=False)
    for parts, expected in (([floor, wall], "1 of 2 parts are closed bodies"), ([floor], ""), ([wall], "")):
        scene = trimesh.util.concatenate(parts)
        report = build_mesh_map(MeshMapParameters(), vertices=scene.vertices, faces=scene.faces).report
        assert report["bodies"].text.startswith(expected) if expected else "bodies" not in report


def test_coarse_mesh_is_reported_and_densify_repairs_it():
    vertices, faces = heightfield_mesh(np.zeros((3, 3)), 2.0, 2.0)
    coarse = MeshMapParameters(inscribed_radius=0.4)

    assert "densify" in build_mesh_map(coarse, vertices=vertices, faces=faces).report["coarse"].text
    fine = build_mesh_map(MeshMapParameters(inscribed_radius=0.4, densify=0.2), vertices=vertices, faces=faces)
    assert "coarse" not in fine.report
    np.testing.assert_array_equal(fine.vertices[fine.input_to_internal], vertices)


@pytest.mark.parametrize("ending", ["ply", "obj", "stl", "off", "glb", "dae"])
def test_mesh_survives_a_round_trip_through_every_format(tmp_path, ending):
    file = tmp_path / f"mesh.{ending}"
    trimesh.Trimesh(VERTICES, FACES, process=False).export(file)  # as it stands, whatever the format says of axes

    mesh = build_mesh_map(MeshMapParameters(mesh_file=str(file), up_axis="z"))

    assert len(mesh.vertices) == len(VERTICES)
    assert len(mesh.faces) == len(FACES)
    np.testing.assert_allclose(np.sort(mesh.vertices, axis=0), np.sort(VERTICES, axis=0), atol=1e-5)


def test_parts_of_a_scene_are_found_by_name_and_moved_into_place(tmp_path):
    scene = trimesh.Scene()
    plate = trimesh.Trimesh(VERTICES, FACES, process=False)
    scene.add_geometry(plate, node_name="ground", geom_name="ground_mesh")
    scene.add_geometry(
        plate, node_name="roof", geom_name="roof_mesh", transform=trimesh.transformations.translation_matrix([0, 0, 5])
    )
    file = tmp_path / "house.glb"
    scene.export(file)

    roof, faces = read_mesh(file, "roof", up_axis="z")

    assert len(faces) == len(FACES)
    assert roof[:, 2].min() >= 5.0
    assert len(read_mesh(file)[1]) == 2 * len(FACES)
    with pytest.raises(MeshError, match=r"no part 'cellar'.*ground.*roof"):
        read_mesh(file, "cellar")


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("none.ply", None, "no such file"),
        ("mesh.xyz", b"1 2 3", "unknown ending .* Of a point cloud, mbf map build makes a mesh"),
        ("empty.ply", b"", "line 1: expected 'ply', got nothing"),
        ("a.ply", b"ply\nnope\n", "line 2: expected a line that begins with one of format, .*, got 'nope'"),
        ("a.ply", b"ply\nformat ascii 2.0\n", "line 2: expected 'format FORM 1.0' with .*, got 'format ascii 2.0'"),
        ("a.ply", b"ply\nelement vertex -1\n", "line 2: expected 'element NAME COUNT' .*, got 'element vertex -1'"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "line 3: expected 'end_header', got nothing"),
        ("short.stl", b"solid nothing", "st|face"),
        ("text.h5", b"not hdf5", "HDF5"),
        (
            "lying.ply",
            b"ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\nproperty float x\nend_header\n",
            "lying",
        ),
        ("broken.glb", b"glTF\x02\x00\x00\x00", "glb"),
    ],
)
def test_unreadable_file_is_one_error_that_names_it(tmp_path, name, content, text):
    file = tmp_path / name
    if content is not None:
        file.write_bytes(content)

    with pytest.raises(MeshError, match=text) as error:
        read_mesh(file)

    assert error.value.file == str(file)


def test_too_many_faces_are_refused(tmp_path):
    file = tmp_path / "mesh.ply"
    trimesh.Trimesh(VERTICES, FACES, process=False).export(file)
    write_lvr2_mesh(tmp_path / "mesh.h5", VERTICES, FACES)

    for path in (file, tmp_path / "mesh.h5"):
        with pytest.raises(MeshError, match="the limit is 10"):
            read_mesh(path, max_faces=10)


@pytest.mark.parametrize(("ending", "lacking"), [(".h5", ["h5py"]), (".dae", ["lxml", "collada"])])
def test_without_the_extra_a_file_that_needs_it_is_refused_with_what_to_install(tmp_path, monkeypatch, ending, lacking):
    file = tmp_path / f"map{ending}"
    file.write_bytes(b"")
    for name in lacking:
        monkeypatch.setitem(sys.modules, name, None)
    message = f"{ending} files need {' and '.join(lacking)}: pip install 'mbf-flex[mesh-files]'"
    with pytest.raises(MeshError, match=re.escape(message)):
        read_mesh(file)
