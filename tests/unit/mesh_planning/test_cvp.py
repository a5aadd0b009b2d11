"""The continuous wave, its directions and the exact descent: against a slow twin, exact shapes and random pairs."""

import heapq
import math

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.mesh.corners import build_corner_ends, write_corner_weights
from mbf_mesh_nav.kernels.wave.cvp import LARGE, propagate_wave
from mbf_mesh_nav.kernels.wave.fronts import unfolded_distance
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.motion.vector_field import VectorField
from mbf_mesh_nav.planners.cvp import CVPPlanner


def wave_from_vertex(mesh_map, source, weights=None, blocked=None, step=0.5):
    """Wave of the kernel (distances, predecessors, seeds), seeded with the straight distances of one vertex's ring."""
    count = len(mesh_map.vertices)
    ends = build_corner_ends(mesh_map.faces, mesh_map.vertex_face_offsets, mesh_map.vertex_faces)
    weights = mesh_map.neighbour_lengths if weights is None else weights
    corner_weights, obtuse_around = np.empty((len(ends), 3), np.float32), np.empty(count, bool)
    write_corner_weights(
        mesh_map.vertex_face_offsets, ends, mesh_map.neighbour_offsets, mesh_map.neighbours, weights,
        np.arange(count, dtype=np.int32), corner_weights, obtuse_around, np.zeros(1, np.uint8),
    )  # fmt: skip
    blocked = np.zeros(count, bool) if blocked is None else blocked
    distances, predecessors = np.full(count, np.inf, np.float32), np.full(count, -1, np.int32)
    ring = mesh_map.neighbours[mesh_map.neighbour_offsets[source] : mesh_map.neighbour_offsets[source + 1]]
    seeds = np.concatenate([[source], ring]).astype(np.int32)
    distances[seeds] = np.linalg.norm(mesh_map.vertices[seeds] - mesh_map.vertices[source], axis=1)
    propagate_wave(
        mesh_map.vertex_face_offsets, ends.reshape(-1), corner_weights.reshape(-1), obtuse_around, blocked,
        distances, predecessors, np.full(count, -1, np.int32), np.full(count, -1, np.int32), seeds,
        np.zeros(0, np.int32), 0.3,
        step, np.zeros(1, np.uint8),
    )  # fmt: skip
    return distances, predecessors, seeds


def slow_wave(mesh_map, weights, seeds, distances, step):
    """The twin: heapq, the rule with arc cosines, obtuse corners looked at again and behind, in float64."""
    count = len(mesh_map.vertices)
    starts = np.repeat(np.arange(count), np.diff(mesh_map.neighbour_offsets))
    length = {
        pair: float(w) for *pair, w in zip(starts, mesh_map.neighbours, weights, strict=True) for pair in [(*pair,)]
    }
    u = {int(seed): float(distances[seed]) for seed in seeds}
    bends = dict.fromkeys(u, -1)
    settled, queue = set(u), [(d, v) for v, d in u.items()]
    heapq.heapify(queue)
    while queue:
        d, v = heapq.heappop(queue)
        if d > u[v]:
            continue
        settled.add(v)
        for face in mesh_map.faces[(mesh_map.faces == v).any(axis=1)].tolist():
            free = [corner for corner in face if corner not in settled] or [obtuse_corner(face, length)]
            if len(free) != 1 or free[0] in (None, v):
                continue
            v3 = free[0]
            v1, v2 = (corner for corner in face if corner != v3)
            known = v2 if v1 == v else v1
            if v not in seeds and u[known] + length[known, v] < u[v]:
                u[v], bends[v] = u[known] + length[known, v], known
                heapq.heappush(queue, (u[v], v))
                break
            if v3 in seeds:
                continue
            candidate, last_bend = offer(mesh_map, length, u, bends, v1, v2, v3, 10.0 * step)
            candidate = max(candidate, min(u[v1], u[v2]))
            if candidate < u.get(v3, math.inf):
                u[v3], bends[v3] = candidate, last_bend
                if v3 not in settled:
                    heapq.heappush(queue, (candidate, v3))
    return np.array([u.get(v, math.inf) for v in range(count)])


