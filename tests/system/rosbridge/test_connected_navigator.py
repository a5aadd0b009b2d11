"""A navigator that is a client of its robot's rosbridge: others reach it through that server."""

import json

import pytest

from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.geometry import Pose
from mbf_ros.rosbridge_robot.options import TimeSource

WITHIN = 20.0
FAR = (30.0, 5.0)
SCAN = {"angle_min": 0.0, "angle_increment": 0.1, "range_max": 5.0, "ranges": [2.0]}


def pose(x, y, w=1.0):
    return {"header": {"frame_id": "/map"}, "pose": {"position": {"x": x, "y": y}, "orientation": {"w": w}}}


class Sender:
    """A client of the robot's server that sends goals."""

    def __init__(self, socket):
        self.socket, self.frames, self._goals = socket, [], 0

    def say(self, **operation):
        self.socket.send(json.dumps(operation))

    def send(self, action, **args):
        self._goals += 1
        self.say(op="send_action_goal", id=f"g{self._goals}", action=action, args=args, feedback=True)
        return f"g{self._goals}"

    def wait_until_offered(self):
        """Wait until the navigator offers its actions, a moment after it is ready."""
        while not self.wait("action_result", id=self.send("/smooth_path", path={}))["result"]:
            pass

    def wait(self, op, **fields):
        """Return the next frame of a kind, with these fields; those before are kept in ``frames``."""
        while True:
            frame = json.loads(self.socket.recv(timeout=WITHIN))
            self.frames.append(frame)
            if frame["op"] == op and all(frame.get(name) == value for name, value in fields.items()):
                return frame


@pytest.fixture
def driven(peers, raw):
    """A robot, its navigator, and a client that sends goals, once the goals are offered."""

    def make(backend="costmap", **options):
        made = peers(backend, **options)
        sender = Sender(raw(made.server.port))
        sender.wait_until_offered()
        return made, sender

    return make


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_goal_of_another_client_drives_the_robot_and_its_plan_is_shown(driven, backend):
    made, sender = driven(backend)
    sender.say(op="subscribe", topic="/plan", type="nav_msgs/Path")
    goal = sender.send("/navigate_to_pose", pose=pose(2.0, 5.5))
    result = sender.wait("action_result", id=goal)
    assert (result["status"], result["result"], result["values"]["error_code"]) == (4, True, 0)
    assert made.robot.pose.distance_to(Pose.planar(2.0, 5.5)) < 0.3
    assert not made.moves and max(made.commands()) > 0.1
    feedback = [one["values"]["distance_remaining"] for one in sender.frames if one["op"] == "action_feedback"]
    assert feedback and feedback[-1] < feedback[0]
    plans = [one for one in sender.frames if one["op"] == "publish" and one["topic"] == "/plan"]
    assert plans or sender.wait("publish", topic="/plan")


def test_nothing_is_published_before_it_is_advertised(driven):
    made, _ = driven()
    assert not [text for text in made.reports.values if "was not advertised" in text]


def test_goals_are_canceled_taken_over_and_refused_as_by_a_navigator_of_our_own(driven):
    made, sender = driven()
    first = sender.send("/move_base_flex/move_base", target_pose=pose(*FAR))
    sender.wait("action_feedback", id=first)
    second = sender.send("/move_base_flex/move_base", target_pose=pose(*FAR))
    taken = sender.wait("action_result", id=first)
    assert (taken["status"], taken["values"]["outcome"]) == (6, 11)  # ROS 2 cancels only what its client cancels
    sender.wait("action_feedback", id=second)
    sender.say(op="cancel_action_goal", id=second, action="/move_base_flex/move_base")
    canceled = sender.wait("action_result", id=second)
    assert (canceled["status"], canceled["values"]["outcome"]) == (5, 11)
    made.wait_until(lambda: not made.moves)
    refused = sender.wait("action_result", id=sender.send("/move_base_flex/move_base", target_pose=pose(1.0, 1.0, w=0)))
    assert refused["status"] == 6 and refused["values"]["outcome"] and "quaternion" in refused["values"]["message"]
    assert refused["values"]["dist_to_goal"] == 1e38  # servers on robots refuse null
    asked = sender.send("/navigate_to_pose", pose=pose(2.0, 2.0), behavior_tree="mine.xml")
    unsupported = sender.wait("action_result", id=asked)["values"]
    assert unsupported["error_code"] and "behavior_tree 'mine.xml' is not supported" in unsupported["error_msg"]


def test_a_pose_on_a_goal_topic_is_driven_to_on_the_time_of_the_odometry(driven):
    made, sender = driven(time=TimeSource.ODOM)
    sender.say(op="advertise", topic="/goal_pose", type="geometry_msgs/PoseStamped")
    sender.say(op="publish", topic="/goal_pose", msg=pose(2.0, 5.0))
    made.wait_until(lambda: made.robot.pose.x > 1.7 and not made.moves)


