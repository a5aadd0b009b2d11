"""A node whose map comes on a topic: it waits for the first one, drives on the newest, and shows both to Foxglove."""

import time
from contextlib import ExitStack

import pytest

from tests.system.ros2.conftest import PEERS, ROBOT, WITHIN, Peer, Trio
from tests.unit.viewer.foxglove.conftest import Client as App

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]

LAYERS = "layers: [{name: area, type: keepout}]"
CONFIG = ROBOT.replace(LAYERS, "layers: [{name: area, type: keepout}, {name: walls, type: static}]").replace(
    "area: {zones: []}", "area: {zones: []}, walls: {map_topic: /map}"
)
CONFIG += "planner_max_retries: 0\n"
OPTIONS = "--foxglove", "--no-nav2"
REACHED, OFF_THE_MAP, BLOCKED = ("succeeded", 0), ("aborted", 63), ("aborted", 54)


def grid(width, height, x, y, **info):
    info = {"resolution": 0.5, "width": width, "height": height, "origin": {"position": {"x": x, "y": y}}, **info}
    return {"header": {"frame_id": "/map"}, "info": info, "data": [0] * (width * height)}


class Site(Trio):
    """A trio with a map server, which publishes the first map once the node has said that it waits for it."""

    def start_robot(self):
        super().start_robot()
        self.maps = self._start(Peer, str(PEERS / "publisher.py"))

    def publish(self, topic, kind, message, latched=False):
        since = len(self.maps.lines)
        self.maps.order({"topic": topic, "type": kind, "message": message, "latched": latched})
        self.maps.wait_for(lambda line: line.get("published") == topic, since)

    def wait_until_ready(self, since=0):
        self.node.wait_for(lambda line: "no map has come on /map yet" in line.get("text", ""), since)
        self.publish("/map", "nav_msgs/OccupancyGrid", grid(160, 40, -40.0, -10.0), latched=True)
        super().wait_until_ready(since)


@pytest.fixture(scope="module")
def site(ros_folder, tmp_path_factory, request):
    with ExitStack() as closing:
        yield Site(closing, ros_folder, tmp_path_factory.mktemp("site"), request.module)


def planned(site, x, y):
    """Status and outcome of a plan to a place."""
    return site.client.result("get_path", target=[x, y])


def wait_until_planned(site, x, y, wanted):
    deadline = time.monotonic() + WITHIN
    while (found := planned(site, x, y)) != wanted:
        assert time.monotonic() < deadline, found


def test_plans_are_made_on_the_newest_map_and_its_updates_and_a_bad_one_changes_nothing(site):
    assert (planned(site, 3.0, 0.0), planned(site, 3.0, 15.0)) == (REACHED, OFF_THE_MAP)
    bad = {**grid(10, 10, 0.0, 0.0), "data": [0] * 99}
    site.publish("/map", "nav_msgs/OccupancyGrid", bad, latched=True)
    site.publish("/map", "nav_msgs/OccupancyGrid", grid(160, 80, -40.0, -20.0), latched=True)
    wait_until_planned(site, 3.0, 15.0, REACHED)
    wall = {"header": {"frame_id": "map"}, "x": 78, "y": 38, "width": 4, "height": 4, "data": [100] * 16}
    site.publish("/map_updates", "map_msgs/OccupancyGridUpdate", wall)
    wait_until_planned(site, 3.0, 0.0, BLOCKED)


def test_the_robot_drives_on_a_map_that_came(site):
    site.publish("/map", "nav_msgs/OccupancyGrid", grid(160, 80, -40.0, -20.0), latched=True)
    wait_until_planned(site, 3.0, 0.0, REACHED)
    goal = site.drive()
    assert site.cancel(goal)["status"] == "canceled"


def test_an_app_of_foxglove_sees_robot_and_map_and_its_goal_is_driven_to(site):
    site.publish("/map", "nav_msgs/OccupancyGrid", grid(160, 80, -40.0, -20.0), latched=True)
    wait_until_planned(site, 3.0, 15.0, REACHED)
    address = site.node.wait_for(lambda line: "open connection" in line.get("text", ""))["text"].split()[-1]
    app = App(address)
    app.subscribe("/tf", "/map")
    assert app.newest("/tf").transforms[0].child_frame_id == "base_link"
    app.until(lambda: [one for one in app.messages.get("/map", ()) if one.column_count == 160])
    before = len(site.robot.lines)
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    pose = {"position": {"x": site.robot.x - 20.0, "y": 0.0, "z": 0.0}, "orientation": turn}
    app.publish("/move_base_simple/goal", {"header": {"frame_id": "map"}, "pose": pose})
    site.robot.wait_for_speed(lambda speed: speed > 0.0, before)
    site.client.wait(site.client.do(order="call", service="cancel_all"), "answer")
    site.robot.wait_until_last_speed_is_zero()
    app.socket.close()
