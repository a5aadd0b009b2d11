"""What comes out from behind a wall by itself moves; what a robot sees more of because it drives past does not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.kernels import clustering, occlusion
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.maps.tracking.rays import Rays
from mbf_abstract.maps.tracking.tracker import MAX_POINTS, Tracker, TrackingParameters
from tests.unit.tracking.scenes import box, scan

PERIOD = 0.1
WALL = [((2.0, 2.5), (5.0, 2.5))]
"""Longer than any object, so it is none, and on no map; what comes out does so at its right end."""


class Watcher:
    """What a map or a tracker has seen of a scene."""

    def __init__(self, seed=0, hall=None):
        self._rng, self._hall, self._tracker = np.random.default_rng(seed), hall, Tracker(TrackingParameters(), "map")
        self.now = 0.0

    def sees(self, sensor, sides):
        """Take in one scan."""
        self.now = round(self.now + PERIOD, 6)
        origin = np.array([*sensor, 0.5])
        if self._hall is None:
            ends, hits = scan(sensor, WALL + sides, self._rng)
            self._tracker.insert(ends[hits], origin * (1.0, 1.0, 0.0), self.now, Rays(ends, np.flatnonzero(hits)))
        else:
            ends, hits = scan(sensor, [*WALL, *sides, ((0.0, 6.45), (10.0, 6.45))], self._rng, 0.5)
            self._hall.map.insert_scan(RangeScan.of_rays("lidar", origin, ends, hits, self.now))
            self._hall.map.update(Pose.planar(*sensor), self.now)

    def objects(self, guarded=False):
        """The objects that are known now; those of the guard."""
        if self._hall is None:
            return self._tracker.objects(self.now, guarded=guarded)
        layer = self._hall.map.layers["moving"]
        return layer.guarded_objects(self.now) if guarded else layer.tracked_objects(self.now)

    def nearest(self, x, y):
        """The object of the guard that is nearest to a place; None if there is none within 0.6 m."""
        known = sorted((math.hypot(one.x - x, one.y - y), one.number, one) for one in self.objects(guarded=True))
        return known[0][2] if known and known[0][0] < 0.6 else None


def drives(start, vx=0.0, vy=0.0):
    """Where a sensor is at a time [s]."""
    return lambda seconds: (start[0] + vx * seconds, start[1] + vy * seconds)


BELOW, BEHIND, AHEAD = (5.2, 0.8), (3.6, 1.2), (6.8, 1.6)
"""Places of the sensor: across the way that somebody comes out, behind them and ahead of them."""


def watch_who_comes_out(watcher, speed, yaw, sensor):
    """Somebody, 0.8 m long, comes out from behind the wall lengthwise, turned from its direction by a yaw [rad].

    Return the share of scans from the fifth on in which they move for the guard, and the median error of their velocity
    [m/s] in these.
    """
    vx, vy, moving, errors = speed * math.cos(yaw), speed * math.sin(yaw), [], []
    start = 4.45 - 0.25 * abs(math.sin(yaw)), 3.35 - 0.5 * math.sin(yaw)
    for step in range(int(2.2 / speed / PERIOD)):
        x, y = start[0] + vx * step * PERIOD, start[1] + vy * step * PERIOD
        watcher.sees(sensor(step * PERIOD), box(x, y, yaw, 0.8, 0.5))
        one = watcher.nearest(x, y)
        if one is not None:
            moving.append(one.motion is Motion.MOVING)
            errors.append(math.hypot(one.vx - vx, one.vy - vy))
    assert len(moving) > 10, "they are seen"
    return np.mean(moving[4:]), np.median(errors[4:])


@pytest.mark.parametrize("speed", [0.27, 0.5, 0.8])
@pytest.mark.parametrize(
    ("place", "velocity"), [(BELOW, 0.0), (BELOW, 0.2), (BELOW, -0.2), (BEHIND, 0.0), (BEHIND, 0.2), (AHEAD, 0.0)]
)
def test_who_comes_out_lengthwise_has_their_speed_as_soon_as_they_are_known(place, velocity, speed):
    moving, error = watch_who_comes_out(Watcher(), speed, 0.0, drives(place, velocity))
    assert moving > 0.95 and error < 0.03 + 0.05 * speed


@pytest.mark.parametrize("yaw", [-0.7, -0.3, 0.3, 0.7])
@pytest.mark.parametrize("place", [BELOW, AHEAD])
def test_who_comes_out_at_an_angle_has_their_speed_too(place, yaw):
    moving, error = watch_who_comes_out(Watcher(), 0.4, yaw, drives(place))
    assert moving > 0.95 and error < 0.06


@pytest.mark.parametrize("place", [BELOW, BEHIND])
def test_on_both_maps_who_comes_out_has_their_speed(hall, place):
    moving, error = watch_who_comes_out(Watcher(hall=hall), 0.27, 0.0, drives(place, 0.1))
    assert moving > 0.95 and error < 0.05


def drive_past(watcher, speed, yaw, length):
    """Drive along the wall at a speed [m/s] until a shelf behind it is seen; share of looks at which it moves."""
    shelf, looks = box(5.6, 4.0, yaw, length, 0.4), {True: [], False: []}
    for step in range(int(4.5 / speed / PERIOD)):
        watcher.sees((2.0 + speed * step * PERIOD, 1.5), shelf)
        for guarded, moving in looks.items():
            moving += [one.motion is Motion.MOVING for one in watcher.objects(guarded)]
    assert len(looks[False]) > 8, "the shelf is seen"
    return sum(looks[False]), np.mean(looks[True])


@pytest.mark.parametrize("speed", [0.5, 1.0])
@pytest.mark.parametrize("yaw", [-0.5, -0.25, 0.0, 0.25, 0.5])
def test_a_shelf_that_is_uncovered_by_driving_past_the_wall_stands(yaw, speed):
    seen = [drive_past(Watcher(seed), speed, yaw, length) for seed in range(4) for length in (0.6, 1.2)]
    moving, guarded = zip(*seen, strict=True)
    assert sum(moving) == 0 and np.mean(guarded) < 0.2


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_on_both_maps_a_shelf_that_is_uncovered_stands(hall, yaw):
    moving, guarded = drive_past(Watcher(hall=hall), 0.7, yaw, 1.2)
    assert moving == 0 and guarded < 0.15


def test_a_shelf_in_the_shadow_of_who_walks_by_stands():
    watcher, shelf, walker = Watcher(), box(5.0, 2.3, 0.0, 1.4, 0.3), 0
    for step in range(40):
        x = 3.6 + 0.07 * step
        watcher.sees((5.0, 0.0), [*shelf, *box(x, 1.2, 0.0, 0.3, 0.3)])
        for one in watcher.objects():
            assert one.motion is not Motion.MOVING or one.y < 1.7
            walker += one.motion is Motion.MOVING
    assert walker > 20


def test_a_dense_cloud_is_thinned_and_what_hides_its_cluster_is_still_seen():
    """Every second point of a face counts, as there are twice too many; the rays of the others do not hide it."""
    y = np.linspace(0.5, 1.4, 2 * MAX_POINTS)
    face = np.column_stack([np.full(len(y), 2.0), y, np.zeros(len(y))])
    occluder = [[1.0, 0.248, 0.0], [1.0, 0.245, 0.0]]
    for ends in (np.concatenate([face, occluder]), np.concatenate([occluder, face])):
        rays = Rays(ends, np.flatnonzero(ends[:, 0] == 2.0)).thinned(2)
        assert rays.ends[rays.of_points] == pytest.approx(face[::2]) and len(rays.ends) == MAX_POINTS + 2
        boxes = np.array([[2.0, 2.0, 0.5, 1.4, 0.0, float(MAX_POINTS), clustering.NEITHER, clustering.NEITHER]])
        labels = np.zeros(MAX_POINTS, dtype=np.int64)
        occlusion.find_free_sides(rays.ends[rays.of_points], labels, boxes, rays.ends, np.zeros(3), 1.5)
        assert boxes[0, clustering.FREE_Y] == clustering.GREATEST


def naive_free_sides(points, labels, ends, sensor, number):
    """Bearings by atan2, faces by the distances of points from lines; sides as (x, y)."""

    def bearing(point, ahead):
        turned = math.atan2(point[1] - sensor[1], point[0] - sensor[0]) - ahead
        return (turned + math.pi) % (2.0 * math.pi) - math.pi

    own = [point for point, label in zip(points, labels, strict=True) if label == number]
    low, high = np.min(own, axis=0), np.max(own, axis=0)
    ahead = math.atan2(*(0.5 * (low + high) - sensor)[1::-1])
    own.sort(key=lambda point: bearing(point, ahead))
    occluded = set()
    if max(abs(bearing(own[0], ahead)), abs(bearing(own[-1], ahead))) >= 0.5 * math.pi:
        return 0.0, 0.0
    for turned, last, other in ((-1.0, own[0], own[-1]), (1.0, own[-1], own[0])):
        course = math.atan2(last[1] - sensor[1], last[0] - sensor[0])
        far, slope = math.dist(last[:2], sensor[:2]), (last[2] - sensor[2]) / math.dist(last[:2], sensor[:2])
        beside = []
        for end in ends:
            turn, length = turned * bearing(end, course), math.dist(end[:2], sensor[:2])
            flat = abs((end[2] - sensor[2]) / length - slope) <= math.tan(turn) if 0.0 < turn < 1.5 else False
            if flat and math.tan(turn) < occlusion.BESIDE:
                beside.append((turn, length))
        if not beside or min(beside)[1] >= far + occlusion.TOUCHING:
            continue
        span = math.dist(last[:2], other[:2])
        (dx, dy), relative = other[:2] - last[:2], [point[:2] - last[:2] for point in own]
        off = [abs(dx * y - dy * x) / span if span else 0.0 for x, y in relative]
        corner = own[int(np.argmax(off))] if max(off) > occlusion.NOISE else other
        out = max(occlusion.NOISE, occlusion.TOWARDS * math.dist(last[:2], corner[:2]))
        for axis in (0, 1):
            if abs(last[axis] - corner[axis]) > out:
                occluded.add((axis, math.copysign(1.0, last[axis] - corner[axis])))
    return tuple(((axis, -1.0) in occluded) - 1.0 * ((axis, 1.0) in occluded) for axis in (0, 1))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_free_sides_are_those_of_bearings_and_distances(seed):
    rng = np.random.default_rng(seed)
    sensor = np.array([0.1, -0.2, 0.3])
    middles = rng.uniform(-3.0, 3.0, (4, 2))
    points = np.concatenate([middle + rng.uniform(-0.4, 0.4, (6, 2)) for middle in middles])
    points = np.column_stack([points, rng.uniform(0.2, 0.4, len(points))])
    labels = np.repeat(np.arange(4), 6)
    others = np.column_stack([rng.uniform(-3.0, 3.0, (300, 2)), rng.uniform(0.1, 0.5, 300)])
    ends = np.concatenate([others, points])
    boxes = clustering.bounding_boxes(points, labels, 4)
    occlusion.find_free_sides(points, labels, boxes, ends, sensor, 9.0)
    expected = [naive_free_sides(points, labels, ends, sensor, number) for number in range(4)]
    assert boxes[:, [clustering.FREE_X, clustering.FREE_Y]].tolist() == [list(sides) for sides in expected]