def test_while_both_connections_are_cut_the_robot_stands_and_afterwards_the_next_goal_works(driven):
    made, sender = driven()
    goal = sender.send("/move_base_flex/move_base", target_pose=pose(*FAR))
    made.wait_until(lambda: made.moves)
    made.wire.cut()
    made.wait_until(lambda: not made.moves)  # by its own command_timeout: no command reaches it any more
    assert "has disconnected" in sender.wait("action_result", id=goal)["values"]
    assert made.reports.wait_for(lambda text: text.startswith("commands: the connection was lost"))
    assert made.reports.wait_for(lambda text: text.startswith("data: the connection was lost"))
    action = made.navigator.session.navigator.server.move_base
    made.wait_until(lambda: not action.unfinished)  # nobody could cancel it any more
    before = len(made.commands())
    made.wire.mend()
    assert made.reports.wait_for(lambda text: text == "commands: connected again")
    assert made.reports.wait_for(lambda text: text == "data: connected again")
    made.wait_until(lambda: not made.navigator.problem())
    assert set(made.commands()[before:]) <= {0.0}  # nothing that was meant for before
    sender.wait_until_offered()
    again = sender.send("/move_base_flex/move_base", target_pose=pose(made.robot.pose.x + 1.0, 5.0))
    assert sender.wait("action_result", id=again)["status"] == 4


def test_when_only_commands_are_cut_zero_comes_first_on_the_next_connection_and_the_goal_goes_on(driven):
    made, sender = driven(driver_timeout=10.0)
    goal = sender.send("/move_base_flex/move_base", target_pose=pose(*FAR))
    made.wait_until(lambda: made.moves)
    before = len(made.commands())
    made.wire.cut_once(slice(1, 2))
    made.wait_until(lambda: 0.0 in made.commands()[before:])
    stopped = before + made.commands()[before:].index(0.0)
    last, zero = (time for time, _ in tuple(made.robot.commands)[stopped - 1 : stopped + 1])
    assert zero - last < 10.0  # else it has stopped by itself
    assert made.reports.wait_for(lambda text: text == "commands: connected again")
    made.wait_until(lambda: made.moves)
    sender.say(op="cancel_action_goal", id=goal, action="/move_base_flex/move_base")
    assert sender.wait("action_result", id=goal)["status"] == 5


@pytest.mark.parametrize("silent", ["publishes_odometry", "publishes_pose"])
def test_a_robot_of_which_nothing_is_heard_is_stopped_and_driven_on_when_it_is_heard_again(driven, silent):
    made, sender = driven(max_silence=1.0)
    sender.send("/move_base_flex/move_base", target_pose=pose(*FAR))
    made.wait_until(lambda: made.moves)
    setattr(made.robot, silent, False)
    made.wait_until(lambda: not made.moves and made.navigator.problem())
    setattr(made.robot, silent, True)
    made.wait_until(lambda: made.moves)


def test_a_sensor_that_feeds_no_layer_cannot_stop_the_robot(driven):
    made, sender = driven(sensors={"/laser": ("sensor_msgs/LaserScan", "scan")}, max_silence=1.0)
    sender.say(op="advertise", topic="/laser", type="sensor_msgs/LaserScan")
    sender.say(op="publish", topic="/laser", msg={**SCAN, "header": {"frame_id": "base_link"}})
    goal = sender.send("/move_base_flex/move_base", target_pose=pose(2.5, 5.0))
    assert sender.wait("action_result", id=goal)["status"] == 4  # later than the silence of the scan allows
    assert made.navigator.problem() == ""


def test_a_report_that_raises_is_an_event_and_connections_are_opened_again(driven):
    made, _ = driven()
    seen = MemorySink()
    made.navigator.session.events.add_sink(seen)
    made.report_raises = BrokenPipeError("nobody reads")
    made.wire.cut_once(slice(None))
    made.wait_until(lambda: made.navigator.problem())
    made.wait_until(lambda: not made.navigator.problem())
    assert "the report raised BrokenPipeError: nobody reads" in {one.data.get("message") for one in seen.events}


def test_zero_is_the_last_command_when_the_navigator_ends_and_its_goal_ends_with_a_result(driven):
    made, sender = driven()
    goal = sender.send("/move_base_flex/move_base", target_pose=pose(*FAR))
    made.wait_until(lambda: made.moves)
    made.navigator.close()
    assert made.commands()[-1] == 0.0
    result = sender.wait("action_result", id=goal)
    assert result["result"] and result["values"]["outcome"] and result["status"] in (5, 6)
