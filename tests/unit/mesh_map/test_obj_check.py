"""An OBJ file whose lines are wrong is refused with the line; one that counts from 0 is no mesh at wrong places."""

import pytest

from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

SQUARE = "v 0 0 0\nv 5 0 0\nv 0 5 0\nv 5 5 0\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (SQUARE + "f 0 1 2\nf 1 3 2\n", "line 5: expected corners counted from 1, got 'f 0'"),
        (SQUARE + "f 1 2 3\r\nf 1/1 2/2 0/3\r\n", "line 6: expected corners counted from 1, got 'f 1/1 2/2 0'"),
        (SQUARE + "f 1 2 5\n", "line 5: expected corners among the 4 vertices of the file, got 'f 1 2 5'"),
        (SQUARE + "f -9 -1 -2\n", "line 5: expected corners among the 4 vertices of the file, got 'f -9 -1 -2'"),
        (SQUARE + "f 1 2 \\\n x\n", "line 5: expected 'f' and whole numbers of vertices, got 'f 1 2 x'"),
        ("v 0,5 1,0 0\n" + SQUARE + "f 1 2 3\n", "line 1: expected 'v' and three numbers, got 'v 0,5 1,0 0'"),
    ],
)
def test_what_is_wrong_in_an_obj_file_is_named_with_its_line(tmp_path, text, reason):
    file = tmp_path / "ground.obj"
    file.write_bytes(text.encode())
    with pytest.raises(MeshError) as caught:
        read_mesh(file)
    assert str(caught.value) == f"{file}: {reason}"


@pytest.mark.parametrize("faces", ["f 1 2 4 3\n", "f -4 -3 -1\nf -4 -1 -2\n", "f 1//10 2//0 4//20\nf 1 4 \\\n3\n"])
def test_legal_ways_to_write_faces_are_read(tmp_path, faces):
    file = tmp_path / "ground.obj"
    file.write_text(faces * (faces[2] != "-") + SQUARE + faces * (faces[2] == "-"))
    _, found = read_mesh(file)
    assert sorted({corner for face in found.tolist() for corner in face}) == [0, 1, 2, 3]


def test_a_collada_file_that_shows_no_scene_is_refused(tmp_path):
    file = tmp_path / "ground.dae"
    file.write_text("<COLLADA></COLLADA>")
    with pytest.raises(MeshError, match="expected a <scene> with an <instance_visual_scene>, got a file that shows"):
        read_mesh(file)
