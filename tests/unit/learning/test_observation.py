"""What is observed is what is there, and fast code agrees with its naive twin."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_mesh_nav.map.mesh_map import MeshMap
from terrain.learning.observation import ObservationParameters, Observer
from terrain.worlds.heightfield import Heightfield

NO_PATCH = ObservationParameters(scan_sectors=7, scan_range=3.0, waypoints=3, waypoint_spacing=0.5)
coordinates = st.floats(-4.0, 4.0)
points = st.lists(st.tuples(coordinates, coordinates, st.floats(-1.0, 2.0)), max_size=20)


def naive_sectors(p, pose, cloud):
    """One point after the other."""
    nearest = [p.scan_range] * p.scan_sectors
    for x, y, z in cloud:
        dx, dy = x - pose.x, y - pose.y
        ahead = dx * math.cos(pose.yaw) + dy * math.sin(pose.yaw)
        left = dy * math.cos(pose.yaw) - dx * math.sin(pose.yaw)
        if p.lowest <= z - pose.z <= p.highest:
            sector = int((math.atan2(left, ahead) + math.pi) / (2.0 * math.pi) * p.scan_sectors) % p.scan_sectors
            nearest[sector] = min(nearest[sector], math.hypot(ahead, left))
    return nearest


def hills():
    heights = np.random.default_rng(2).uniform(0.0, 0.4, (24, 30))
    return Heightfield(heights, 0.25, 0.25)


def observer(parameters, scans=(), navigation_map=None):
    made = Observer(parameters, navigation_map or flat_mesh(), TransformBuffer(), {one.source: one for one in scans})
    made.set_plan(Path.from_points([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 2.0, 0.0)]))
    return made


def flat_mesh():
    return MeshMap.from_heights(np.zeros((3, 3)), 10.0, 10.0, -10.0, -10.0)


@settings(max_examples=40)
@given(points, points, st.tuples(coordinates, coordinates, st.floats(-3.0, 3.0)))
def test_sectors_hold_the_nearest_points_of_all_scans(one, other, at):
    pose = Pose.planar(*at)
    scans = [RangeScan.of_points(name, cloud, (0, 0, 0), 0.0) for name, cloud in (("a", one), ("b", other))]
    seen = observer(NO_PATCH, scans).observe(pose, Twist())["scan"]
    assert seen == pytest.approx(naive_sectors(NO_PATCH, pose, one + other), abs=1e-5)


def test_rays_that_hit_nothing_and_sensors_that_are_silent_see_free_space():
    scan = RangeScan.of_rays("a", (0, 0, 0.3), [(1.0, 0.0, 0.3)], [False], 0.0)
    assert observer(NO_PATCH, [scan]).observe(Pose.planar(0.0, 0.0), Twist())["scan"].tolist() == [3.0] * 7
    seeing = observer(NO_PATCH, [scan])
    assert (seeing.scan_age(2.0), observer(NO_PATCH).scan_age(2.0)) == (2.0, math.inf)
    assert observer(NO_PATCH.model_copy(update={"scan_sectors": 0})).scan_age(2.0) == 0.0


def test_goal_plan_and_velocity_are_in_the_frame_of_the_robot():
    seen = observer(NO_PATCH).observe(Pose.planar(1.5, 0.1, 0.5 * math.pi), Twist.planar(0.3, 0.1, -0.2))
    assert seen["goal"] == pytest.approx([1.9, -0.5, 1.0, 0.0], abs=1e-6)
    assert seen["waypoints"].ravel() == pytest.approx([-0.1, -0.5, 0.4, -0.5, 0.9, -0.5], abs=1e-6)
    assert seen["velocity"] == pytest.approx([0.3, 0.1, -0.2])


def test_every_part_has_the_shape_and_the_range_that_its_bounds_state():
    p = ObservationParameters(scan_sectors=5, waypoints=2, patch_cells=3)
    seen = observer(p).observe(Pose.planar(500.0, 0.0), Twist.planar(99.0))
    assert seen.keys() == p.bounds().keys()
    for name, (lowest, highest) in p.bounds().items():
        assert seen[name].shape == lowest.shape and seen[name].dtype == lowest.dtype == np.float32
        assert (seen[name] >= lowest).all() and (seen[name] <= highest).all()
    assert seen["patch"].tolist() == [[-2.0] * 3] * 3  # off the map


@settings(max_examples=25)
@given(st.floats(1.5, 5.5), st.floats(1.5, 4.0), st.floats(-3.0, 3.0))
def test_a_patch_holds_the_heights_of_the_ground_around_the_robot(x, y, yaw):
    ground = hills()
    mesh = MeshMap.from_heights(ground.heights, ground.dx, ground.dy)
    p = ObservationParameters(scan_sectors=0, patch_cells=3, patch_spacing=0.4)
    seen = observer(p, navigation_map=mesh).observe(Pose.planar(x, y, yaw, 0.2), Twist())["patch"]
    for i, ahead in enumerate((-0.4, 0.0, 0.4)):
        for j, left in enumerate((-0.4, 0.0, 0.4)):
            there = x + ahead * math.cos(yaw) - left * math.sin(yaw), y + ahead * math.sin(yaw) + left * math.cos(yaw)
            assert seen[i, j] == pytest.approx(float(ground.height_at(*there)) - 0.2, abs=1e-5)


def test_under_a_ceiling_the_floor_is_the_ground():
    corners = [(x, y, z) for z in (0.0, 3.0) for x, y in ((-5, -5), (5, -5), (5, 5), (-5, 5))]
    storeys = MeshMap.from_arrays(corners, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    p = ObservationParameters(scan_sectors=0, patch_cells=3)
    for z in (0.1, 3.1):
        seen = observer(p, navigation_map=storeys).observe(Pose.planar(0.0, 0.0, z=z), Twist())["patch"]
        assert seen == pytest.approx(np.full((3, 3), -0.1), abs=1e-6)
