"""One list of what comes from a robot and its users, for nodes of ROS 2 and for rosbridge."""

import pytest

from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import MessageError, completed
from mbf_ros.robot_inputs import GOALS, ODOM, TF, TF_STATIC, Quality, RobotInputs

SCAN = completed(
    "sensor_msgs/LaserScan",
    {"header": {"frame_id": "laser"}, "angle_min": 0.0, "angle_increment": 0.1, "range_max": 5.0, "ranges": [1.0]},
)
AT_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}


def inputs(hear=lambda topic: None):
    return RobotInputs(lambda: 3.0, lambda: MessageContext("map", 1000.0), hear)


@pytest.mark.parametrize("uses_odometry", [True, False])
def test_transforms_always_come_and_odometry_where_it_is_used(uses_odometry):
    found = {one.topic: one for one in inputs().of_robot(None, TransformBuffer(), uses_odometry)}
    assert sorted(found) == sorted([TF, TF_STATIC, *([ODOM] if uses_odometry else [])])
    assert (found[TF].quality, found[TF_STATIC].quality) == (Quality.MANY, Quality.LATCHED)


def test_odometry_on_a_topic_of_another_name_is_heard_under_that_name():
    class Robot:
        def take_odometry(self, odometry):
            self.odometry = odometry

    heard, robot = [], Robot()
    odometry, *_ = inputs(heard.append).of_robot(robot, TransformBuffer(), True, "wheels/odom")
    body = {"header": {"frame_id": "odom"}, "twist": {"twist": {"linear": {"x": 0.2}}}}
    odometry.take(completed(odometry.type, body))
    assert (odometry.topic, heard, robot.odometry.velocity.vx) == ("wheels/odom", ["wheels/odom"], 0.2)


def test_a_static_transform_holds_at_all_times_and_another_one_from_its_arrival_on():
    transforms = TransformBuffer()
    tf, static = inputs().of_robot(None, transforms, False)
    for one, child in ((tf, "base_link"), (static, "laser")):
        body = {"header": {"frame_id": "map"}, "child_frame_id": child, "transform": {"rotation": {"w": 1.0}}}
        one.take(completed(one.type, {"transforms": [body]}))
    assert {one.child: (one.static, one.stamp) for one in transforms.newest()}["laser"][0]
    assert {one.child: (one.static, one.stamp) for one in transforms.newest()}["base_link"] == (False, 3.0)


@pytest.mark.parametrize("error", [ValueError("no room"), TransformError("no frame")])
def test_a_message_of_any_input_that_is_refused_is_dropped_with_the_reason(error):
    def refuse(*message):
        raise error

    class Refusing:
        take_odometry = set = refuse

    found = [
        *inputs().of_robot(Refusing(), Refusing(), True),
        *inputs().of_sensors(refuse, {"scan": ("sensor_msgs/LaserScan", "lidar")}),
        *inputs().of_users(refuse),
    ]
    transform = {"header": {"frame_id": "map"}, "child_frame_id": "laser", "transform": {"rotation": {"w": 1.0}}}
    bodies = {"tf2_msgs/TFMessage": {"transforms": [transform]}, "sensor_msgs/LaserScan": SCAN}
    bodies["geometry_msgs/PoseStamped"] = {"pose": {"position": AT_ZERO, "orientation": {"w": 1.0}}}
    bodies["nav_msgs/Odometry"] = {"twist": {"twist": {"linear": AT_ZERO, "angular": AT_ZERO}}}
    assert len(found) == 6
    for one in found:
        with pytest.raises(MessageError, match=str(error)):
            one.take(completed(one.type, bodies[one.type]))


@pytest.mark.parametrize("error", [ValueError("no room"), TransformError("no frame")])
def test_a_scan_that_a_map_refuses_is_refused_and_does_not_count_as_heard(error):
    def refuse(scan):
        raise error

    heard = []
    (one,) = inputs(heard.append).of_sensors(refuse, {"front/scan": ("sensor_msgs/LaserScan", "lidar")})
    with pytest.raises(MessageError, match=str(error)):
        one.take(SCAN)
    assert heard == []


def test_a_scan_goes_to_its_source_and_its_topic_is_heard():
    heard, scans = [], []
    chosen = {"front/scan": ("sensor_msgs/LaserScan", "lidar")}
    (one,) = inputs(heard.append).of_sensors(scans.append, chosen)
    one.take(SCAN)
    assert heard == ["front/scan"] and [(scan.source, scan.stamp) for scan in scans] == [("lidar", 3.0)]


def test_a_goal_is_sent_unless_there_is_a_refusal():
    class Handle:
        done = False

    sent, reasons = [], [""]
    takers = list(inputs().of_users(lambda goal: sent.append(goal) or Handle(), lambda: reasons[0]))
    goal = completed(
        "geometry_msgs/PoseStamped", {"pose": {"position": {"x": 2.0, "y": 0.0}, "orientation": {"w": 1.0}}}
    )
    for one in takers:
        one.take(goal)
    assert tuple(one.topic for one in takers) == GOALS
    assert [(one.target_pose.x, one.target_pose.frame_id, one.target_pose.stamp) for one in sent] == [
        (2.0, "map", 0.0)
    ] * 2
    reasons[0] = "the node is shutting down"
    with pytest.raises(MessageError, match="the node is shutting down"):
        takers[0].take(goal)
    assert len(sent) == 2
