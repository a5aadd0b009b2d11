"""Files that end too early are refused with what they promise and what they hold; whole ones are read."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import MeshError

VERTICES, FACES = heightfield_mesh(np.random.default_rng(0).random((12, 10)), 0.1, 0.1)
MESH = trimesh.Trimesh(VERTICES, FACES, process=False)
QUADS = "\n".join(["OFF # four squares", "9 4 0", *(f"{i % 3} {i // 3} 0" for i in range(9)), "4 0 1 4 3", "4 1 2 5 4"])


def exported(ending: str) -> bytes:
    """The mesh in a format, those of text where there are two."""
    options = {"ply": {"encoding": "ascii"}, "stl_ascii": {}}.get(ending, {})
    data = MESH.export(file_type=ending, **options)
    return data.encode() if isinstance(data, str) else data


@pytest.mark.parametrize(
    ("ending", "expected"),
    [("ply", "120 of element vertex, 198 of element face"), ("off", "198 of element face"), ("stl", "198 faces")],
)
@pytest.mark.parametrize("share", [0.95, 0.9, 0.5, 0.1])
def test_a_file_that_was_cut_is_refused_with_what_it_promises(tmp_path, ending, expected, share):
    file, content = tmp_path / f"cut.{ending}", exported(ending)
    file.write_bytes(content[: int(share * len(content))])

    with pytest.raises(MeshError, match=f"the file is cut off: expected .*{expected}.*found") as error:
        read_mesh(file)

    assert error.value.file == str(file)
    assert len(error.value.reasons) == 1


@pytest.mark.parametrize("ending", ["ply", "off", "stl", "stl_ascii"])
def test_the_whole_file_is_read(tmp_path, ending):
    file = tmp_path / f"whole.{ending.split('_')[0]}"
    file.write_bytes(exported(ending))
    assert len(read_mesh(file)[1]) == len(FACES)
    file.write_bytes(exported(ending).rstrip())
    assert ending == "stl" or len(read_mesh(file)[1]) == len(FACES)


@pytest.mark.parametrize("share", [0.95, 0.5, 0.1])
def test_a_binary_gltf_that_was_cut_is_refused_with_its_length(tmp_path, share):
    file, content = tmp_path / "cut.glb", exported("glb")
    file.write_bytes(content)
    assert len(read_mesh(file)[1]) == len(FACES)
    file.write_bytes(content[: int(share * len(content))])
    found = int(share * len(content))
    with pytest.raises(MeshError, match=f"the file is cut off: expected {len(content)} bytes, found {found}"):
        read_mesh(file)


def test_a_text_stl_without_its_end_is_refused(tmp_path):
    file, content = tmp_path / "cut.stl", exported("stl_ascii")
    file.write_bytes(content[: int(0.9 * len(content))])
    with pytest.raises(MeshError, match=r"faces begin and .* end, and there is no endsolid"):
        read_mesh(file)


def test_a_binary_stl_that_calls_itself_solid_is_counted_like_any_other(tmp_path):
    file, content = tmp_path / "cut.stl", b"solid" + exported("stl")[5:]
    file.write_bytes(content)
    assert len(read_mesh(file)[1]) == len(FACES)
    file.write_bytes(content[: len(content) // 2])
    with pytest.raises(MeshError, match="expected 198 faces, found 98"):
        read_mesh(file)
    file.write_bytes(content[:40])
    with pytest.raises(MeshError, match="after 40 bytes, within its header"):
        read_mesh(file)


@pytest.mark.parametrize("last", ["f 1 2", "f", "v 0.5 0"])
def test_an_obj_that_ends_within_a_line_is_refused(tmp_path, last):
    file = tmp_path / "cut.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n" + last)
    with pytest.raises(MeshError, match=f"its last line is '{last}'"):
        read_mesh(file)
    file.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3")
    assert len(read_mesh(file)[1]) == 1


def test_missing_squares_are_missed_although_squares_make_two_faces_each(tmp_path):
    file = tmp_path / "squares.off"
    file.write_text(QUADS)
    with pytest.raises(MeshError, match="9 of element vertex, 4 of element face; found 9 of vertex, 2 of face"):
        read_mesh(file)
    file.write_text(QUADS + "\n4 3 4 7 6\n\n4 4 5 8 7")
    assert len(read_mesh(file)[1]) == 8


@pytest.mark.parametrize("name", ["empty.stl", "solid.stl", "empty.gltf"])
def test_a_file_with_nothing_in_it_says_so_and_not_that_a_part_is_missing(tmp_path, name):
    texts = {"empty.stl": "", "solid.stl": "solid a\nendsolid a\n", "empty.gltf": '{"asset": {"version": "2.0"}}'}
    (tmp_path / name).write_text(texts[name])
    with pytest.raises(MeshError) as error:
        read_mesh(tmp_path / name)
    assert "part" not in str(error.value)


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(["ply", "off", "stl"]), st.data())
def test_wherever_a_file_is_cut_it_is_whole_or_refused(tmp_path_factory, ending, data):
    content = exported(ending)
    file = tmp_path_factory.mktemp("cut") / f"mesh.{ending}"
    kept = data.draw(st.integers(0, len(content)))
    file.write_bytes(content[:kept])
    try:
        faces = read_mesh(file)[1]
    except MeshError:
        assert kept < len(content)
        return
    # A digit of the very last number may be missing: a text file does not show it.
    assert len(faces) == len(FACES)
    assert kept > len(content) - 5


def test_texture_coordinates_of_faces_do_not_split_the_vertices_of_a_ply(tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 .5 .5 .6 .5 .6 .6\n"
    (tmp_path / "textured.ply").write_text(header + rows)
    vertices, faces = read_mesh(tmp_path / "textured.ply")
    assert len(vertices) == 4
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]