def obtuse_corner(face, length):
    for v3 in face:
        v1, v2 = (corner for corner in face if corner != v3)
        if length[v1, v2] ** 2 > 1.2 * (length[v1, v3] ** 2 + length[v2, v3] ** 2):
            return v3
    return None


def offer(mesh_map, length, u, bends, v1, v2, v3, near):
    """What the face v1 v2 v3 offers v3: a distance and its last bend."""
    along = min((u[v1] + length[v1, v3], v1), (u[v2] + length[v2, v3], v2))
    one_bend = bends[v1] == bends[v2]
    to_bend = u.get(bends[v1], 0.0) if one_bend else 0.0
    sides = length[v1, v2], length[v1, v3], length[v2, v3]
    across = across_the_side(u[v1] - to_bend, u[v2] - to_bend, *sides)
    if across is None:
        return along
    virtual = to_bend + across
    if virtual >= u.get(v3, math.inf):
        return virtual, -1
    if one_bend and virtual >= near and obtuse_corner([v1, v2, v3], length) != v3:
        return virtual, bends[v1]
    # Two fronts may meet: ask the corner behind the side.
    shared = mesh_map.faces[(mesh_map.faces == v1).any(axis=1) & (mesh_map.faces == v2).any(axis=1)]
    behind = next((corner for corner in shared.ravel().tolist() if corner not in (v1, v2, v3)), None)
    if behind not in u:
        return along
    ends = length[v1, behind], length[v2, behind]
    predicted = to_bend + from_virtual_source(u[v1] - to_bend, u[v2] - to_bend, sides[0], *ends, below=True)
    if one_bend and u[behind] - predicted < 0.1 * sides[0]:
        return virtual, bends[v1]
    ways = [along]
    for end, other in ((v1, v2), (v2, v1)):
        if behind != bends[end] and bends[behind] != bends[end]:
            continue
        to_center = u.get(bends[end], 0.0)
        radius = length[end, behind] if behind == bends[end] else u[end] - to_center
        passing = (0.001 if behind == bends[other] else 0.3) * sides[0]
        way = by_own_front(radius, u[behind] - to_center, length, end, other, behind, v3, passing)
        if way is not None:
            ways.append((to_center + way, bends[end]))
    best = min(ways)
    if one_bend or (best != along and best[0] <= virtual):
        return best
    if best == along:
        return (virtual if virtual >= max(u[v1], u[v2]) else (virtual + along[0]) / 2.0), -1
    return (virtual + best[0]) / 2.0, best[1]


def apex(c, b, a, below=False):
    """Corner of a triangle over the side from 0 to c, ``b`` from 0 and ``a`` from c, as a complex number."""
    x = (b * b + c * c - a * a) / (2 * c)
    return complex(x, math.sqrt(max(b * b - x * x, 0)) * (-1 if below else 1))


def by_own_front(radius, radius_behind, length, end, other, behind, v3, passing):
    """Length of the line to v3 from a centre off ``other``, with distances from ``end`` and ``behind``; or None."""
    c, b = length[end, other], length[end, behind]
    corner_behind, corner = apex(c, b, length[other, behind], below=True), apex(c, length[end, v3], length[other, v3])
    towards = (b * b + radius**2 - radius_behind**2) / (2 * b)
    if abs(towards) > 1.001 * radius:
        return None
    aside = math.sqrt(max(radius**2 - towards**2, 0.0))
    center = corner_behind / b * complex(towards, -aside)  # of both, the one on the right of the way to ``behind``
    if center.imag >= 0.0:
        return None
    crossing = center.real - center.imag * (corner - center).real / (corner - center).imag
    ray = (corner - center) / abs(corner - center)
    past = ((corner_behind - center) * ray.conjugate()).imag  # left of the ray, where ``end`` is
    return abs(corner - center) if 0.0 < crossing < c and past <= passing else None


