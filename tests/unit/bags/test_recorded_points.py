"""What the sensors of a bag hit becomes a point cloud in one frame, which a map is built from."""

import numpy as np
import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_ros.bags.reading import BagError, open_bag
from mbf_ros.bags.recorded_points import PointOptions, read_recorded_points, write_points
from mbf_ros.bags.replay_options import ReplayOptions
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.sensors import point_cloud
from tests.unit.bags.conftest import SPEED, WALL, drive, header, make_bag, message, scan, static, tf

EVERYTHING = PointOptions()
FLOOR = np.random.default_rng(0).uniform((0.5, -3.0, -0.3), (6.0, 3.0, -0.3), (400, 3))


def cloud(seconds, x, frame="laser"):
    """The floor below a drive, as a sensor at ``x`` sees it."""
    values = point_cloud(FLOOR - (x, 0.0, 0.0), frame, 0.0, MessageContext())
    return message(seconds, "/points", "sensor_msgs/PointCloud2", {**values, "header": header(frame, seconds)})


def run(*arguments):
    return CliRunner().invoke(make_app(), ["bag", "points", *map(str, arguments)])


def points_of(bag, chosen=EVERYTHING, **options):
    with open_bag(bag) as opened:
        return read_recorded_points(opened, chosen, ReplayOptions(**options))


def test_more_points_than_memory_is_meant_for_are_refused_with_what_takes_fewer(tmp_path):
    bag = make_bag(tmp_path, drive())
    with open_bag(bag) as opened, pytest.raises(BagError, match="more than 2120 points; take fewer by --every or"):
        read_recorded_points(opened, EVERYTHING, ReplayOptions(), max_points=21 * 101 - 1)
    with open_bag(bag) as opened:
        assert len(read_recorded_points(opened, EVERYTHING, ReplayOptions(), max_points=21 * 101).points) == 21 * 101


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_scans_of_a_drive_lie_where_the_wall_is(tmp_path, kind):
    found = points_of(make_bag(tmp_path, drive(), kind))
    assert found.scans == 21 and found.points.shape == (21 * 101, 3)
    np.testing.assert_allclose(found.points[:, 0], WALL, atol=1e-6)


def test_transforms_that_were_recorded_after_a_scan_place_it_too(tmp_path):
    late = [static(), *(tf(0.1 * tick, SPEED * 0.1 * tick, delay=0.3) for tick in range(30))]
    scans = [scan(0.05 + 0.1 * tick, SPEED * (0.05 + 0.1 * tick)) for tick in range(20)]
    found = points_of(make_bag(tmp_path, sorted([*late, *scans], key=lambda one: one.time)))
    assert found.scans == 20 and not found.left_out
    np.testing.assert_allclose(found.points[:, 0], WALL, atol=1e-6)


def test_point_clouds_come_before_scans_and_become_a_map(tmp_path):
    seconds = [0.1 * tick for tick in range(10)]
    clouds = [cloud(second, SPEED * second + 0.1) for second in seconds]  # the laser is 0.1 m ahead
    bag = make_bag(tmp_path, sorted([*drive(1.0), *clouds], key=lambda one: one.time))
    result = run(bag, "--out", tmp_path / "points.ply", "--every", 2)
    assert result.exit_code == 0 and "points.ply: 2000 points of 5 scans" in result.output
    points = read_clouds([tmp_path / "points.ply"]).points
    np.testing.assert_allclose(points, np.tile(FLOOR, (5, 1)), atol=1e-6)
    scans = run(bag, "--out", tmp_path / "scans.ply", "--points", "/base_scan", "--max-range", 3.5)
    assert scans.exit_code == 0 and "of 11 scans" in scans.output
    kept = read_clouds([tmp_path / "scans.ply"]).points
    assert 0 < len(kept) < 11 * 101
    np.testing.assert_allclose(kept[:, 0], WALL, atol=1e-6)


def test_scans_that_cannot_be_placed_are_counted_with_the_reason(tmp_path):
    early = scan(0.0, 0.0, delay=0.0)
    lost = scan(0.2, 0.1, frame="/nowhere")
    messages = [static(), early, *(tf(0.1 * tick, SPEED * 0.1 * tick) for tick in range(1, 20)), lost, scan(0.5, 0.25)]
    bag = make_bag(tmp_path, sorted(messages, key=lambda one: one.time))
    found = points_of(bag)
    reasons = {"/base_scan: older than the transforms": 1, "/base_scan: unknown frame": 1}
    assert found.scans == 1 and found.left_out == reasons
    result = run(bag, "--out", tmp_path / "points.ply")
    assert "note: 1 scans left out, /base_scan: unknown frame" in result.output


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--frame", "mars"], "no point could be placed in the frame 'mars': /base_scan: unknown frame (21 times)"),
        (["--points", "/odom"], "--points: expected topics of range sensors (/base_scan), got '/odom'"),
        (["--out", "points.xyz"], "expected a .ply file, got 'points.xyz'"),
    ],
)
def test_what_cannot_be_done_is_one_error(tmp_path, monkeypatch, arguments, text):
    monkeypatch.chdir(tmp_path)
    make_bag(tmp_path, drive())
    refused = run("drive", *arguments)
    assert refused.exit_code == 2 and text in " ".join(refused.output.split())


def test_odometry_may_stand_for_transforms(tmp_path):
    bag = make_bag(tmp_path, [one for one in drive() if one.topic != "/tf"])
    found = points_of(bag, PointOptions(frame="odom"), odometry_as_transform=True)
    assert found.scans == 21
    np.testing.assert_allclose(found.points[:, 0], WALL, atol=1e-6)
    assert run(bag, "--out", tmp_path / "points.ply").exit_code == 2


@pytest.mark.parametrize("frame", ["map\nelement vertex 7", "карта", "\udcff", "\\n", "robot 1/map"])
def test_no_name_of_a_frame_ruins_the_header(tmp_path, frame):
    write_points(tmp_path / "points.ply", FLOOR, frame)
    np.testing.assert_array_equal(read_clouds([tmp_path / "points.ply"]).points, FLOOR)
    comment = (tmp_path / "points.ply").read_bytes().splitlines()[2]
    named = comment.removeprefix(b"comment points of a bag in the frame ")
    assert named.decode("unicode_escape") == frame
