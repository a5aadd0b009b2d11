"""Several sensors on one map: whose rays clear what, late and silent ones, and scans that are refused."""

import numpy as np
import pytest
from seen_floor import SENSOR, floor_map, post, see

from mbf_abstract.maps.sensing import RangeScan


def lidar(hits: np.ndarray, stamp: float, source: str = "lidar", frame_id: str = "map") -> RangeScan:
    """A full turn of rays of 10 m at 0.5 m height from (2, 2); those ``hits`` [rad] end at something 1 m away."""
    angles = np.radians(np.arange(0.0, 360.0, 0.5))
    ranges = np.where(np.isin(np.arange(720), hits), 1.0, 10.0)
    origin = np.array([2.0, 2.0, 0.5])
    ends = origin + ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(720)])
    return RangeScan(source, frame_id, origin, ends, ranges < 10.0, stamp)


def test_rays_that_hit_nothing_clear_what_they_pass_through():
    mesh = floor_map(decay_time=np.inf)
    mesh.insert_scan(lidar(np.arange(80, 100), 1.0))
    mesh.update(None, 1.0)
    assert mesh.snapshot().lethal.any()
    mesh.insert_scan(lidar(np.zeros(0), 2.0))
    mesh.update(None, 2.0)
    assert not mesh.snapshot().lethal.any()


def test_one_sensor_does_not_make_another_ones_obstacles_forgotten():
    mesh = floor_map()
    see(mesh, post(1.0, 1.0), 1.0, source="front")
    seen = mesh.snapshot().lethal.copy()
    see(mesh, post(3.0, 3.0), 1.01, source="rear")
    assert mesh.snapshot().lethal[seen].all() and mesh.snapshot().lethal.sum() > seen.sum()
    see(mesh, post(3.0, 3.0), 1.02, source="front")
    assert not (mesh.snapshot().lethal & seen).any(), "its own next cloud replaces what it had seen"


def test_a_late_scan_does_not_clear_what_another_sensor_saw_after_it():
    mesh = floor_map(decay_time=5.0)
    hit, origin = np.array([[2.05, 2.02, 0.4]]), np.array(SENSOR)
    beyond = origin + 2.0 * (hit - origin)
    mesh.insert_scan(RangeScan("lidar", "map", origin, hit, np.array([True]), 10.0))
    mesh.update(None, 10.0)

    mesh.insert_scan(RangeScan("camera", "map", origin, beyond, np.array([False]), 9.8))
    mesh.update(None, 9.8)
    assert mesh.snapshot().lethal.sum() == 3

    mesh.insert_scan(RangeScan("camera", "map", origin, beyond, np.array([False]), 10.1))
    mesh.update(None, 10.1)
    assert not mesh.snapshot().lethal.any()


def test_a_late_cloud_of_the_same_sensor_does_not_make_a_hit_older_than_it_is():
    mesh = floor_map(decay_time=1.0, clearing=False)
    see(mesh, post(2.0, 2.0), 10.0)
    see(mesh, post(2.0, 2.0), 9.5)

    mesh.update(None, 10.9)
    assert mesh.snapshot().lethal.any()
    mesh.update(None, 11.1)
    assert not mesh.snapshot().lethal.any()


def test_obstacles_of_a_sensor_that_is_no_longer_listened_to_are_forgotten():
    mesh = floor_map(sources=("lidar", "camera"))
    for name, x in (("lidar", 1.05), ("camera", 3.05)):
        hit = np.array([[x, 2.02, 0.4]])
        mesh.insert_scan(RangeScan(name, "map", np.array(SENSOR), hit, np.array([True]), 1.0))
        mesh.update(None, 1.0)
    assert mesh.snapshot().lethal.sum() == 6

    layer = mesh.layers["seen"]
    mesh.set_layer_parameters("seen", layer.parameters.model_copy(update={"sources": ("lidar",)}))

    assert mesh.vertices[mesh.snapshot().lethal][:, 0].max() < 1.5 and mesh.snapshot().lethal.sum() == 3


def test_a_silent_sensor_is_noticed_while_another_speaks():
    mesh = floor_map(expected_update_rate=0.5)
    see(mesh, post(1.0, 1.0), 1.0, source="front")
    see(mesh, post(3.0, 3.0), 1.0, source="rear")
    see(mesh, post(3.0, 3.0), 2.0, source="rear")
    assert mesh.stale_reason(2.0)
    see(mesh, post(1.0, 1.0), 2.0, source="front")
    assert not mesh.stale_reason(2.0)


def test_a_layer_listens_to_its_own_sensors_only_and_waits_for_each():
    mesh = floor_map(sources=("front", "rear"))
    with pytest.raises(ValueError, match=r"'ceiling'; known: \['front', 'rear'\]"):
        see(mesh, post(1.0, 1.0), 1.0, source="ceiling")
    assert not mesh.snapshot().lethal.any()
    see(mesh, post(1.0, 1.0), 1.0, source="front")
    assert mesh.snapshot().lethal.any() and mesh.stale_reason(1.0)
    see(mesh, post(1.0, 1.0), 1.0, source="rear")
    assert not mesh.stale_reason(1.0)


def test_a_cloud_of_nothing_but_unknown_points_says_nothing():
    mesh = floor_map()
    see(mesh, post(2.0, 2.0), 1.0)
    before = mesh.snapshot()
    see(mesh, np.full((5, 3), np.nan), 3.0)
    assert mesh.snapshot() is before and mesh.stale_reason(3.0)


def test_a_stamp_from_the_future_is_no_sign_of_life():
    mesh = floor_map()
    see(mesh, post(2.0, 2.0), 1e6)
    assert mesh.stale_reason(2.0)
    see(mesh, post(2.0, 2.0), 2.1)
    assert not mesh.stale_reason(2.0), "clocks differ a little"


@pytest.mark.parametrize(("origin", "stamp"), [([np.nan, 0.0, 0.5], 1.0), (SENSOR, np.nan), (SENSOR, np.inf)])
def test_a_scan_from_nowhere_or_of_no_time_is_refused(origin, stamp):
    mesh = floor_map()
    with pytest.raises(ValueError, match="must be finite"):
        see(mesh, post(2.0, 2.0), stamp, origin)
    assert not mesh.snapshot().lethal.any()


def test_a_scan_of_another_frame_is_refused():
    with pytest.raises(ValueError, match="in the frame 'laser', the map in 'map'"):
        floor_map().insert_scan(lidar(np.zeros(0), 1.0, frame_id="laser"))


def test_a_disabled_layer_leaves_the_map_free_and_fresh_until_it_is_enabled_again():
    mesh = floor_map(sources=("front",))
    see(mesh, post(2.0, 2.0), 1.0, source="front")
    seen = mesh.snapshot().lethal.copy()
    settings = mesh.layers["seen"].parameters
    mesh.set_layer_parameters("seen", settings.model_copy(update={"enabled": False}))
    assert seen.any() and not mesh.snapshot().lethal.any() and not mesh.stale_reason(100.0)
    see(mesh, post(1.0, 1.0), 2.0, source="front")
    assert not mesh.snapshot().lethal.any()
    mesh.set_layer_parameters("seen", settings)
    assert np.array_equal(mesh.snapshot().lethal, seen)
    mesh.update(None, 2.5)  # takes in what came while it was disabled
    assert mesh.vertices[mesh.snapshot().lethal][:, 0].max() < 1.5
