"""Octrees of OctoMap give the centres of their occupied voxels; whatever is wrong with a file is one clear error."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surveyed_ground import ground, hills

from mbf_mesh_nav.building.clouds.octomap_points import read_octomap_points
from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.mesh.mesh_report import MeshError

VOXEL = 0.1
LEVELS = 16
# A tree is a number, the log-odds of a leaf, or a list of eight trees, None where nothing is known.
LEAVES = st.none() | st.sampled_from([-2.0, -0.4, 0.0, 0.8, 3.5])
SMALL_TREES = st.recursive(
    LEAVES,
    lambda tree: st.lists(tree, min_size=8, max_size=8).filter(lambda children: children != [None] * 8),
    max_leaves=20,
)


def is_leaf(tree):
    return not isinstance(tree, list)


def below(tree, children):
    """A tree whose root is ``tree``'s ancestor over these children, the last one nearest to it."""
    for child in reversed(children):
        tree = [tree if number == child else None for number in range(8)]
    return tree


def depth_of(tree):
    return 0 if is_leaf(tree) else 1 + max(depth_of(child) for child in tree)


def nodes_of(tree):
    return 0 if tree is None else 1 if is_leaf(tree) else 1 + sum(map(nodes_of, tree))


def full_bytes(tree, colour=b""):
    """Each node in turn: log-odds, colour, a bit for each child."""
    if is_leaf(tree):
        return struct.pack("<f", tree) + colour + bytes([0])
    bits = sum(1 << number for number, child in enumerate(tree) if child is not None)
    children = b"".join(full_bytes(child, colour) for child in tree if child is not None)
    return struct.pack("<f", 0.0) + colour + bytes([bits]) + children


def binary_bytes(tree):
    """Each inner node in turn: two bits for each child."""
    kinds = [0 if child is None else 3 if not is_leaf(child) else 2 if child >= 0.0 else 1 for child in tree]
    own = bytes(sum(kind << (2 * place) for place, kind in enumerate(half)) for half in (kinds[:4], kinds[4:]))
    return own + b"".join(binary_bytes(child) for child in tree if not is_leaf(child))


def occupied_centres(tree, corner=(-(2**15),) * 3, edge=2**LEVELS):
    """Centres [m] of all occupied voxels, cube by cube."""
    if tree is None or (is_leaf(tree) and tree < 0.0):
        return []
    if is_leaf(tree):
        steps = range(edge)
        return [
            tuple((low + step + 0.5) * VOXEL for low, step in zip(corner, (x, y, z), strict=True))
            for x in steps
            for y in steps
            for z in steps
        ]
    half, centres = edge // 2, []
    for number, child in enumerate(tree):
        at = tuple(low + half * ((number >> axis) & 1) for axis, low in enumerate(corner))
        centres += occupied_centres(child, at, half)
    return centres


def write_octomap(file, tree, *, kind="OcTree", size=None, voxel=VOXEL, line=None, body=None):
    """Write a .bt or .ot file."""
    is_binary = file.suffix == ".bt"
    line = line or ("# Octomap OcTree binary file" if is_binary else "# Octomap OcTree file")
    size = nodes_of(tree) if size is None else size
    head = f"{line}\n# (feel free to add / change comments)\n#\nid {kind}\nsize {size}\nres {voxel}\ndata\n"
    if body is None:
        body = binary_bytes(tree) if is_binary else full_bytes(tree, bytes(3) if kind == "ColorOcTree" else b"")
    file.write_bytes(head.encode() + body)
    return file


def tree_of(voxels, level=LEVELS):
    """Tree over the occupied voxels (n, 3) of whole numbers from 0 on; eight equal leaves are one."""
    if len(voxels) == 0:
        return None
    if level == 0:
        return 0.85
    half = 2 ** (level - 1)
    upper = voxels >= half
    number = upper @ (1, 2, 4)
    children = [tree_of((voxels - half * upper)[number == child], level - 1) for child in range(8)]
    return children[0] if is_leaf(children[0]) and children == [children[0]] * 8 else children


DEEP = below([0.5, -0.5, 0.0, None, None, None, [1.0] * 7 + [-1.0], None], [7] * 14)


