"""The tilt's limits hold anywhere on a path: against a twin that puts single footprints on the surface by rays."""

import math
from unittest import mock

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.kernels.layers.chassis import scratch_for
from mbf_mesh_nav.kernels.search.heading_astar import DRIVABLE, FORBIDDEN, find_out_along
from mbf_mesh_nav.layers.tilt import TiltLayer, TiltParameters
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import passes_blocked_corner
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner
from mbf_mesh_nav.search import heading_search
from mbf_mesh_nav.search.drive_graph import DriveGraph
from mbf_mesh_nav.search.end_stretches import headings_within
from mbf_mesh_nav.search.heading_limits import FootprintLimits, NormalLimits

ROUNDING = 1e-6
"""Heights are linear between the places looked at, so nothing but rounding is left."""
SAMPLES = 0.02  # m


def rough_map(seed, rigid=False):
    """Hills of a random irregular grid with a tilt layer that forbids a good part of the headings."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(25) * 0.2, np.arange(25) * 0.2)
    waves = rng.uniform(0.8, 2.5, 4)
    height = 0.25 * np.sin(waves[0] * x + waves[1] * y) + 0.15 * np.sin(waves[2] * x - waves[3] * y)
    mesh_map = MeshMap.from_heights(height + rng.normal(0.0, 0.02, x.shape), 0.2, 0.2)
    measures = {"wheelbase": 0.5, "track": 0.4, "ground_clearance": 0.12, "center_of_mass_height": 0.0, "rigid": rigid}
    settings_ = TiltParameters(max_roll=0.3, max_pitch_up=0.4, max_pitch_down=0.35, **measures)
    layer = TiltLayer(LayerContext("tilt", mesh_map.topology, mesh_map.locator, settings_))
    layer.recompute()
    mesh_map.set_layers(LayerGraph([layer]), "tilt", 1.0)
    return mesh_map


def footprint_use(mesh_map, settings_, points, cosine, sine):
    """Greatest share of a limit (n,) of footprints in the middle of which is a point (n, 3)."""
    forward, left = np.array([cosine, sine, 0.0]), np.array([-sine, cosine, 0.0])
    base, track = settings_.wheelbase, settings_.track
    heights = []
    for ahead, aside in ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)):
        origins = points + ahead * base * forward + aside * track * left
        origins[:, 2] = 10.0
        heights.append(10.0 - mesh_map.locator.cast_rays(origins, [0.0, 0.0, -1.0])[1])
    front_left, rear_left, rear_right, front_right = np.array(heights)
    sides = np.array([front_left - rear_left, front_right - rear_right]) / base
    axles = np.array([front_left - front_right, rear_left - rear_right]) / track
    rise, lean, middle = sides.mean(axis=0), axles.mean(axis=0), np.mean(heights, axis=0)
    if not settings_.rigid:
        sides, axles = rise[None], lean[None]
    use = np.abs(axles).max(axis=0) / math.tan(settings_.max_roll)
    use = np.maximum(use, sides.max(axis=0) / math.tan(settings_.max_pitch_up))
    use = np.maximum(use, -sides.min(axis=0) / math.tan(settings_.max_pitch_down))
    bump = points[:, 2] - middle
    offsets = mesh_map.vertices[None] - points[:, None]
    ahead, aside = offsets[..., 0] * cosine + offsets[..., 1] * sine, offsets[..., 1] * cosine - offsets[..., 0] * sine
    below = (np.abs(ahead) < 0.5 * base - ROUNDING) & (np.abs(aside) < 0.5 * track - ROUNDING)
    plane = middle[:, None] + rise[:, None] * ahead + lean[:, None] * aside
    bump = np.maximum(bump, np.where(below, mesh_map.vertices[:, 2] - plane, -np.inf).max(axis=1))
    return np.maximum(use, bump / settings_.ground_clearance)


def samples_of(start, end):
    share = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(end - start) / SAMPLES))
    return start + share[:, None] * (end - start)


@given(seed=st.integers(0, 10**6), rigid=st.booleans())
@settings(max_examples=25, deadline=None)
def test_no_sample_of_a_path_is_over_the_limits(make_plugin, seed, rigid):
    mesh_map, rng = rough_map(seed, rigid), np.random.default_rng(seed)
    settings_ = mesh_map.layers["tilt"].parameters
    planner = make_plugin(HeadingAStarPlanner, mesh_map, cost_limit=math.inf)
    limits = FootprintLimits(mesh_map, mesh_map.layers["tilt"], DriveGraph(mesh_map.topology))
    for _ in range(12):
        ends = rng.uniform(0.7, 4.1, (2, 2))
        heights = 10.0 - mesh_map.locator.cast_rays(np.column_stack([ends, [10.0, 10.0]]), [0.0, 0.0, -1.0])[1]
        poses = [
            Pose.planar(*end, yaw, z=z) for end, yaw, z in zip(ends, rng.uniform(-3.0, 3.0, 2), heights, strict=True)
        ]
        result = planner.make_plan(PlanRequest(*poses, angle_tolerance=rng.choice([0.0, 3.14])))
        if not result.success or limits.standing(mesh_map.locate_one(poses[0].position), poses[0].yaw) > 1.0:
            continue
        for start, end in zip(result.path.positions[:-1], result.path.positions[1:], strict=True):
            x, y, _ = end - start
            points = samples_of(start, end)
            np.testing.assert_allclose(mesh_map.locate(points).distances, 0.0, atol=1e-9)
            use = footprint_use(mesh_map, settings_, points, x / math.hypot(x, y), y / math.hypot(x, y))
            assert use.max() <= 1.0 + ROUNDING


@given(seed=st.integers(0, 10**6), rigid=st.booleans())
@settings(max_examples=15, deadline=None)
def test_the_use_of_a_stretch_is_that_of_its_worst_sample(seed, rigid):
    mesh_map, rng = rough_map(seed, rigid), np.random.default_rng(seed)
    layer = mesh_map.layers["tilt"]
    limits = FootprintLimits(mesh_map, layer, DriveGraph(mesh_map.topology))
    for _ in range(10):
        x, y = rng.uniform(0.8, 4.0, 2)
        face = mesh_map.locate_one((x, y, 0.3)).face
        start, end = rng.dirichlet(np.ones(3), 2) @ mesh_map.vertices[mesh_map.faces[face]]
        way = (end - start)[:2] / np.linalg.norm((end - start)[:2])
        points = start + np.linspace(0.0, 1.0, 2000)[:, None] * (end - start)
        sampled = max(footprint_use(mesh_map, layer.parameters, points, *way).max(), 0.0)
        use = limits.driving(face, start, end, [])
        assert sampled <= use + ROUNDING
        assert use <= sampled + 0.02  # what may lie between two samples 0.1 mm apart, or comes below the belly's edge


@given(seed=st.integers(0, 10**6), rigid=st.booleans())
@settings(max_examples=10, deadline=None)
def test_looking_at_moves_last_finds_the_cost_of_looking_at_each(make_plugin, seed, rigid):
    mesh_map, rng = rough_map(seed, rigid), np.random.default_rng(seed)
    standing = np.flatnonzero(mesh_map.layers["tilt"].allowed.all(axis=1))
    assume(len(standing) >= 2)
    ends = (Pose(tuple(mesh_map.vertices[vertex])) for vertex in rng.choice(standing, 2, replace=False))
    request = PlanRequest(*ends, angle_tolerance=math.pi)
    plans, looked_at = [], []
    for lazy_searches in (heading_search.LAZY_SEARCHES, 0):
        with mock.patch.object(heading_search, "LAZY_SEARCHES", lazy_searches):
            planner = make_plugin(HeadingAStarPlanner, mesh_map)
            plans.append(planner.make_plan(request))
            looked_at.append(np.count_nonzero(planner._current_limits().known))
    lazy, careful = plans
    assert lazy.success == careful.success
    assert not lazy.success or lazy.cost == pytest.approx(careful.cost, rel=1e-5)
    assert looked_at[0] <= looked_at[1]


@given(seed=st.integers(0, 10**6))
@settings(max_examples=8, deadline=None)
def test_a_tolerance_ends_where_it_does_when_all_moves_are_known_before(make_plugin, seed):
    mesh_map, rng = rough_map(seed), np.random.default_rng(seed)
    allowed = mesh_map.layers["tilt"].allowed
    assume(allowed.all(axis=1).any() and not allowed.any(axis=1).all())
    careful = make_plugin(HeadingAStarPlanner, mesh_map)
    limits, scratch = careful._current_limits(), scratch_for(len(mesh_map.vertices))
    moves = careful._search.graph.moves
    begins = np.repeat(np.arange(len(mesh_map.vertices)), np.diff(moves.offsets))
    for move in np.column_stack([begins, moves.ends]).astype(np.int32):
        find_out_along(mesh_map.topology.surface, moves, move, limits.known, limits.chassis, scratch)
    for _ in range(6):
        start = rng.choice(np.flatnonzero(allowed.all(axis=1)))
        goal = rng.choice(np.flatnonzero(~allowed.any(axis=1)))
        ends = (Pose(tuple(mesh_map.vertices[vertex])) for vertex in (start, goal))
        request = PlanRequest(*ends, dist_tolerance=1.0, angle_tolerance=math.pi)
        results = [planner.make_plan(request) for planner in (make_plugin(HeadingAStarPlanner, mesh_map), careful)]
        assert results[0].success == results[1].success
        if results[0].success:
            np.testing.assert_array_equal(*(result.path.positions[-1] for result in results))


def test_standing_at_a_vertex_is_allowed_where_the_layer_says_so():
    mesh_map = rough_map(3)
    layer = mesh_map.layers["tilt"]
    limits = FootprintLimits(mesh_map, layer, DriveGraph(mesh_map.topology))
    inner = np.flatnonzero((np.abs(mesh_map.vertices[:, :2] - 2.4) < 1.6).all(axis=1))[::5]
    for vertex in inner.tolist():
        face = mesh_map.vertex_faces[mesh_map.vertex_face_offsets[vertex]]
        place = SurfacePoint(int(face), np.zeros(3), mesh_map.vertices[vertex], 0.0)
        found = [limits.standing(place, heading * math.pi / 8) <= 1.0 for heading in range(16)]
        np.testing.assert_array_equal(found, layer.allowed[vertex])


def test_without_a_layer_edges_keep_the_limits_of_the_normals_at_their_own_heading():
    rng = np.random.default_rng(5)
    mesh_map = MeshMap.from_heights(rng.uniform(0.0, 0.15, (12, 12)), 0.3, 0.25)
    graph = DriveGraph(mesh_map.topology)
    limits = NormalLimits(mesh_map, 0.25, 0.3, graph)
    known = limits.known[graph.is_edge]
    begins = np.repeat(np.arange(len(mesh_map.vertices)), np.diff(mesh_map.neighbour_offsets))
    for slot, (begin, end) in enumerate(zip(begins, mesh_map.neighbours, strict=True)):
        x, y, _ = mesh_map.vertices[end] - mesh_map.vertices[begin]
        share = np.linspace(0.0, 1.0, 20)[:, None]
        normals = (1.0 - share) * mesh_map.vertex_normals[begin] + share * mesh_map.vertex_normals[end]
        pitch = np.arctan2(normals[:, :2] @ [x, y] / math.hypot(x, y), normals[:, 2])
        roll = np.arctan2(normals[:, :2] @ [-y, x] / math.hypot(x, y), normals[:, 2])
        kept = bool((np.abs(roll) <= 0.25).all() and (np.abs(pitch) <= 0.3).all())
        assert (known[slot] == DRIVABLE) == kept
    assert (limits.known[~graph.is_edge] == FORBIDDEN).all()


def test_a_last_stretch_across_a_flank_is_not_driven(make_plugin):
    """The goal is half up a flank, straight above one corner of its face; the shorter way comes from the other one."""
    y = np.arange(31) * 0.5
    height = np.interp(y, [5.0, 5.5], [0.0, 0.4])
    mesh_map = MeshMap.from_heights(np.tile(height[:, None], (1, 31)), 0.5, 0.5)
    planner = make_plugin(HeadingAStarPlanner, mesh_map, max_roll=0.3, max_pitch=1.0)
    goal = Pose.planar(5.5, 5.25, math.pi / 2, z=0.2)
    result = planner.make_plan(PlanRequest(Pose.planar(2.0, 1.5, 0.0), goal))
    assert result.success, result.message
    np.testing.assert_allclose(result.path.positions[-2], [5.5, 5.0, 0.0])


def test_any_heading_within_the_tolerance_will_do_at_a_goal(make_plugin):
    """Across the flank the goal's heading is forbidden; a goal that takes any is reached."""
    y = np.arange(61) * 0.2
    height = np.clip(np.tan(0.4) * (3.0 - np.abs(y - 6.0)), 0.0, None)
    ridge = MeshMap.from_heights(np.tile(height[:, None], (1, 61)), 0.2, 0.2)
    planner = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.5)
    start, goal = Pose.planar(2.0, 1.0, 1.57), Pose.planar(2.0, 4.5, 0.0, z=0.6)
    assert planner.make_plan(PlanRequest(start, goal)).outcome == GetPathOutcome.NO_PATH_FOUND
    assert planner.make_plan(PlanRequest(start, goal, angle_tolerance=0.5)).outcome == GetPathOutcome.NO_PATH_FOUND
    for tolerance in (1.58, 3.14):
        assert planner.make_plan(PlanRequest(start, goal, angle_tolerance=tolerance)).success


