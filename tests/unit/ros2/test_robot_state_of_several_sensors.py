"""What a simulated robot publishes of its sensors: where they sit at once and for good, and topics of their own."""

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.robot_messages import TF, TF_STATIC, RobotMessages, state_topics
from terrain.commands.robot_on_ros import require_one_robot, sensor_options
from terrain.scenarios.robots import Sensor
from terrain.scenarios.scenario import load_scenario, scenario_file

NAMES = ("front", "rear")


@pytest.fixture
def session():
    with ScriptedSession() as made:
        made.clock.sleep(0.5)
        yield made


def mount(name):
    return Transform((0.2, 0.0, 0.3), parent="base_link", child=name, static=True)


def scan(session, name):
    ends = [(2.0, 0.0, 0.3), (0.0, 2.0, 0.3)]
    return RangeScan.of_rays(name, (0.2, 0.0, 0.3), ends, [True, True], session.clock.now(), "base_link")


def children(message):
    return {one["child_frame_id"] for one in message["transforms"]}


@pytest.mark.parametrize("names", [NAMES[:1], NAMES])
def test_mounts_are_static_and_known_before_the_first_scan(session, names):
    session.sensor_mounts = {name: mount(name) for name in names}
    messages = dict(RobotMessages(session, MessageContext("map", 0.0), lambda topic: True).changes())
    assert set(names) <= children(messages[TF_STATIC])
    assert not set(names) & children(messages[TF])


def test_each_of_several_sensors_has_its_own_topics(session):
    session.sensor_mounts = {name: mount(name) for name in NAMES}
    state = RobotMessages(session, MessageContext("map", 0.0), lambda topic: True)
    for name in NAMES:
        session.server.take_scan(scan(session, name))
    sent = {topic: message["header"]["frame_id"] for topic, message in state.changes() if "/scan" in topic}
    assert sent == {"/front/scan": "front", "/rear/scan": "rear"}
    assert sent.keys() <= state_topics(NAMES).keys() and "/scan" not in state_topics(NAMES)


def test_the_only_sensor_has_the_usual_topics_also_where_nobody_said_where_it_sits(session):
    state = RobotMessages(session, MessageContext("map", 0.0), lambda topic: True)
    session.server.take_scan(scan(session, "lidar"))
    messages = dict(state.changes())
    assert {"/scan", "/points"} <= messages.keys() and "lidar" in children(messages[TF_STATIC])
    assert {"/scan", "/points"} <= state_topics(["lidar"]).keys()


def test_the_printed_options_name_each_topic_once():
    front, rear = (Sensor(name=name, type=kind) for name, kind in zip(NAMES, ("planar", "depth"), strict=True))
    assert sensor_options([front]) == ["--sensor scan:LaserScan=front"]
    own = ["--sensor front/scan:LaserScan=front", "--sensor rear/points:PointCloud2=rear"]
    assert sensor_options([front, rear]) == own


def test_several_robots_are_refused_by_the_scenarios_key():
    with pytest.raises(ConfigError, match=r"two_couriers.yaml:\d+.*robots: expected one robot, with --ros2"):
        require_one_robot(load_scenario("two_couriers"), scenario_file("two_couriers"))
