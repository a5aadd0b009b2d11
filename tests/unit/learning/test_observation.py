"""What is observed is what is there, and fast code agrees with its naive twin."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_costmap_nav.grid.costmap import GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
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


def test_scans_that_are_old_missing_or_of_the_future_are_a_problem():
    def problem(now, *scans, sources=(), parameters=NO_PATCH):
        seen = {one.source: one for one in scans}
        return Observer(parameters, flat_mesh(), TransformBuffer(), seen, sources).scan_problem(now, 0.5)

    front, rear = (RangeScan.of_points(name, [(1.0, 0.0, 0.3)], (0, 0, 0.3), 10.0) for name in ("front", "rear"))
    assert problem(10.5, front, rear) == "" and problem(9.8, front) == ""
    assert problem(12.0, front) == "the newest scan of 'front' is 2.00 s old"
    assert problem(4.0, front) == "the newest scan of 'front' is stamped 6.00 s in the future"
    assert problem(10.0) == "no scan of any sensor has come"
    assert problem(10.0, front, sources=("front", "rear")) == "no scan of 'rear' has come"
    assert problem(10.0, front, rear, sources=("front", "rear")) == ""
    forgotten = RangeScan.of_points("demo", [(1.0, 0.0, 0.3)], (0, 0, 0.3), 1.0)
    assert problem(10.0, front, forgotten) and problem(10.0, front, forgotten, sources=("front",)) == ""
    assert problem(10.0, parameters=NO_PATCH.model_copy(update={"scan_sectors": 0})) == ""


def test_only_the_sensors_that_are_named_are_observed():
    scan = RangeScan.of_points("demo", [(1.0, 0.0, 0.3)], (0, 0, 0.3), 1.0)
    named = Observer(NO_PATCH, flat_mesh(), TransformBuffer(), {"demo": scan}, ("lidar",))
    named.set_plan(Path.from_points([(2.0, 0.0, 0.0)]))
    assert named.observe(Pose.planar(0.0, 0.0), Twist())["scan"].tolist() == [3.0] * 7


def test_a_sensor_that_sends_its_first_scan_meanwhile_does_not_disturb_an_observation():
    scans = {}

    class Meanwhile(TransformBuffer):
        """Another thread takes a scan while this one looks up a transform."""

        def lookup(self, *args, **kwargs):
            scans.setdefault("late", scan("late"))
            return super().lookup(*args, **kwargs)

    def scan(name):
        return RangeScan.of_points(name, [(1.0, 0.0, 0.3)], (0, 0, 0.3), 0.0, "laser")

    transforms = Meanwhile()
    transforms.set(Transform((0.0, 0.0, 0.0), parent="map", child="laser", static=True))
    scans["early"] = scan("early")
    seeing = Observer(NO_PATCH, flat_mesh(), transforms, scans)
    seeing.set_plan(Path.from_points([(2.0, 0.0, 0.0)]))
    assert min(seeing.observe(Pose.planar(0.0, 0.0), Twist())["scan"]) == 1.0
    assert scans.keys() == {"early", "late"}


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


@pytest.mark.parametrize(("height", "seen"), [(0.8, 0.8), (1.5, 1.5), (1.9, 1.9), (2.5, -2.0)])
def test_ground_higher_than_the_robot_is_seen_as_such_up_to_the_range(height, seen):
    steps = np.zeros((5, 9))
    steps[:, 5:] = height  # from x = 1 m on
    mesh = MeshMap.from_heights(steps, 1.0, 1.0, -4.0, -2.0)
    p = ObservationParameters(scan_sectors=0, patch_cells=3, patch_spacing=1.5)
    patch = observer(p, navigation_map=mesh).observe(Pose.planar(0.0, 0.0), Twist())["patch"]
    assert patch[2].tolist() == pytest.approx([seen] * 3) and patch[:2].tolist() == [[0.0] * 3] * 2


def test_a_ramp_is_seen_from_its_foot_to_the_range():
    ramp = MeshMap.from_heights(np.tile(np.arange(-4.0, 5.0), (9, 1)), 1.0, 1.0, -4.0, -4.0)  # 45 degrees along x
    p = ObservationParameters(scan_sectors=0, patch_cells=9, patch_spacing=0.5)
    patch = observer(p, navigation_map=ramp).observe(Pose.planar(0.0, 0.0), Twist())["patch"]
    assert patch[:, 4].tolist() == pytest.approx(np.arange(-2.0, 2.01, 0.5).tolist(), abs=1e-6)


def on_a_hill(pitch):
    """A robot 2 m above a plan of an empty level map."""
    return Pose((1.0, 0.1, 2.0), (0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)))


def test_on_a_level_map_heights_and_pitch_change_neither_goal_nor_plan():
    level = LayeredCostmap(GridGeometry(80, 80, 0.1, -4.0, -4.0), [], Footprint([]))
    flat = observer(NO_PATCH, navigation_map=level).observe(Pose.planar(1.0, 0.1), Twist())
    tilted = observer(NO_PATCH, navigation_map=level)
    seen = tilted.observe(on_a_hill(pitch=-0.3), Twist())
    assert all(seen[part] == pytest.approx(flat[part], abs=1e-6) for part in ("goal", "waypoints"))
    assert tilted.tracker.deviation == pytest.approx(0.1)
    assert observer(NO_PATCH).observe(on_a_hill(pitch=-0.3), Twist())["goal"] != pytest.approx(flat["goal"], abs=0.1)