def from_virtual_source(u1, u2, c, b, a, below=False):
    sx = (c * c + u1 * u1 - u2 * u2) / (2 * c)
    sy = -math.sqrt(max(u1 * u1 - sx * sx, 0))
    p = (b * b + c * c - a * a) / (2 * c)
    return math.hypot(p - sx, math.sqrt(max(b * b - p * p, 0)) * (-1 if below else 1) - sy)


def across_the_side(u1, u2, c, b, a):
    """Distance of corner 3 if the straight line to it crosses side 12, by the angles at corner 3; else None."""
    if abs(c * c + u1 * u1 - u2 * u2) > 2.002 * c * u1 or abs(c * c + b * b - a * a) > 2.002 * c * b:
        return None  # no triangle has such sides
    u = from_virtual_source(u1, u2, c, b, a)
    cos1, cos2 = (u * u + b * b - u1 * u1) / (2 * u * b), (a * a + u * u - u2 * u2) / (2 * a * u)
    if abs(cos1) > 1 or abs(cos2) > 1:
        return None
    angle0, angle1, angle2 = math.acos((a * a + b * b - c * c) / (2 * a * b)), math.acos(cos1), math.acos(cos2)
    return u if angle1 < angle0 and angle2 < angle0 else None


@pytest.mark.parametrize("seed", range(4))
def test_the_wave_equals_its_slow_twin_on_rough_weighted_ground(seed):
    rng = np.random.default_rng(seed)
    mesh_map = MeshMap.from_heights(rng.uniform(0, 0.3 + 0.2 * seed, (14, 14)), 0.5, 0.4)
    costs = rng.uniform(0, 1, len(mesh_map.vertices))
    starts = np.repeat(np.arange(len(costs)), np.diff(mesh_map.neighbour_offsets))
    weights = (mesh_map.neighbour_lengths * (1 + (costs[starts] + costs[mesh_map.neighbours]) / 2)).astype(np.float32)
    fast, predecessors, seeds = wave_from_vertex(mesh_map, 90, weights)
    straight = np.linalg.norm(mesh_map.vertices - mesh_map.vertices[90], axis=1)
    slow = slow_wave(mesh_map, weights, seeds, straight, 0.5)
    np.testing.assert_allclose(fast, slow, rtol=2e-5, atol=1e-6)
    led = np.setdiff1d(np.arange(len(fast)), seeds)
    assert (fast[predecessors[led]] < fast[led]).all()  # predecessors lead to the source, whatever the corners' angles


def test_the_wave_goes_on_through_all_faces_of_a_vertex_with_more_than_a_number_has_bits():
    angles = np.linspace(0.0, 2.0 * np.pi, 150, endpoint=False)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(150)])
    disc = np.concatenate([[[0.0, 0.0, 0.0]], rim, 1.2 * rim])
    inner, after = np.arange(1, 151), np.roll(np.arange(1, 151), -1)
    fan = np.column_stack([np.zeros(150, int), inner, after])
    ring = np.concatenate(
        [np.column_stack([inner, inner + 150, after]), np.column_stack([inner + 150, after + 150, after])]
    )
    mesh_map = MeshMap.from_arrays(disc, np.concatenate([fan, ring]))
    for source in np.flatnonzero(np.linalg.norm(mesh_map.vertices, axis=1) > 1.1)[::10]:
        fast, _, seeds = wave_from_vertex(mesh_map, source)
        straight = np.linalg.norm(mesh_map.vertices - mesh_map.vertices[source], axis=1)
        slow = slow_wave(mesh_map, mesh_map.neighbour_lengths, seeds, straight, 0.5)
        np.testing.assert_allclose(fast, slow, rtol=2e-5)


def test_on_a_mesh_larger_than_the_caches_distances_on_a_plane_are_exact():
    mesh_map = MeshMap.from_heights(np.zeros((225, 225)), 0.5, 0.5)
    assert len(mesh_map.vertices) > LARGE
    distances, *_ = wave_from_vertex(mesh_map, 30_000)
    straight = np.linalg.norm(mesh_map.vertices - mesh_map.vertices[30_000], axis=1)
    np.testing.assert_allclose(distances, straight, rtol=1e-4, atol=1e-6)