@pytest.mark.parametrize(("name", "kind"), [("a.bt", "OcTree"), ("a.ot", "OcTree"), ("a.ot", "ColorOcTree")])
@settings(max_examples=25, deadline=None)
@given(SMALL_TREES, st.lists(st.integers(0, 7), min_size=16, max_size=16))
def test_points_are_the_centres_of_the_occupied_voxels(tmp_path_factory, name, kind, tree, ancestors):
    depth = min(depth_of(tree), 3)
    tree = below(tree if depth_of(tree) <= 3 and tree is not None else 0.5, ancestors[: LEVELS - 1 - depth])
    file = write_octomap(tmp_path_factory.mktemp("octree") / name, tree, kind=kind)
    points = read_octomap_points(file, 10_000_000).points
    expected = np.array(occupied_centres(tree)).reshape(-1, 3)
    assert points.shape == expected.shape
    by_place = [array[np.lexsort(array.T)] for array in (points, expected)]
    np.testing.assert_allclose(*by_place, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["hills.bt", "hills.ot"])
def test_a_map_is_built_from_an_octree_as_from_the_points_in_it(tmp_path, name):
    points = ground(np.random.default_rng(3), hills)
    voxels = np.unique(np.floor(points / VOXEL).astype(np.int64), axis=0) + 2 ** (LEVELS - 1)
    cloud = read_clouds([write_octomap(tmp_path / name, tree_of(voxels))])
    surface = build_surface(cloud.points)
    errors = surface.vertices[:, 2] - hills(*surface.vertices[:, :2].T)
    assert np.sqrt(np.mean(errors**2)) < 0.5 * VOXEL
    assert cloud.notes == (f"{name}: {len(voxels)} occupied voxels of 0.1 m",)


@pytest.mark.parametrize(
    ("name", "options", "text"),
    [
        (
            "a.bt",
            {"line": "# Octomap OcTree file"},
            "not an OctoMap .bt file: expected '# Octomap OcTree binary file', got",
        ),
        (
            "a.ot",
            {"line": "# Octomap OcTree binary file"},
            "not an OctoMap .ot file: expected '# Octomap OcTree file', got",
        ),
        ("a.bt", {"kind": "CountingOcTree"}, "id: expected OcTree or ColorOcTree, got 'CountingOcTree'"),
        ("a.bt", {"size": "many"}, "its header has no usable id, size and res: invalid literal"),
        ("a.ot", {"size": 0}, "size: its tree has 0 nodes"),
        ("a.ot", {"voxel": "nan"}, "res: expected the edge of a voxel in metres, got nan"),
        ("a.bt", {"voxel": -0.1}, "res: expected the edge of a voxel in metres, got -0.1"),
        ("a.bt", {"size": 10**9}, "the file is cut off: expected 1000000000 nodes, found at most"),
        ("a.ot", {"size": 10**9}, "the file is cut off: expected 1000000000 nodes, found 27"),
        ("a.bt", {"size": 26}, "it is damaged: expected 26 nodes, its tree has 27"),
        ("a.ot", {"size": 26}, "the file is cut off: expected 26 nodes, found an end within its tree"),
        ("a.bt", {"body": binary_bytes(DEEP)[:-2]}, "expected 27 nodes, found an end within its tree"),
        ("a.bt", {"body": 17 * bytes([3, 0])}, "it is damaged: its tree is deeper than 16 levels"),
        ("a.ot", {"body": 27 * bytes([0, 0, 0, 0, 1])}, "it is damaged: its tree is deeper than 16 levels"),
        ("a.bt", {"body": bytes([2, 0]), "size": 2}, "35184372088832 points, the limit is 50000000"),
        ("a.ot", {"body": full_bytes(-1.0), "size": 1}, "there is no point in it"),
    ],
)
def test_an_octree_that_cannot_be_used_is_refused(tmp_path, name, options, text):
    file = write_octomap(tmp_path / name, DEEP, **options)
    with pytest.raises(MeshError) as caught:
        read_clouds([file])
    assert text in str(caught.value)


def test_a_header_without_an_end_is_refused(tmp_path):
    file = tmp_path / "a.ot"
    file.write_bytes(b"# Octomap OcTree file\nid OcTree\nsize 5\n")
    with pytest.raises(MeshError, match="cut off within its header: there is no line 'data'"):
        read_clouds([file])
    file.write_bytes(b"# Octomap OcTree file\n" + 200 * b"#\n")
    with pytest.raises(MeshError, match="no line 'data' among the first 100"):
        read_clouds([file])