def test_where_any_heading_will_do_the_goal_s_own_is_not_the_reason(make_plugin):
    y = np.arange(61) * 0.2
    height = np.clip(np.tan(0.4) * (3.0 - np.abs(y - 6.0)), 0.0, None)
    ridge = MeshMap.from_heights(np.tile(height[:, None], (1, 61)), 0.2, 0.2)
    planner = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.3)
    ends = Pose.planar(2.0, 1.0, 1.57), Pose.planar(2.0, 4.5, 0.0, z=0.6)
    assert "at the goal" in planner.make_plan(PlanRequest(*ends)).message
    message = planner.make_plan(PlanRequest(*ends, angle_tolerance=3.14159)).message
    assert "at the goal" not in message and "of all headings" in message


def test_headings_within_a_tolerance_include_the_nearest_and_all_of_them_are_any():
    assert headings_within(Pose.planar(0.0, 0.0, 0.3), 0.0) == {1}
    assert headings_within(Pose.planar(0.0, 0.0, 3.0), 0.6) == {7, 8, 9}
    assert headings_within(Pose.planar(0.0, 0.0, 0.3), math.pi) == set()
    assert headings_within(None, 0.0) == set()


@given(seed=st.integers(0, 10**6))
@settings(max_examples=100, deadline=None)
def test_a_line_passes_a_blocked_corner_where_a_sample_of_it_is_nearest_to_that(seed):
    rng = np.random.default_rng(seed)
    shares, blocked = rng.dirichlet(np.full(3, 0.6), 2), rng.random(3) < 0.4
    assume(not blocked[shares.argmax(axis=1)].any())
    ends = [SurfacePoint(0, share, np.zeros(3), 0.0) for share in shares]
    line = shares[0] + np.linspace(0.0, 1.0, 20001)[:, None] * (shares[1] - shares[0])
    ranked = np.sort(line, axis=1)
    clear = ranked[:, 2] - ranked[:, 1] > 1e-4
    seen = bool(blocked[line.argmax(axis=1)[clear]].any())
    found = passes_blocked_corner(*ends, blocked)
    assert found or not seen
    assume(seen == bool(blocked[line.argmax(axis=1)].any()))
    assert found == seen


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_robot_beyond_the_limits_may_leave_as_it_stands(make_plugin, way):
    y = np.arange(61) * 0.2
    height = np.clip(np.tan(0.4) * (3.0 - np.abs(y - 6.0)), 0.0, None)
    ridge = MeshMap.from_heights(np.tile(height[:, None], (1, 61)), 0.2, 0.2)
    planner = make_plugin(HeadingAStarPlanner, ridge, max_roll=0.2, max_pitch=0.5)
    start = Pose.planar(2.05, 3.07, 0.0 if way > 0 else math.pi, z=0.02)
    result = planner.make_plan(PlanRequest(start, Pose.planar(2.0, 1.0, -1.57)))
    assert result.success, result.message