def test_the_field_does_not_depend_on_the_queues_buckets_but_near_the_source(shared_data):
    mesh = trimesh.load(shared_data / "meshes/mesh_mppi/sphere.ply", process=False)
    mesh_map = MeshMap.from_arrays(mesh.vertices, mesh.faces)
    usual, *_ = wave_from_vertex(mesh_map, 0, step=0.1)
    narrow, *_ = wave_from_vertex(mesh_map, 0, step=1e-4)  # most of the queue waits beyond its ring
    np.testing.assert_allclose(narrow, usual, rtol=1e-3)


def test_behind_a_corner_the_front_spreads_from_that_corner():
    # A slit from the border to the middle: behind its tip the exact distance is that to the tip and on from there.
    vertices, faces = heightfield_mesh(np.zeros((61, 61)), 0.1, 0.1)
    slit = np.flatnonzero((abs(vertices[:, 0] - 3.0) < 0.01) & (vertices[:, 1] < 2.95))
    copies = np.arange(len(vertices))
    copies[slit] = len(vertices) + np.arange(len(slit))
    on_the_right = vertices[faces].mean(axis=1)[:, 0] > 3.0
    faces = np.where(on_the_right[:, None], copies[faces], faces)
    mesh_map = MeshMap.from_arrays(np.vstack([vertices, vertices[slit]]), faces)
    places = mesh_map.vertices[:, :2]
    source = int(np.argmin(np.linalg.norm(places - (2.0, 1.0), axis=1)))
    distances, *_ = wave_from_vertex(mesh_map, source, step=0.1)
    hidden = (places[:, 0] > 3.1) & (places[:, 1] < 2.0)
    exact = np.linalg.norm(places[source] - (3.0, 3.0)) + np.linalg.norm(places - (3.0, 3.0), axis=1)
    assert (np.abs(distances - exact)[hidden] / exact[hidden]).max() < 0.005


def test_a_front_enters_an_obtuse_corner_through_the_side_opposite_to_it():
    # Vertex 4 has 149 degrees towards the edge (3, 2). It is reached and settled along the edge from 3 before 2 is.
    vertices = [(0, 0, 0), (1.5, -0.6, 0), (3, -0.6, 0), (1, 0.8, 0), (1.8, 0.6, 0), (1.2, 1.6, 0)]
    mesh_map = MeshMap.from_arrays(vertices, [(0, 1, 3), (1, 2, 3), (3, 2, 4), (3, 4, 5), (0, 3, 5)])
    internal = mesh_map.input_to_internal
    distances, *_ = wave_from_vertex(mesh_map, internal[0])
    np.testing.assert_allclose(distances[internal[4]], math.hypot(1.8, 0.6), rtol=1e-6)


def test_a_way_along_a_side_takes_the_shorter_of_both():
    # Corner 1 has not heard of corner 2 yet, so no source fits both; by the angles the original takes 10 + 0.6.
    distance, side = unfolded_distance(*np.array([10.0, 9.2, 0.6, 0.6, 1.1], np.float32))
    assert side == 2
    assert distance == pytest.approx(9.2 + 1.1)


def test_distances_on_a_plane_are_within_the_accepted_third_of_a_percent(shared_data):
    mesh = trimesh.load(shared_data / "meshes/mesh_mppi/plane.ply", process=False)
    mesh_map = MeshMap.from_arrays(mesh.vertices, mesh.faces)
    center = int(np.argmin(np.linalg.norm(mesh_map.vertices - mesh_map.vertices.mean(axis=0), axis=1)))
    distances, *_ = wave_from_vertex(mesh_map, center)
    exact = np.linalg.norm(mesh_map.vertices - mesh_map.vertices[center], axis=1)
    assert np.abs(distances - exact)[exact > 0].max() <= 0.0033 * exact.max()


