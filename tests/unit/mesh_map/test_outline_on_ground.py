"""A long robot's outline on a mesh: where it stands, what it sweeps, and what the map answers for it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.queries import AS_CONFIGURED, CellState, Fit, PlaceQuery
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap

LONG = ((0.55, 0.25), (-0.4, 0.25), (-0.4, -0.25), (0.55, -0.25))
L_SHAPE = ((0.55, 0.25), (-0.4, 0.25), (-0.4, -0.25), (0.1, -0.25), (0.1, 0.05), (0.55, 0.05))
EDGE = 0.1


class PaintedLayer(MeshLayer):
    """Lethal where a test says so."""

    def compute(self):
        return self._costs, self._lethal


def with_posts(mesh_map, lethal):
    """A map on which some vertices (V,) bool are lethal."""
    layer = PaintedLayer(LayerContext("posts", mesh_map.topology, mesh_map.locator, PaintedLayer.Parameters()))
    layer.replace(np.where(lethal, np.inf, 0.0).astype(np.float32), lethal)
    mesh_map.set_layers(LayerGraph([layer]), "posts")
    mesh_map.inscribed_radius, mesh_map.footprint, mesh_map.check_footprint = 0.25, LONG, True
    return mesh_map


def with_posts_at(mesh_map, *places):
    """The same, at the vertices next to places."""
    distances = np.linalg.norm(mesh_map.vertices[:, None] - np.array(places, dtype=float)[None], axis=2)
    lethal = np.zeros(len(mesh_map.vertices), dtype=bool)
    lethal[distances.argmin(axis=0)] = True
    return with_posts(mesh_map, lethal)


@pytest.fixture
def plain():
    """A level plain of 6 m x 6 m."""
    return MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE)


def under(corners, x, y, yaw, vertices):
    """The twin of the kernel on level ground: which of all vertices lie inside the outline."""
    offsets = vertices[:, :2] - (x, y)
    c, s = math.cos(yaw), math.sin(yaw)
    local = np.column_stack([c * offsets[:, 0] + s * offsets[:, 1], c * offsets[:, 1] - s * offsets[:, 0]])
    return inside_polygon(local, np.array(corners))


@given(st.floats(1.0, 5.0), st.floats(1.0, 5.0), st.floats(-3.2, 3.2), st.integers(0, 99), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_outline_touches_the_lethal_vertices_that_a_naive_twin_finds_inside_it(x, y, yaw, seed, is_l):
    plain = MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE)
    with_posts(plain, np.random.default_rng(seed).random(len(plain.vertices)) < 0.02)
    plain.footprint = L_SHAPE if is_l else LONG
    touched = under(plain.footprint, x, y, yaw, plain.vertices) & plain.snapshot().lethal
    pose = Pose.planar(x, y, yaw)
    outline, spots = plain.outline(), plain.locate([pose.position])
    vertex = outline.touched(spots, pose.rotation[None, :, 0])[0]
    assert (vertex >= 0) == touched.any()
    assert vertex < 0 or touched[vertex]


@given(
    st.floats(1.5, 4.5),
    st.floats(1.5, 4.5),
    st.floats(-3.2, 3.2),
    st.sampled_from([(0.5, 0.0), (-0.4, 0.3), (0.4, 1.0), (0.0, 0.8), (0.0, -1.2)]),
    st.integers(0, 99),
)
@settings(max_examples=40, deadline=None)
def test_a_motion_is_stopped_where_the_twin_counts_more_under_the_outline_than_before(x, y, yaw, motion, seed):
    plain = MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE)
    with_posts(plain, np.random.default_rng(seed).random(len(plain.vertices)) < 0.01)
    lethal = plain.snapshot().lethal
    vx, wz = motion
    reach = math.hypot(0.55, 0.25)
    steps = math.ceil(max(abs(wz) * reach, abs(vx)) / 0.05)
    driven = np.concatenate([[(x, y, yaw)], arc_poses((x, y, yaw), vx, 0.0, wz, 1.0, 1.0 / steps)])
    counts = [int((under(LONG, *pose, plain.vertices) & lethal).sum()) for pose in driven.tolist()]
    pose = Pose.planar(x, y, yaw)
    found = plain.outline().swept(plain.locate_one(pose.position), pose, Twist.planar(vx, wz=wz), 1.0)
    assert bool(found) == (max(counts) > counts[0])


def test_the_outline_lies_in_the_slope_and_not_in_the_plan(plain):
    slope = MeshMap.from_heights(np.tile(0.1 * np.arange(61), (61, 1)), EDGE, EDGE)  # 45 degrees up along x
    with_posts_at(slope, (3.5, 3.0, 3.5))
    uphill = Pose((3.0, 3.0, 3.0), (0.0, -math.sin(math.pi / 8), 0.0, math.cos(math.pi / 8)))
    assert slope.pose_check(AS_CONFIGURED)(uphill).state < CellState.LETHAL, "0.71 m of slope, its front is at 0.55 m"
    with_posts_at(plain, (3.5, 3.0, 0.0))
    assert plain.pose_check(AS_CONFIGURED)(Pose.planar(3.0, 3.0)).state is CellState.LETHAL


def test_what_stands_on_another_storey_is_not_touched():
    ground = MeshMap.from_heights(np.zeros((41, 41)), EDGE, EDGE)
    lower = ground.vertices
    faces = np.concatenate([ground.faces, ground.faces + len(lower)])
    storeys = MeshMap.from_arrays(np.concatenate([lower, lower + np.array([0.0, 0.0, 0.4])]), faces)
    with_posts_at(storeys, (2.4, 2.0, 0.4))
    check = storeys.pose_check(AS_CONFIGURED)
    assert check(Pose.planar(2.0, 2.0)).state < CellState.LETHAL
    assert check(Pose.planar(2.0, 2.0, 0.0, 0.4)).state is CellState.LETHAL


def test_every_question_to_the_map_is_one_about_the_outline(plain):
    with_posts_at(plain, (3.5, 3.0, 0.0))
    towards, across = Pose.planar(3.0, 3.0), Pose.planar(3.0, 3.0, 0.5 * math.pi)
    frame = Transform((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), "map", "map_plane")
    for check in (plain.pose_check(AS_CONFIGURED), plain.path_check(AS_CONFIGURED)):
        assert [check(pose).state >= CellState.LETHAL for pose in (towards, across)] == [True, False]
    poses = np.array([(3.0, 3.0, 0.0), (3.0, 3.0, 0.5 * math.pi)])
    assert plain.plane_check(AS_CONFIGURED, frame)(poses).tolist() == [Fit.TOUCHES, Fit.FREE]
    assert plain.pose_check(PlaceQuery(safety_dist=0.3))(across).state is CellState.LETHAL, "it is grown by that"
    answer = plain.find_valid_pose(towards, 0.5, 0.1, AS_CONFIGURED)
    assert answer.pose.x == pytest.approx(2.9) and answer.pose.y == pytest.approx(3.0), "the front is 0.55 m ahead"
    back = Pose.planar(2.7, 3.0)
    assert "would touch it at (3.50, 3.00" in plain.obstacle_on_path(back, Twist.planar(0.3), 1.0)
    assert "would touch it at (3.50, 3.00" in plain.obstacle_ahead(across, Twist.planar(wz=-1.0), 1.5)
    plain.check_footprint = False
    assert plain.obstacle_on_path(back, Twist.planar(0.1), 1.0) == "", "the disc does not come so far"


def test_a_robot_that_touches_something_may_leave_it_and_drive_no_deeper(plain):
    with_posts_at(plain, (3.5, 3.0, 0.0), (3.4, 3.0, 0.0))
    here = Pose.planar(2.95, 3.0)
    assert plain.obstacle_on_track(here, Twist.planar(-0.3), 1.0) == ""
    assert "would touch it" in plain.obstacle_on_track(here, Twist.planar(0.3), 1.0)


def test_a_footprint_that_is_to_be_checked_is_given():
    with pytest.raises(ValidationError, match="check_footprint needs a footprint, which is empty"):
        MeshMapParameters(check_footprint=True)
