"""Scans, clouds and single ranges become rays, as REP-117 has them; each has a naive twin."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.maps.sensing import RangeScan
from mbf_ros.messages.geometry import InvalidValueError, MessageContext
from mbf_ros.messages.interfaces import completed
from mbf_ros.messages.json_text import json_text
from mbf_ros.messages.sensors import laser_scan, laser_scan_of, point_cloud, point_cloud_of, range_of

CONTEXT = MessageContext("map", 100.0)
HEADER = {"frame_id": "/laser", "stamp": {"sec": 103, "nanosec": 0}}


def laser(ranges, **fields):
    values = {"header": HEADER, "angle_min": -1.0, "angle_increment": 0.5, "range_min": 0.1, "range_max": 5.0}
    return completed("sensor_msgs/LaserScan", {**values, "ranges": ranges, **fields})


def naive_laser(message):
    """(end, hit) of each ray that counts, one by one."""
    for i, r in enumerate(message["ranges"].tolist()):
        angle = message["angle_min"] + i * message["angle_increment"]
        if r == math.inf:
            yield (5.0 * math.cos(angle), 5.0 * math.sin(angle), 0.0), False
        elif message["range_min"] <= r <= message["range_max"]:
            yield (r * math.cos(angle), r * math.sin(angle), 0.0), True


@given(st.lists(st.floats(-1, 6, width=32) | st.sampled_from([math.inf, -math.inf, math.nan]), max_size=20))
def test_a_scan_has_the_rays_of_its_naive_twin(ranges):
    message = laser(ranges)
    scan = laser_scan_of(message, CONTEXT, "lidar", received=9.0)
    expected = list(naive_laser(message))
    np.testing.assert_allclose(scan.ends, np.array([end for end, _ in expected]).reshape(-1, 3), atol=1e-12)
    assert scan.hits.tolist() == [hit for _, hit in expected]
    assert (scan.frame_id, scan.stamp, scan.source) == ("laser", 3.0, "lidar")


def test_a_scan_without_a_stamp_is_as_old_as_its_arrival():
    assert laser_scan_of(laser([1.0], header={}), CONTEXT, "lidar", received=9.0).stamp == 9.0


@pytest.mark.parametrize("field", ["angle_min", "angle_increment", "range_min", "range_max"])
def test_a_scan_with_an_infinite_angle_is_refused(field):
    with pytest.raises(InvalidValueError, match="expected a finite number"):
        laser_scan_of(laser([1.0], **{field: None}), CONTEXT, "lidar", 0.0)


def test_rays_that_met_nothing_have_an_end_where_a_range_has_none():
    largest = 3.4028234663852886e38
    scan = laser_scan_of(laser([math.inf, 2.0, 1e30], range_max=largest), CONTEXT, "lidar", 0.0).checked()
    fields = {"header": HEADER, "field_of_view": 0.0, "min_range": 0.1, "max_range": largest, "range": math.inf}
    single = range_of(completed("sensor_msgs/Range", fields), CONTEXT, "sonar", 0.0).checked()

    assert scan.hits.tolist() == [False, True]
    assert np.hypot(*scan.ends[0, :2]) == pytest.approx(1e9)
    assert len(single.ends) > 0 and not single.hits.any()


def naive_sectors(scan, rays):
    """Nearest hit of each sector, infinity where only misses are, else NaN."""
    nearest = [math.nan] * rays
    for (x, y, _), hit in zip((scan.ends - scan.origin).tolist(), scan.hits.tolist(), strict=True):
        i = int((math.atan2(y, x) + math.pi) / (2.0 * math.pi / rays)) % rays
        r = math.sqrt(x * x + y * y) if hit else math.inf
        nearest[i] = r if math.isnan(nearest[i]) else min(nearest[i], r)
    return nearest


@given(
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.booleans()), max_size=30), st.sampled_from([4, 36, 360])
)
def test_our_scan_becomes_the_laser_scan_of_its_naive_twin(rays, count):
    ends = [(x, y, 0.3) for x, y, _ in rays]
    scan = RangeScan.of_rays("lidar", (0.5, -0.5, 0.3), ends, [hit for *_, hit in rays], 3.0, "laser")
    message = laser_scan(scan, CONTEXT, count)
    np.testing.assert_array_equal(message["ranges"], np.float32(naive_sectors(scan, count)))
    assert completed("sensor_msgs/LaserScan", json.loads(json_text(message)))["angle_min"] == -math.pi + (
        math.pi / count
    )


@given(st.lists(st.tuples(*[st.floats(-100, 100, width=32)] * 3), max_size=20))
def test_points_come_back_as_they_were(points):
    cloud = np.array(points, dtype=np.float64).reshape(-1, 3)
    text = json_text(point_cloud(cloud, "lidar", 3.0, CONTEXT))
    scan = point_cloud_of(completed("sensor_msgs/PointCloud2", json.loads(text)), CONTEXT, "cloud", 0.0)
    np.testing.assert_array_equal(scan.ends, cloud)
    assert scan.hits.all() and scan.stamp == 3.0


def packed(dtype, points, padding=0, **fields):
    """A cloud in rows of two points, with fields in the order intensity, z, y, x and padding after each row."""
    point = np.dtype([("intensity", "u1"), ("z", dtype), ("y", dtype), ("x", dtype)])
    values = np.zeros((len(points) // 2, 2), point)
    for i, (x, y, z) in enumerate(points):
        values[i // 2, i % 2] = (7, z, y, x)
    rows = b"".join(row.tobytes() + bytes(padding) for row in values)
    datatype = 7 if point["x"].itemsize == 4 else 8
    described = [
        {"name": name, "offset": point.fields[name][1], "datatype": datatype if name != "intensity" else 2, "count": 1}
        for name in point.names
    ]
    message = {
        "header": HEADER,
        "height": len(values),
        "width": 2,
        "fields": described,
        "is_bigendian": dtype.startswith(">"),
        "point_step": point.itemsize,
        "row_step": 2 * point.itemsize + padding,
        "data": list(rows),
    }
    return completed("sensor_msgs/PointCloud2", {**message, **fields})


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", ">f8"])
@pytest.mark.parametrize("padding", [0, 5])
def test_a_cloud_is_read_whatever_its_layout(dtype, padding):
    points = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (math.nan, 0.0, 0.0), (-1.5, 0.5, 0.25)]
    scan = point_cloud_of(packed(dtype, points, padding), CONTEXT, "cloud", 0.0)
    assert scan.ends.tolist() == [[1, 2, 3], [4, 5, 6], [-1.5, 0.5, 0.25]]


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"width": 3}, "needs .* bytes"),
        ({"height": 2**31}, "needs .* bytes"),
        ({"point_step": 1}, "and room for 'x'"),
        ({"row_step": 1}, "row_step 1"),
        ({"data": ""}, "got 0 bytes"),
        ({"fields": []}, "fields: expected x, y and z, got none"),
        ({"fields": [{"name": a, "offset": 0, "datatype": 99} for a in "xyz"]}, "got 99"),
    ],
)
def test_a_cloud_that_is_not_as_large_as_it_says_is_refused(fields, text):
    message = packed("<f4", [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)], **fields)
    with pytest.raises(InvalidValueError, match=text):
        point_cloud_of(message, CONTEXT, "cloud", 0.0)


@pytest.mark.parametrize(
    ("measured", "nearest", "length", "hit"),
    [(2.0, 0.1, 2.0, True), (math.inf, 0.1, 4.0, False), (-math.inf, 4.0, 4.0, True), (math.inf, 4.0, 4.0, False)],
)
def test_a_single_range_fills_its_cone(measured, nearest, length, hit):
    values = {"header": HEADER, "field_of_view": 0.5, "min_range": nearest, "max_range": 4.0, "range": measured}
    scan = range_of(completed("sensor_msgs/Range", values), CONTEXT, "sonar", 0.0)
    angles = [math.atan2(y, x) for x, y, _ in scan.ends]
    assert (min(angles), max(angles)) == pytest.approx((-0.25, 0.25))
    np.testing.assert_allclose(np.sqrt((scan.ends**2).sum(axis=1)), length)
    assert scan.hits.tolist() == [hit] * len(angles)


@pytest.mark.parametrize("measured", [None, 0.05, 9.0])
def test_a_range_that_is_no_measurement_has_no_rays(measured):
    values = {"header": HEADER, "field_of_view": 0.5, "min_range": 0.1, "max_range": 4.0, "range": measured}
    assert len(range_of(completed("sensor_msgs/Range", values), CONTEXT, "sonar", 0.0).ends) == 0