def test_distances_on_a_sphere_are_within_the_accepted_percent(shared_data):
    mesh = trimesh.load(shared_data / "meshes/mesh_mppi/sphere.ply", process=False)
    mesh_map = MeshMap.from_arrays(mesh.vertices, mesh.faces)
    distances, *_ = wave_from_vertex(mesh_map, 0)
    cosines = mesh_map.vertices @ mesh_map.vertices[0] / 4.0
    exact = 2.0 * np.arccos(np.clip(cosines, -1, 1))
    beyond = exact > 0.1
    assert (np.abs(distances - exact)[beyond] / exact[beyond]).max() <= 0.0125


def test_every_reachable_random_pair_gets_a_path_as_long_as_its_field_says(make_plugin, paint):
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(80), np.arange(80))
    heights = 0.3 * np.sin(x / 5) * np.cos(y / 7) + rng.uniform(0, 0.03, x.shape)
    mesh_map = MeshMap.from_heights(heights, 0.1, 0.1)
    pillars = rng.uniform(0, 8, (60, 2))

    def costs(vertices):
        nearest = np.linalg.norm(vertices[:, None, :2] - pillars, axis=2).min(axis=1)
        return np.where(nearest < 0.25, np.inf, 0.0)

    paint(mesh_map, costs)
    planner = make_plugin(CVPPlanner, mesh_map)
    free = mesh_map.vertices[~mesh_map.snapshot().lethal]
    ratios = []
    for _ in range(300):
        start, goal = free[rng.choice(len(free), 2, replace=False)] + rng.uniform(-0.03, 0.03, (2, 3))
        result = planner.make_plan(PlanRequest(Pose(tuple(start)), Pose(tuple(goal))))
        assert result.success or "is blocked" in result.message or "no free path" in result.message
        if result.success:
            spot = mesh_map.locate_one(start)
            corners = mesh_map.faces[spot.face]
            ways = result.path.guidance[0].distances[corners] + np.linalg.norm(
                mesh_map.vertices[corners] - start, axis=1
            )
            if ways.min() > 1.0:
                ratios.append(result.path.length / ways.min())
    assert len(ratios) > 200
    assert np.mean(ratios) < 1.01 and max(ratios) < 1.05


def test_the_field_points_at_the_goal_everywhere_on_a_plane(make_plugin, plain):
    mesh_map = plain()
    goal = np.array([2.33, 3.14, 0.0])
    request = PlanRequest(Pose.planar(0.1, 5.9), Pose(tuple(goal)))
    result = make_plugin(CVPPlanner, mesh_map, goal_dist_offset=10.0).make_plan(request)
    (field,) = result.path.guidance
    assert isinstance(field, VectorField)
    for point in np.random.default_rng(0).uniform(0.1, 5.9, (200, 2)):
        spot = mesh_map.locate_one((*point, 0.0))
        expected = (goal - spot.point) / np.linalg.norm(goal - spot.point)
        direction = field.direction_at(mesh_map, spot)
        if np.linalg.norm(goal - spot.point) > 0.8:
            assert direction @ expected > math.cos(math.radians(4))
        assert direction @ expected > math.cos(math.radians(20))
    with pytest.raises(ValueError):
        field.distances[0] = 1.0


def test_a_path_ends_in_the_middle_of_lethal_vertices_if_one_free_vertex_is_left(make_plugin, plain, paint):
    # The goal's nearest vertex (3, 3) is free, the other corners of its face are lethal.
    mesh_map = plain()
    face = mesh_map.faces[mesh_map.locate_one((3.02, 3.04, 0.0)).face]
    lethal = [corner for corner in face if np.linalg.norm(mesh_map.vertices[corner] - [3, 3, 0]) > 0.1]
    paint(mesh_map, lambda v: np.where(np.isin(np.arange(len(v)), lethal), np.inf, 0.0))
    result = make_plugin(CVPPlanner, mesh_map).make_plan(PlanRequest(Pose.planar(0.5, 0.5), Pose.planar(3.02, 3.04)))
    assert result.success, result.message
    assert result.path.length < 3.9
