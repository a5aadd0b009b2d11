"""What a robot reports of itself, right or wrong, is in the recording and in run.mcap, beside what is true."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoderFactory
from scipy.spatial.transform import Rotation

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.view import GridView
from terrain.physics.robot_models import TURTLEBOT
from terrain.recording.recorded_robot import Report, RobotShape, as_mount, joined_reports
from terrain.recording.recorder import Recorder
from terrain.recording.recording import Recording
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.session.session import Session
from terrain.viewer.logs.mcap_log import write_mcap


def quaternion_from_rpy(roll, pitch, yaw):
    x, y, z, w = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_quat().tolist()
    return x, y, z, w


MOUNT = Transform((0.1, 0.0, 0.3), quaternion_from_rpy(0.0, 0.2, 0.5), "base_link", "lidar")
HITS = np.array([[4.0, 1.0, 0.5], [3.0, -2.0, 0.0]])  # in the map


def true_pose(step):
    return Pose((0.1 * step, 0.0, 0.2), quaternion_from_rpy(0.1, -0.2, 0.05 * step), "map")


def estimate(step):
    return Pose((0.1 * step + 0.4, 0.1, 0.2), quaternion_from_rpy(0.0, 0.0, 0.05 * step + 0.1), "map")


def odometry(step):
    return Pose.planar(0.1 * step, 0.01 * step, 0.05 * step, frame_id="odom")


@pytest.fixture
def reporting():
    """A robot that believes to be half a metre from where it is, with odometry from the third sample on."""
    found = Recorder("trial", "costmap", RobotShape.of(TURTLEBOT), true_pose(0), [Pose.planar(9.0, 1.0, 0.5)])
    found.reports.mounts["lidar"] = as_mount(MOUNT)
    for step in range(6):
        reported = odometry(step) if step >= 2 else None
        found.sample(
            0.1 * step, true_pose(step), Twist.planar(1.0), Twist(), Report(estimate(step), reported, Twist.planar(0.9))
        )
    T_map_sensor = Transform.from_pose(true_pose(4), "base_link") @ MOUNT
    found.scan(0.4, HITS, T_map_sensor.translation, "lidar", T_map_sensor.rotation)
    found.scan(0.5, HITS, (0.0, 0.0, 0.0))  # of a sensor whose frame is not known
    for time, size in ((0.0, 0.2), (0.1, 0.2), (0.3, 0.5)):
        found.reports.outline(time, size * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]))
    found.reports.local_map(0.2, "odom", GridView(np.array([[0.0, 1.0]], np.float32), (0.0, 2.0, 0.0, 1.0)))
    return found


class JsonDecoder(DecoderFactory):
    def decoder_for(self, message_encoding, schema):
        return json.loads if message_encoding == "json" and schema.encoding == "jsonschema" else None


def topics_of(file):
    """Every message of a file by topic, with its time [s]."""
    found = {}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[ProtobufDecoderFactory(), JsonDecoder()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time / 1e9, decoded))
    return found


def transform_of(made):
    (t, r) = (made.translation, made.rotation)
    return Transform((t.x, t.y, t.z), (r.x, r.y, r.z, r.w), made.parent_frame_id, made.child_frame_id)


def assert_same(one, other):
    np.testing.assert_array_equal(one.rows, other.rows)
    np.testing.assert_array_equal(one.scan_orientations, other.scan_orientations)
    assert (one.scan_sensors, one.local_frame, list(one.mounts)) == (
        other.scan_sensors,
        other.local_frame,
        list(other.mounts),
    )
    for (here, corners), (there, others) in zip(one.outlines, other.outlines, strict=True):
        assert here == there and np.array_equal(corners, others)
    for grid, same in zip(one.local_grids, other.local_grids, strict=True):
        assert (grid.time, grid.extent) == (same.time, same.extent) and np.array_equal(grid.cells, same.cells)
    for name, row in one.mounts.items():
        np.testing.assert_array_equal(row, other.mounts[name])


def test_reports_are_read_back_as_they_were_saved_and_are_empty_in_older_recordings(reporting, tmp_path):
    recording = reporting.finish()
    recording.save(tmp_path / "run.npz")

    assert_same(Recording.load(tmp_path / "run.npz").reports, recording.reports)
    with np.load(tmp_path / "run.npz") as file:
        words = {key: value for key, value in json.loads(str(file["words"])).items() if key != "reports"}
        kept = {name: file[name] for name in file.files if not name.startswith(("report", "outline", "local", "mount"))}
    np.savez(tmp_path / "old.npz", **kept | {"words": np.array(json.dumps(words))})
    old = Recording.load(tmp_path / "old.npz")
    assert len(old.reports.rows) == 0 and old.reports.mounts == {} and len(old.poses) == 6
    write_mcap(tmp_path / "old.mcap", old)
    assert {"/odom", "/estimated_pose", "/footprint", "/local_map"}.isdisjoint(topics_of(tmp_path / "old.mcap"))


def test_parts_of_reports_are_those_of_the_whole(reporting):
    whole = reporting.finish().reports
    first = reporting.take().reports
    reporting.sample(0.6, true_pose(6), Twist(), Twist())
    reporting.reports.outline(0.6, np.zeros((4, 2)))
    second = reporting.take().reports

    assert_same(first, whole)
    assert (len(second.rows), len(second.outlines), len(second.local_grids), second.scan_sensors) == (1, 1, 0, [])
    assert_same(joined_reports([first, second]), reporting.finish().reports)


def test_frames_lead_from_the_map_to_where_the_robot_is_and_to_where_it_believes_to_be(reporting, tmp_path):
    write_mcap(tmp_path / "run.mcap", reporting.finish())

    frames = topics_of(tmp_path / "run.mcap")["/tf"]
    for step, (_, made) in enumerate(frames):
        known = {one.child_frame_id: transform_of(one) for one in made.transforms}
        believed = known["base_link_estimated"]
        if step >= 2:
            assert believed.parent == "odom"
            np.testing.assert_allclose(believed.translation, odometry(step).position)
            believed = known["odom"] @ believed
        else:
            assert "odom" not in known
        np.testing.assert_allclose(believed.translation, estimate(step).position, atol=1e-12)
        np.testing.assert_allclose(believed.rotation, estimate(step).orientation, atol=1e-12)
        assert (known["base_link"].parent, known["base_link"].translation) == ("map", true_pose(step).position)


def test_scans_are_in_the_frame_of_their_sensor_and_lie_where_they_were_seen(reporting, tmp_path):
    write_mcap(tmp_path / "run.mcap", reporting.finish())

    found = topics_of(tmp_path / "run.mcap")
    (time, cloud), (_, unknown) = found["/scan"]
    made = next(frames for stamp, frames in found["/tf"] if stamp == time)
    known = {one.child_frame_id: transform_of(one) for one in made.transforms}
    points = np.frombuffer(cloud.data, "<f4").reshape(-1, 3)
    assert (cloud.frame_id, unknown.frame_id) == ("lidar", "map")
    np.testing.assert_allclose((known["base_link"] @ known["lidar"]).apply(points), HITS, atol=1e-6)
    np.testing.assert_allclose(np.frombuffer(unknown.data, "<f4").reshape(-1, 3), HITS, atol=1e-6)


def test_goals_outline_local_map_and_odometry_are_as_reported(reporting, tmp_path):
    write_mcap(tmp_path / "run.mcap", reporting.finish())

    found = topics_of(tmp_path / "run.mcap")
    ((_, goals),) = found["/goals"]
    assert [(pose.position.x, pose.position.y) for pose in goals.poses] == [(9.0, 1.0)]
    assert [time for time, _ in found["/footprint"]] == [0.0, 0.3], "once for each change"
    assert {one.entities[0].frame_id for _, one in found["/footprint"]} == {"base_link_estimated"}
    assert found["/footprint"][1][1].entities[0].lines[0].points[0].x == 0.5
    ((time, grid),) = found["/local_map"]
    assert (time, grid.frame_id, grid.column_count, grid.cell_size.x) == (0.2, "odom", 2, 1.0)
    first, last = found["/odom"][0][1], found["/odom"][-1][1]
    assert (first["frame_id"], last["frame_id"]) == ("map", "odom"), "the estimate where there is no odometry"
    assert first["pose"]["position"]["x"] == 0.4 and last["pose"]["position"]["y"] == 0.05
    assert last["twist"]["linear"]["x"] == 0.9
    assert found["/estimated_pose"][3][1].pose.position.x == pytest.approx(0.7)


SCENARIO = """
name: drifting
proves: What a robot believes is not what is.
backend: costmap
navigation: {costmap: nav.yaml}
world: {type: generated, size: [6.0, 5.0], spacing: 0.5}
physics: kinematic
robot: turtlebot
odometry: wheels
sensors: [{name: eye, type: planar}]
localization: {position_noise: 0.05}
start: {x: 2.0, y: 2.5}
goals: [{x: 3.5, y: 2.5}]
time_limit: 6.0
"""
NAVIGATION = """
backend: costmap
planners: [{name: dijkstra, type: dijkstra}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
global_costmap: {robot_radius: 0.2, layers: [{name: walls, type: static}], walls: {map_file: $WORLD_MAP}}
local_costmap: {frame_id: odom, rolling_window: true, width: 2.0, height: 2.0, robot_radius: 0.2}
"""


@pytest.fixture
def drifting(tmp_path):
    (tmp_path / "drifting.yaml").write_text(SCENARIO)
    (tmp_path / "nav.yaml").write_text(NAVIGATION)
    return load_scenario(tmp_path / "drifting.yaml")


def test_a_run_records_what_its_robot_believes(drifting, tmp_path):
    run_scenario(drifting, RunOptions(tmp_path / "run"))
    recording = Recording.load(tmp_path / "run" / "recording.npz")

    reports, moved = recording.reports, recording.times > 0.5
    errors = np.linalg.norm(reports.estimates[moved, :2] - recording.poses[moved, :2], axis=1)
    assert 0.01 < errors.mean() < 0.15, "noise of 5 cm"
    assert np.isfinite(reports.odometry[moved]).all() and np.isfinite(reports.velocities[moved]).all()
    assert reports.local_frame == "odom" and len(reports.local_grids) >= 2
    assert reports.mounts.keys() == {"eye"} and set(reports.scan_sensors) == {"eye"}
    assert np.linalg.norm(reports.outlines[0][1][:, :2], axis=1).max() == pytest.approx(0.2, abs=0.05)


def test_a_map_that_cannot_be_looked_at_does_not_stop_the_physics(drifting, monkeypatch):
    with Session(drifting) as session:
        server = session.navigator.server

        def damaged(name=""):
            raise RuntimeError("a damaged tile")

        monkeypatch.setattr(server, "map_view", damaged)
        session.clock.sleep(2.5)
        faults = [event.data["message"] for event in session.memory.events if event.source == "local_map"]
    assert session.loop.failure is None
    assert "a damaged tile" in faults


def test_the_same_recording_gives_the_same_bytes(reporting, tmp_path):
    for name in ("one", "two"):
        write_mcap(tmp_path / f"{name}.mcap", replace(reporting.finish()))
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()
