"""A run is written as a bag of ROS 2 that others read, and that replays to the costmap its sensors would give."""

from dataclasses import replace

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_abstract.drive_log import DriveLog, LoggedScan, read_drive_log
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import GridView, MeshView
from mbf_abstract.server.factory import read_config
from mbf_abstract.server.standing_server import StandingRobot
from mbf_abstract.session import NavigationSession
from mbf_ros.bags.export import messages_of
from mbf_ros.bags.reading import BagError
from mbf_ros.bags.writing import write_bag
from terrain.recording.drive_logs import drive_log_of, recording_of

CONFIG = """\
backend: costmap
planners: [{name: straight, type: straight_line}]
global_costmap:
  {width: 20.0, height: 20.0, resolution: 0.1, origin_x: -10.0, origin_y: -10.0, robot_radius: 0.2,
   layers: [{name: obstacles, type: obstacle}],
   obstacles: {footprint_clearing_enabled: false, sources: {points: {max_obstacle_height: 9.0}}}}
local_costmap: {rolling_window: true, width: 2.0, height: 2.0, robot_radius: 0.2, layers: []}
"""
GRID = GridView(np.array([[0.0, 0.5], [1.0, np.nan]], np.float32), (0.0, 1.0, 0.0, 1.0))
MESH = MeshView(np.eye(3), np.array([[0, 1, 2]], np.int32), np.array([0.0, 0.5, np.inf], np.float32))


def make_log(seed, scans=6):
    """A drive along a random track; its lidar stands 0.1 m ahead of the robot's middle."""
    rng = np.random.default_rng(seed)
    times = 0.1 * np.arange(31)
    steps = np.cumsum(rng.normal(0.0, 0.05, (31, 3)), axis=0)
    poses = [Pose.planar(x, y, yaw, 0.01) for x, y, yaw in steps.tolist()]
    seen = []
    for time in np.sort(rng.uniform(0.0, 3.0, scans)).tolist():
        here = poses[min(int(time / 0.1), 30)]
        points = here.rotation.dot(rng.uniform(-3.0, 3.0, (40, 3)).T).T + here.position
        seen.append(LoggedScan(time, here.position + np.array([0.1, 0.0, 0.2]), points))
    rows = np.array([[*pose.position, *pose.orientation] for pose in poses])
    return DriveLog(
        name="random", backend="costmap", frame_id="map", outline=np.array([(-0.2, -0.2), (0.2, -0.2), (0.0, 0.2)]),
        start=poses[0], goals=(), times=times, poses=rows, twists=rng.normal(size=(31, 3)),
        commands=np.full((31, 3), np.nan), scans=seen, maps=[(0.0, GRID), (2.0, MESH)],
        paths=[(1.0, rng.normal(size=(5, 3))), (2.0, np.zeros((0, 3)))],
    )  # fmt: skip


def read(bag):
    """(topic, stamp of the recording [s], message) of everything in a bag, by rosbags itself."""
    with AnyReader([bag]) as reader:
        return [(one.topic, time / 1e9, reader.deserialize(raw, one.msgtype)) for one, time, raw in reader.messages()]


def pose_at(log, time):
    """The naive twin: the robot's transform in the map by interpolation between the samples around ``time``."""
    samples = [
        Transform(tuple(p[:3]), tuple(p[3:]), stamp=t) for t, p in zip(log.times, log.poses.tolist(), strict=True)
    ]
    number = max(k for k, one in enumerate(samples[:-1]) if one.stamp <= time)
    return samples[number].interpolate(samples[number + 1], time)


def test_the_bag_has_standard_messages_in_the_order_of_time(tmp_path):
    log = make_log(1)
    write_bag(tmp_path / "bag", messages_of(log, "base"))
    found = read(tmp_path / "bag")
    counts = {topic: sum(name == topic for name, _, _ in found) for topic in {name for name, _, _ in found}}
    assert counts == {
        "/tf_static": 1, "/tf": 37, "/odom": 31, "/cmd_vel": 31, "/points": 6, "/plan": 1,
        "/global_costmap/costmap": 1, "/mesh_map": 1,
    }  # fmt: skip
    assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
    grid = next(one for topic, _, one in found if topic == "/global_costmap/costmap")
    assert grid.data.tolist() == [0, 49, 99, -1] and grid.info.resolution == 0.5
    odometry = [one for topic, _, one in found if topic == "/odom"][7]
    assert odometry.twist.twist.linear.x == log.twists[7, 0] and odometry.pose.pose.position.x == log.poses[7, 0]
    assert (odometry.child_frame_id, odometry.header.frame_id) == ("base", "odom")
    plan = next(one for topic, _, one in found if topic == "/plan")
    assert [p.pose.position.y for p in plan.poses] == log.paths[0][1][:, 1].tolist()


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        write_bag(tmp_path / name / "bag", messages_of(make_log(2)))
    files = sorted(file.name for file in (tmp_path / "first" / "bag").iterdir())
    assert files == ["bag.mcap", "metadata.yaml"]
    for name in files:
        first, second = ((tmp_path / one / "bag" / name).read_bytes() for one in ("first", "second"))
        assert first == second


