"""A PLY of vertices and triangles is read as trimesh reads it, and everything else is left to trimesh."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_mesh_nav.files.plain_ply import read_plain_ply
from mbf_mesh_nav.files.scene_reader import read_scene
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.welding import join_boundaries

VERTEX = "property float x\nproperty float y\nproperty float z\n"
FACE = "property list uchar int vertex_indices\n"
TEXT = (
    f"ply\nformat ascii 1.0\nelement vertex 3\n{VERTEX}property uchar red\nelement face 1\n{FACE}end_header\n"
    "0 0 0 5\n1 0 -0.0 7\n0 1 0.1 9\n3 0 1 2\n"
)


def ply(vertex=VERTEX, face=FACE, form="binary_little_endian", corners=3, tail=b""):
    """The bytes of a file with three vertices and a face."""
    header = (
        f"ply\nformat {form} 1.0\ncomment made by hand\nelement vertex 3\n{vertex}element face 1\n{face}end_header\n"
    )
    points = np.array([[0, 0, 0], [1, 0, -0.0], [0, 1, 0.1]], "<f4").tobytes()
    return header.encode() + points + bytes([corners]) + np.arange(corners, dtype="<i4").tobytes() + tail


def by_trimesh(file, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("mbf_mesh_nav.files.scene_reader.read_plain_ply", lambda path: None)
        return read_scene(file, "", 1000)


def test_a_plain_file_is_read_as_trimesh_reads_it_bit_for_bit(tmp_path, monkeypatch):
    trimesh.Trimesh(*heightfield_mesh(np.arange(20.0).reshape(4, 5), 0.1, 0.3), process=False).export(
        tmp_path / "a.ply"
    )
    (tmp_path / "b.ply").write_bytes(ply())
    hills = trimesh.Trimesh(*heightfield_mesh(np.sin(np.arange(20.0)).reshape(4, 5), 0.1, 0.3), process=False)
    hills.export(tmp_path / "c.ply", encoding="ascii")
    (tmp_path / "d.ply").write_text(TEXT)
    (tmp_path / "e.ply").write_text(TEXT.rstrip().replace("float", "double").replace("\n", " \r\n"))

    for name in ("a.ply", "b.ply", "c.ply", "d.ply", "e.ply"):
        plain, other = read_plain_ply(tmp_path / name), by_trimesh(tmp_path / name, monkeypatch)
        assert [(array.dtype, array.tobytes()) for array in plain] == [
            (array.dtype, array.tobytes()) for array in other
        ]


@pytest.mark.parametrize(
    "content",
    [
        ply(form="ascii"),
        *(
            TEXT.replace(old, new).encode()
            for old, new in (
                ("3 0 1 2", "4 0 1 2 2"),
                ("3 0 1 2", "3 0 1"),
                ("3 0 1 2", "3 0 1 two"),
                ("3 0 1 2", "3 0 1 1.5"),
                ("3 0 1 2", "3 0 1 nan"),
                ("3 0 1 2", "3 0 1 1e300"),
                ("3 0 1 2\n", "3 0 1 2 more"),
                ("3 0 1 2\n", "3 0 1 2\n\n"),
                ("3 0 1 2\n", "3 0 1 2\n1\n"),
                ("1 0 -0.0 7", "1 0\n-0.0 7"),
                ("0 1 0.1 9\n", ""),
                ("ascii 1.0", "ascii 2.0"),
            )
        ),
        ply(form="binary_big_endian"),
        ply(corners=4),
        ply(tail=b"\0"),
        ply()[:-1],
        ply(vertex=VERTEX.replace("z", "w")),
        ply(vertex=VERTEX.replace("y", "x")),
        ply(vertex=VERTEX + "property list uchar int more\n"),
        ply(face=FACE + "property float quality\n"),
        ply(face=FACE.replace("vertex_indices", "texcoord")),
        ply(face=FACE.replace("int v", "float v")),
        ply(face=FACE.replace("int v", "quaternion v")),
        ply(face=FACE + "element edge 0\n"),
        ply().replace(b"vertex 3", b"vertex -3"),
        ply().replace(b"vertex 3", b"vertex 999999999999999999"),
        ply().replace(b"end_header\n", b""),
        b"",
    ],
)
def test_everything_that_is_not_plain_is_left_to_trimesh(tmp_path, content):
    (tmp_path / "other.ply").write_bytes(content)
    assert read_plain_ply(tmp_path / "other.ply") is None


def test_a_plain_file_with_more_faces_than_allowed_is_refused(tmp_path):
    (tmp_path / "one.ply").write_bytes(ply())
    with pytest.raises(MeshError, match="1 faces, the limit is 0"):
        read_scene(tmp_path / "one.ply", "", 0)


@pytest.mark.parametrize("content", [ply(), TEXT.encode()])
def test_a_plain_file_is_read_without_importing_trimesh(tmp_path, content):
    (tmp_path / "one.ply").write_bytes(content)
    code = (
        "import sys, pathlib\nfrom mbf_mesh_nav.files.mesh_io import read_mesh\n"
        f"read_mesh(pathlib.Path({str(tmp_path / 'one.ply')!r}))\nprint('trimesh' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "False\n"


@settings(deadline=None)
@given(st.lists(st.tuples(*[st.integers(-40, 40)] * 3), min_size=3, max_size=9), st.sampled_from([0.0, 0.5, 1.0, 3.0]))
def test_boundaries_are_joined_wherever_two_points_are_within_the_distance(places, distance):
    points = 0.5 * np.array(places, dtype=np.float64)
    corners = np.arange(3 * (len(points) // 3), dtype=np.int32).reshape(-1, 3)
    used = points[: corners.size]
    apart = np.linalg.norm(used[:, None] - used, axis=2)
    of_one_face = np.arange(corners.size)[:, None] // 3 == np.arange(corners.size) // 3

    target = join_boundaries(points, np.full(corners.shape, -1, np.int32), corners, distance)

    near = (apart <= distance) & ~np.eye(len(used), dtype=bool)
    if (near & of_one_face).any() or (near.sum(axis=1) > 1).any():  # more than pairs, or in one face
        return
    expected, (ends, others) = np.arange(len(points)), np.nonzero(near)
    expected[ends] = np.minimum(ends, others)
    assert target.tolist() == expected.tolist()
