"""Bags that cannot be replayed end with one clear error."""

import pytest

from mbf_abstract.commands.coordinates import Place
from mbf_ros.bags import observation
from mbf_ros.bags.reading import BagError, open_bag
from mbf_ros.bags.recorded_time import RecordedTime
from mbf_ros.bags.topics import BagTopics
from tests.unit.bags.conftest import MESH, drive, make_bag, message, odometry, scan, static, tf


def refusal(path):
    with pytest.raises(BagError) as raised, open_bag(path) as bag:
        list(bag.messages())
    return str(raised.value)


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_bag_that_is_cut_short_is_named(tmp_path, kind):
    path = make_bag(tmp_path, drive(), kind)
    file = path if path.is_file() else next(one for one in path.iterdir() if one.suffix in (".mcap", ".db3"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert str(path) in refusal(path)


@pytest.mark.parametrize("name", ["robot.bag", "robot.mcap", "robot.db3", "robot.txt"])
def test_a_file_that_is_no_bag_is_named(tmp_path, name):
    (tmp_path / name).write_text("backend: costmap\n" * 100)
    assert str(tmp_path / name) in refusal(tmp_path / name)


def test_metadata_that_are_no_yaml_are_named_in_one_line(tmp_path):
    (tmp_path / "metadata.yaml").write_text("a: [b\n")
    text = refusal(tmp_path)
    assert "metadata.yaml: while parsing a flow sequence" in text and "\n" not in text


def test_what_is_not_there_is_named(tmp_path):
    assert "no such file" in refusal(tmp_path / "nothing.bag")
    assert "metadata.yaml" in refusal(tmp_path)


def test_a_recording_whose_clock_jumps_is_refused_before_it_is_replayed(tmp_path):
    messages = [tf(0.0, 0.0), tf(0.1, 0.0)]
    boot = [one._replace(time=one.time % 10**9) for one in messages]  # the computer's clock was not set yet
    jump = (
        r"drive: a message of 1970-01-01 00:00:00 UTC is followed by one of 2023-11-14 22:13:20 UTC; allowed are 3600 s"
    )
    with pytest.raises(BagError, match=jump), open_bag(make_bag(tmp_path, [*boot, *messages])) as bag:
        RecordedTime(bag, BagTopics(), "map")


def test_a_bag_of_more_than_a_day_is_refused(tmp_path):
    days = r"the bag goes from 2023-11-14 22:13:20 UTC to 2023-11-15 22:43:20 UTC; allowed are 86400 s"
    half_hours = [tf(1800.0 * k, 0.0) for k in range(50)]
    with pytest.raises(BagError, match=days), open_bag(make_bag(tmp_path, half_hours)) as bag:
        RecordedTime(bag, BagTopics(), "map")


def test_a_jump_that_the_metadata_hide_is_refused_in_the_replay(tmp_path, replayed):
    bag = make_bag(tmp_path, [*drive(0.1), tf(8000.0, 0.0)])
    metadata = bag / "metadata.yaml"
    assert "nanoseconds: 8000000000000" in metadata.read_text()
    metadata.write_text(metadata.read_text().replace("nanoseconds: 8000000000000", "nanoseconds: 100000000"))
    with pytest.raises(BagError, match="is followed by one of 2023-11-15 00:26:40 UTC"):
        replayed(bag)


def test_a_bag_whose_files_are_compressed_is_refused_before_it_is_unpacked(tmp_path):
    metadata = make_bag(tmp_path, drive(0.1), "sqlite3") / "metadata.yaml"
    text = metadata.read_text().replace("compression_mode: ''", "compression_mode: FILE")
    assert "FILE" in text
    metadata.write_text(text.replace("compression_format: ''", "compression_format: zstd"))
    assert "drive: files that are compressed as a whole are not read" in refusal(tmp_path / "drive")


def test_a_bag_without_transforms_says_how_to_give_them(replayed):
    with pytest.raises(BagError, match=r"expected transforms.*--odom-tf.*--tf"):
        replayed([odometry(0.0, 0.0), scan(0.0, 0.0)])


def test_of_several_topics_the_candidates_are_listed(replayed):
    messages = [static(), tf(0.0, 0.0), scan(0.0, 0.0, "/front"), scan(0.0, 0.0, "/rear")]
    with pytest.raises(BagError, match=r"'lidar': /front, /rear; choose by --topic lidar=TOPIC"):
        replayed(messages)


def test_a_chosen_topic_is_taken_and_an_empty_one_is_none(tmp_path, replayed):
    messages = [static(), tf(0.0, 0.0), scan(0.0, 0.0, "/front"), scan(0.0, 0.0, "/rear"), tf(0.1, 0.0)]
    bag = make_bag(tmp_path, messages)
    topics = replayed(bag, topics={"lidar": "/rear"}).topics
    assert topics["/rear"].used_as == "lidar" and topics["/front"].used_as == ""
    assert replayed(bag, topics={"lidar": ""}).topics["/rear"].used_as == ""


@pytest.mark.parametrize(
    ("topics", "text"),
    [
        ({"lidar": "/nothing"}, "expected one of the topics /base_scan, got one not in the bag"),
        ({"lidar": "/odom"}, "expected one of the topics /base_scan, got one of type nav_msgs/msg/Odometry"),
        ({"odom": "/tf"}, "expected one of the topics /odom, got one of type tf2_msgs/msg/TFMessage"),
        ({"sonar": "/base_scan"}, "expected one of tf, tf_static, odom, lidar, got 'sonar'"),
    ],
)
def test_a_chosen_topic_that_does_not_fit_is_refused(replayed, topics, text):
    with pytest.raises(BagError, match=text):
        replayed(drive(0.1), topics=topics)


def test_of_a_layer_that_takes_any_source_a_chosen_topic_must_be_there(replayed):
    text = MESH.replace("obstacles: {sources: [lidar]}", "obstacles: {}")
    with pytest.raises(
        BagError, match=r"--topic base_scan=/rear: expected one of the topics .*, got one not in the bag"
    ):
        replayed(drive(0.1), text, topics={"base_scan": "/rear"})


def test_pictures_that_do_not_fit_into_the_memory_are_refused(replayed, monkeypatch):
    monkeypatch.setattr(observation, "MOST_COSTS", 10_000)
    with pytest.raises(ValueError, match="expected at most 4 pictures of a map of 2400 costs, got 11"):
        replayed(drive(1.0))


def test_a_scan_that_means_nothing_is_dropped_and_counted(replayed):
    bad = scan(0.5, 0.25)
    bad.message["angle_min"] = float("nan")
    counted = replayed([*drive(0.5), bad]).topics["/base_scan"]
    assert counted.dropped["invalid message"] == 1
    assert "expected a finite number" in counted.examples["invalid message"]


def test_types_that_nobody_knows_matter_only_where_they_are_used(tmp_path, replayed):
    from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat

    bag = make_bag(tmp_path, [*drive(0.2), message(0.2, "/chatter", "std_msgs/String", {"data": "hello"})])
    with open_bag(bag) as opened:
        strange = next(one for one in opened._reader.connections if one.topic == "/chatter")
        assert opened.types["/chatter"] == "std_msgs/msg/String"
        nothing = MessageDefinition(MessageDefinitionFormat.NONE, "")
        opened._reader.connections[opened._reader.connections.index(strange)] = strange._replace(
            msgtype="my_msgs/msg/Chatter", msgdef=nothing
        )
        with pytest.raises(BagError, match="/chatter: the definition of my_msgs/msg/Chatter cannot be used"):
            opened.require("/chatter")
    assert replayed(bag).topics["/chatter"].used_as == ""


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"goal": Place(1.0, 0.0), "at": 9.0}, "--at: expected at most 0.100 s, where the bag ends, got 9 s"),
        ({"goal": Place(1.0, 0.0), "at": float("nan")}, "--at: expected 0 s or more, got nan"),
        ({"goal": Place(1.0, 0.0), "planner": "typo"}, "--planner: no planner named 'typo'; loaded: straight"),
        ({"every": float("nan")}, "--every: expected 0 s or more, got nan"),
        ({"every": 0.0001}, "expected at most 200 pictures, got 1002"),
        ({"map_name": "attic"}, "--map: expected one of global_costmap, local_costmap"),
        (
            {"odometry_as_transform": True, "topics": {"odom": ""}},
            r"--odom-tf: expected odometry \(nav_msgs/Odometry\), got none",
        ),
    ],
)
def test_options_that_do_not_fit_the_bag_are_refused(replayed, options, text):
    with pytest.raises(ValueError, match=text):
        replayed(drive(0.1), **options)
