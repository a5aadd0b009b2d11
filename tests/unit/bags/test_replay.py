"""A bag goes through our transform buffer and layers at the recorded stamps."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_abstract.commands.coordinates import Place
from mbf_abstract.events import EventKind
from mbf_abstract.geometry.transform import Transform
from mbf_ros.bags.reading import open_bag
from mbf_ros.bags.recorded_time import RecordedTime
from mbf_ros.bags.report import missing_notes, report_of, result_line, statistics_of
from mbf_ros.bags.topics import choose_topics
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.sensors import point_cloud
from tests.unit.bags.conftest import (
    COSTMAP,
    MESH,
    SPEED,
    WALL,
    drive,
    header,
    last_grid,
    make_bag,
    message,
    odometry,
    scan,
    static,
    tf,
    transform,
)

GOAL = Place(2.0, 0.0, None, 0.0)


def marked(grid):
    """Middles (x, y) of the forbidden cells of the costmap of ``COSTMAP``."""
    rows, columns = np.nonzero(grid)
    return np.column_stack([-0.95 + 0.1 * columns, -1.95 + 0.1 * rows])


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap", ".db3", ".mcap"])
def test_scans_of_every_kind_of_bag_mark_the_wall_where_it_stood(tmp_path, replayed, kind):
    result = replayed(make_bag(tmp_path, drive(), kind))
    walls = marked(last_grid(result))
    assert len(walls) and (np.abs(walls[:, 0] - WALL) <= 0.1).all() and np.ptp(walls[:, 1]) > 3.0
    assert result.topics["/base_scan"].used_as == "lidar" and not result.topics["/base_scan"].dropped
    assert result.log.poses[-1, 0] == pytest.approx(2.0 * SPEED, abs=0.06)
    assert result.log.twists[-1, 0] == SPEED and result.duration == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("scans", "topics", "missing"), [(True, {}, []), (False, {}, ["lidar"]), (False, {"lidar": ""}, [])]
)
def test_a_source_without_a_topic_is_noted_unless_it_is_left_out(replayed, scans, topics, missing):
    result = replayed([one for one in drive(0.5) if scans or one.topic != "/base_scan"], topics=topics)

    notes = [f"The bag has no topic for the source {name!r}: nothing of it is in the maps." for name in missing]
    assert missing_notes(result) == notes
    assert statistics_of(result)["sources_without_topic"] == missing
    assert [text for text in report_of(result).notes if "source" in text] == notes


def test_a_scan_is_placed_by_the_transform_of_its_own_stamp(replayed):
    late = [scan(k / 10, SPEED * k / 10, delay=0.5) for k in range(0, 21)]
    messages = sorted([static(), *(tf(k / 20, SPEED * k / 20) for k in range(51)), *late], key=lambda one: one.time)
    walls = marked(last_grid(replayed(messages)))
    assert (np.abs(walls[:, 0] - WALL) <= 0.1).all()


def test_sensed_obstacles_are_on_a_mesh_as_well(replayed):
    result = replayed(drive(), MESH)
    view = result.log.maps[-1][1]
    near = np.abs(view.vertices[:, 0] - WALL) <= 0.26
    assert np.isinf(view.costs).any() and not np.isinf(view.costs[~near]).any()
    assert not np.isinf(result.log.maps[0][1].costs[view.vertices[:, 0] < 2.0]).any()


def test_a_plan_is_made_from_where_the_robot_was_at_the_asked_time(replayed):
    early = replayed(drive(), goal=GOAL, at=0.63)
    assert early.plan["outcome_name"] == "SUCCESS" and early.plan["at_s"] == pytest.approx(0.63)
    assert early.plan["start"][0] == pytest.approx(SPEED * 0.60, abs=1e-6)
    assert early.log.paths[0][1][-1][:2].tolist() == [2.0, 0.0]
    assert len(early.log.times) == 20  # the replay went on; at 0 s there was no pose yet


def test_goal_and_plan_are_shown_where_they_were_when_the_plan_was_made(replayed):
    text = COSTMAP.replace("{rolling_window", "{frame_id: odom, rolling_window")
    moved = message(1.5, "/tf", "tf2_msgs/TFMessage", {"transforms": [transform(1.5, "map", "odom", 1.0)]})
    log = replayed([*drive(1.0), moved], text, goal=GOAL, at=0.5, map_name="local_costmap").log
    assert log.frame_id == "odom" and log.goals[0].position[0] == 2.0
    assert log.paths[0][1][-1][:2].tolist() == [2.0, 0.0]


def test_events_are_in_the_time_of_the_bag(replayed):
    events = replayed(drive(0.5), goal=GOAL, at=0.13).log.events
    accepted = [event.time for event in events if event.kind is EventKind.GOAL_ACCEPTED]
    assert accepted == [pytest.approx(0.13)]


def test_a_plan_that_fails_is_a_result(replayed):
    result = replayed(drive(), goal=Place(4.0, 0.0))
    assert result.plan["outcome_name"] == "NO_PATH_FOUND" and result.plan["poses"] == []
    assert result.plan["at_s"] == pytest.approx(2.0, abs=0.01)


def test_messages_without_a_transform_are_counted_with_the_reason(replayed):
    messages = [scan(0.0, 0.0), static(), tf(0.05, 0.0), tf(0.1, 0.0), scan(0.1, 0.0), scan(0.2, 0.0), scan(0.6, 0.0)]
    messages += [tf(0.7, 0.0), scan(0.0, 0.0, delay=0.7), scan(0.7, 0.0, frame="camera"), scan(0.7, 0.0)]
    counted = replayed(messages).topics["/base_scan"]
    assert counted.dropped == {
        "unknown frame": 2,
        "newer than the transforms": 1,
        "older than the transforms": 1,
    }
    assert counted.placed_by_newest == 1  # 0.1 s after the newest transform, and the tolerance is 0.3 s
    assert "camera" not in counted.examples["unknown frame"] and "'laser'" in counted.examples["unknown frame"]
    assert counted.recorded.count == 7 and counted.delays.largest == pytest.approx(0.7)


def test_scans_that_one_of_two_maps_cannot_place_are_counted_for_that_map(replayed):
    text = COSTMAP.replace("{rolling_window", "{frame_id: odom, rolling_window")
    moves = [
        message(k / 10, "/tf", "tf2_msgs/TFMessage", {"transforms": [transform(k / 10, "odom", "base_link", 0.0)]})
        for k in range(3)
    ]
    result = replayed([static(), *moves, scan(0.1, 0.0, delay=0.1), scan(0.2, 0.0), scan(0.3, 0.0)], text)
    counted = result.topics["/base_scan"]
    assert not counted.dropped and counted.dropped_by_map == {"global_costmap: unknown frame": 3}
    assert counted.placed_by_newest == 1  # on the local map
    assert "0 not used, 3 not used by one of the maps" in result_line(result)
    dropped = statistics_of(result)["topics"]["/base_scan"]["dropped_by_map"]["global_costmap: unknown frame"]
    assert dropped["count"] == 3 and "'map' is an unknown frame" in dropped["first"]
    tables = {table.title: table.rows for table in report_of(result).tables}
    assert [row[1:3] for row in tables["Messages that were not used"]] == [("global_costmap: unknown frame", 3)]


def test_a_scan_is_shown_if_the_tolerance_of_its_map_lets_it_in(replayed):
    messages = [static(), tf(0.0, 0.0), tf(0.1, 0.0), scan(0.6, 0.0)]
    tolerant = COSTMAP.replace("update_frequency: 5.0", "update_frequency: 5.0, transform_tolerance: 1.0")
    assert len(replayed(messages, tolerant).log.scans) == 1


def test_gaps_and_delays_of_transforms_are_measured(replayed):
    frame = replayed([static(), tf(0.0, 0.0), tf(0.1, 0.0, delay=0.05), tf(0.9, 0.0), scan(0.9, 0.0)]).frames
    assert frame["odom"].stamps.largest_gap == pytest.approx(0.8) and frame["odom"].stamps.gap_at == pytest.approx(0.1)
    assert frame["odom"].delays.largest == pytest.approx(0.05) and frame["laser"].static


def test_transforms_that_the_bag_lacks_are_given_or_taken_from_odometry(replayed):
    messages = [one for k in range(21) for one in (odometry(k / 10, SPEED * k / 10), scan(k / 10, SPEED * k / 10))]
    given = (
        Transform((0.0, 0.0, 0.0), parent="map", child="odom", static=True),
        Transform((0.1, 0.0, 0.0), parent="base_link", child="laser", static=True),
    )
    walls = marked(last_grid(replayed(messages, transforms=given, odometry_as_transform=True)))
    assert len(walls) and (np.abs(walls[:, 0] - WALL) <= 0.1).all()


def test_stamps_of_a_simulator_are_moved_onto_the_clock_of_the_recording(replayed):
    moved = [one._replace(time=one.time + 3_000_000_000_000) for one in drive()]
    result = replayed(moved)
    assert result.stamp_shift == pytest.approx(3000.0) and not result.topics["/base_scan"].dropped
    assert last_grid(result).any()


def test_a_single_stamp_that_means_nothing_does_not_move_the_others(tmp_path):
    moved = [one._replace(time=one.time + 3_000_000_000_000) for one in [*drive(0.5), scan(9000.0, 0.0, delay=-8999.9)]]
    with open_bag(make_bag(tmp_path, moved)) as bag:
        time = RecordedTime(bag, choose_topics(bag.types, {}, ["lidar"], False), "map")
    assert time.stamp_shift == pytest.approx(3000.0)


def test_the_command_writes_the_same_bytes_twice(tmp_path, configuration):
    bag, file = make_bag(tmp_path, drive(1.0)), configuration()
    for name in ("first", "second"):
        arguments = ["bag", "replay", bag, file, "--goal", 2, 0, "--at", 0.5, "--every", 0.9, "--out", tmp_path / name]
        result = CliRunner().invoke(make_app(), [str(one) for one in arguments])
        assert result.exit_code == 0, result.output
        assert "plan at 0.5 s: SUCCESS" in result.output
        assert len(re.findall(r"\d\.\d\d m\b", result.output)) == 1, "the length of the plan is said once"
    written = sorted(file.name for file in (tmp_path / "first").iterdir())
    assert written == [
        *("map_00000.9s.png", "map_00001.0s.png", "plan.json", "report.html", "run.mcap"),
        "statistics.json",
    ]
    for name in written:
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes(), name
    counted = json.loads((tmp_path / "first" / "statistics.json").read_text())
    assert counted["topics"]["/base_scan"]["count"] == 11 and counted["samples"] == 10
    assert "base_scan" in (tmp_path / "first" / "report.html").read_text()


def test_a_layer_that_takes_any_source_gets_every_sensor(replayed):
    text = MESH.replace("obstacles: {sources: [lidar]}", "obstacles: {}")
    messages = [*drive(0.5), scan(0.5, 0.25, topic="/front")]
    result = replayed(messages, text)
    sensors = {topic for topic, one in result.topics.items() if one.type == "sensor_msgs/msg/LaserScan"}
    assert {topic: result.topics[topic].used_as for topic in sensors} == {"/base_scan": "base_scan", "/front": "front"}


def test_clouds_and_single_ranges_are_taken_as_well(replayed):
    cloud = point_cloud(np.array([[2.0, 1.0, 0.0]]), "laser", 0.0, MessageContext())
    cloud["header"] = header("laser", 0.2)
    single = {"header": header("laser", 0.2), "field_of_view": 0.1, "max_range": 4.0, "range": 1.5}
    messages = [static(), tf(0.0, 0.0), tf(0.2, 0.0), message(0.2, "/points", "sensor_msgs/PointCloud2", cloud)]
    messages.append(message(0.2, "/sonar", "sensor_msgs/Range", single))
    both = COSTMAP.replace("{lidar: {obstacle_max_range: 8.0, raytrace_max_range: 8.0}}", "{points: {}, range: {}}")
    result = replayed(messages, both.replace("{lidar: {}}", "{points: {}}"))
    assert not any(one.dropped for one in result.topics.values())
    walls = marked(last_grid(result))
    for place in ([2.1, 1.0], [1.6, 0.0]):
        assert (np.abs(walls - place) < 0.11).all(axis=1).any()


def test_the_local_map_can_be_shown_in_its_place(replayed):
    result = replayed(drive(), COSTMAP, map_name="local_costmap")
    assert result.log.maps[-1][1].extent[0] == pytest.approx(0.0, abs=0.15)
