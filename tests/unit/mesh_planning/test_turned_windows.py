"""A string of which only the part beside each turn is pulled is that of pulling all of it after every turn."""

import numpy as np
import pytest
from numba import njit

from mbf_mesh_nav.kernels.mesh.corners import corner_of
from mbf_mesh_nav.kernels.wave.corridor_windows import faces_round, path_length, turned_corridor
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, link_faces
from mbf_mesh_nav.kernels.wave.funnel import pull_string
from mbf_mesh_nav.kernels.wave.straight_corridors import _free_side, straighten
from mbf_mesh_nav.map.mesh_map import MeshMap


@njit
def straightened_as_a_whole(mesh, corridor, start, goal):
    """``straighten`` with the whole string pulled for each turn that is tried."""
    points, marks = pull_string(mesh.vertices, mesh.faces, corridor, start, goal)
    index, is_changed, tries = 0, False, 0
    while len(corridor) > 1:
        if index >= len(corridor) - 1:
            if not is_changed:
                break
            index, is_changed = 0, False
        vertex = np.int64(marks[index + 1])
        if vertex < 0:
            index += 1
            continue
        first, last = np.int64(index), np.int64(index + 1)
        while first > 0 and corner_of(mesh.faces[corridor[first - 1]], vertex) >= 0:
            first -= 1
        while last < len(corridor) - 1 and corner_of(mesh.faces[corridor[last + 1]], vertex) >= 0:
            last += 1
        side = _free_side(mesh, corridor, points, vertex, first, last)
        index = last
        if side < 0:
            continue
        tries += 1
        fan = faces_round(mesh, corridor, vertex, first, last, side)
        turned = turned_corridor(corridor, fan, first, last)
        pulled, pulled_marks = pull_string(mesh.vertices, mesh.faces, turned, start, goal)
        if path_length(pulled, np.int64(0), np.int64(len(turned))) < path_length(
            points, np.int64(0), np.int64(len(corridor))
        ):
            points, marks, corridor, is_changed = pulled, pulled_marks, turned, True
            index = max(first - 1, 0)
    return points, corridor, tries


def corridors(mesh_map, rng, count, blocked_share):
    """Corridors below winding lines over a map, some of whose vertices are blocked."""
    low, high = mesh_map.vertices[:, :2].min(axis=0), mesh_map.vertices[:, :2].max(axis=0)
    for _ in range(count):
        blocked = rng.random(len(mesh_map.vertices)) < blocked_share
        mesh = FreeFaces(mesh_map.vertices, mesh_map.faces, mesh_map.face_neighbours, blocked)
        shares = np.linspace(0.0, 1.0, 4000)
        waves, phase = rng.uniform(0.5, 3.0), rng.uniform(0.0, 2.0 * np.pi)
        aside = 0.5 + rng.uniform(0.1, 0.45) * np.sin(2.0 * np.pi * waves * shares + phase)
        curve = low + np.column_stack([0.02 + 0.96 * shares, aside]) * (high - low)
        faces = mesh_map.locate(np.column_stack([curve, np.zeros(len(curve))])).faces
        linked, pieces = link_faces(mesh, faces[np.concatenate([[True], np.diff(faces) != 0])])
        for _, _, begin, end in pieces.tolist():
            if end - begin > 5:
                yield mesh, linked[begin:end].copy()


def grounds():
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(60) * 0.2, np.arange(50) * 0.2)
    hills = 0.8 * np.sin(1.3 * x) * np.cos(1.1 * y)
    yield "hills", MeshMap.from_heights(hills + rng.normal(0.0, 0.02, x.shape), 0.2, 0.2)
    yield "flat", MeshMap.from_heights(np.zeros((50, 60)), 0.2, 0.2)
    yield "peaks", MeshMap.from_heights(rng.uniform(0.0, 1.5, (12, 12)), 1.0, 1.0)


@pytest.mark.parametrize("ground", grounds(), ids=lambda ground: ground[0])
@pytest.mark.parametrize("blocked_share", [0.0, 0.03])
def test_strings_are_those_of_pulling_all_of_them_after_every_turn(ground, blocked_share):
    rng, tries, longest = np.random.default_rng(5), 0, 0
    for mesh, corridor in corridors(ground[1], rng, 12, blocked_share):
        ends = [tuple(mesh.vertices[mesh.faces[face]].mean(axis=0).tolist()) for face in corridor[[0, -1]]]
        points, faces = straighten(mesh, corridor, *ends, True)
        whole, whole_faces, turns = straightened_as_a_whole(mesh, corridor, *ends)
        length, expected = (np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in (points, whole))
        assert length == pytest.approx(expected, rel=1e-9)
        if ground[0] != "flat":  # where several corridors are equally long, rounding decides
            np.testing.assert_array_equal(faces, whole_faces)
            assert points.tobytes() == whole.tobytes()
        assert points.tobytes() == pull_string(mesh.vertices, mesh.faces, faces, *ends)[0].tobytes()
        tries, longest = tries + turns, max(longest, len(corridor))
    assert tries > 30 and longest > 40