@pytest.mark.parametrize("seed", range(4))
def test_an_exported_bag_replays_to_the_costmap_of_the_runs_own_scans(tmp_path, configuration, replayed, seed):
    log = make_log(seed)
    write_bag(tmp_path / "bag", messages_of(log))
    again = replayed(tmp_path / "bag", CONFIG)
    assert again.topics["/points"].used_as == "points" and not again.topics["/points"].dropped
    with NavigationSession() as session:
        server = session.serve(*read_config(configuration(CONFIG)), StandingRobot(session.clock))
        for scan in log.scans:
            session.clock.sleep_until(scan.time)
            turned = pose_at(log, scan.time).rotation
            T_map_sensor = Transform(tuple(scan.origin.tolist()), turned)
            carried = T_map_sensor.inverse().apply(scan.points).astype(np.float32)  # as a cloud carries them
            server.take_scan(RangeScan.of_points("points", T_map_sensor.apply(carried), scan.origin, scan.time))
        session.clock.sleep_until(3.0)
        server.served["global_costmap"].update()
        expected = server.map_view().costs
    assert np.count_nonzero(expected >= 1.0) > 10
    np.testing.assert_array_equal(again.log.maps[-1][1].costs, expected)


def test_poses_of_an_exported_bag_are_those_of_the_run(tmp_path, replayed):
    log = make_log(3)
    write_bag(tmp_path / "bag", messages_of(log))
    again = replayed(tmp_path / "bag", CONFIG).log
    assert len(again.times) == 30  # at 0 s nothing had come
    written = [round(time * 1e9) / 1e9 for time in (*log.times.tolist(), *(scan.time for scan in log.scans))]
    newest = [max(time for time in written if time < now) for now in again.times.tolist()]
    expected = [pose_at(log, time).translation for time in newest]
    np.testing.assert_allclose(again.poses[:, :3], expected, atol=1e-9)  # stamps are written as whole nanoseconds


def test_the_command_exports_the_recording_of_a_run(tmp_path):
    log = make_log(4)
    recording_of(log).save(tmp_path / "recording.npz")
    kept = read_drive_log(tmp_path)
    assert all((a.origin == b.origin).all() for a, b in zip(kept.scans, log.scans, strict=True))
    result = CliRunner().invoke(make_app(), ["bag", "export", str(tmp_path)])
    assert result.exit_code == 0 and "6 /points" in result.output, result.output
    assert len(read(tmp_path / "bag")) == 109
    again = CliRunner().invoke(make_app(), ["bag", "export", str(tmp_path)])
    assert again.exit_code == 2 and "expected a folder that does not exist yet" in again.output


def test_folders_without_one_recording_are_refused(tmp_path):
    result = CliRunner().invoke(make_app(), ["bag", "export", str(tmp_path)])
    assert result.exit_code == 2 and "expected the recording of a run, got no such file" in result.output
    for name in ("ann", "bob"):
        (tmp_path / name).mkdir()
        recording_of(make_log(0)).save(tmp_path / name / "recording.npz")
    result = CliRunner().invoke(make_app(), ["bag", "export", str(tmp_path)], env={"COLUMNS": "300"})
    assert (
        result.exit_code == 2
        and "expected the folder of one robot, got that of 2" in result.output
        and "bob" in result.output
    )


def test_scans_of_older_recordings_begin_where_the_robot_was():
    recording = replace(recording_of(make_log(5)), scan_origins=np.zeros((0, 3)))
    log = drive_log_of(recording)
    nearest = np.searchsorted(log.times, [scan.time for scan in log.scans])
    assert all((scan.origin == log.poses[row, :3]).all() for scan, row in zip(log.scans, nearest, strict=True))


def test_messages_are_made_one_after_the_other():
    log = make_log(6)
    log.scans[-1] = replace(log.scans[-1], points=None)
    messages = messages_of(log)
    assert next(messages).topic == "/tf_static"
    with pytest.raises(IndexError):
        list(messages)


def test_a_bag_that_cannot_be_completed_is_not_there(tmp_path):
    def fails():
        yield next(iter(messages_of(make_log(6))))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_bag(tmp_path / "bag", fails())
    assert not list(tmp_path.iterdir())
    assert write_bag(tmp_path / "bag", messages_of(make_log(6)))["/points"] == 6
    assert [file.name for file in tmp_path.iterdir()] == ["bag"]


def test_a_bag_that_is_there_is_not_overwritten(tmp_path):
    with pytest.raises(BagError, match="does not exist yet"):
        write_bag(tmp_path, [])
