"""What a navigator publishes: only what has changed, only for those who listen, and all of it for who comes later."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal
from mbf_abstract.maps.view import GridView
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_ros.map_messages import WHOLE_PERIOD, Audience, GridMessages
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import MessageContext, initial_pose_of
from mbf_ros.messages.interfaces import completed
from mbf_ros.navigator_messages import LOOK_AHEAD, NavigatorMessages, path_ahead

SPOT = "[[2.8, 2.8], [3.2, 2.8], [3.2, 3.2], [2.8, 3.2]]"
COSTMAP = """
backend: costmap
global_costmap: {width: 6.0, height: 4.0, footprint: "[[-0.3, -0.2], [-0.3, 0.2], [0.4, 0.0]]", footprint_padding: 0.0,
  layers: [{name: area, type: keepout}], area: {zones: [{name: spot, polygon: SPOT}]}}
local_costmap: {width: 6.0, height: 4.0, footprint: "[[-0.3, -0.2], [-0.3, 0.2], [0.4, 0.0]]", footprint_padding: 0.0,
  layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
"""
MESH = """
backend: mesh
mesh_map: {mesh_file: floor.ply, inscribed_radius: 0.3, layers: [{name: area, type: keepout}],
  area: {regions: [{polygon: SPOT}]}}
planners: [{name: shortest, type: dijkstra}, {name: wave, type: cvp}]
controllers: [{name: follow, type: follow_path}]
"""
GRID, UPDATES = "global_costmap/costmap", "global_costmap/costmap_updates"


class Site:
    """A navigator on simulated time, and who listens to its topics."""

    def __init__(self, folder, config):
        trimesh.Trimesh(*heightfield_mesh(np.zeros((21, 31)), 0.2, 0.2), process=False).export(folder / "floor.ply")
        (folder / "robot.yaml").write_text(config.replace("SPOT", SPOT))
        self.clock, self.listeners = SimClock(), {}
        self.session = LoopbackSession(Pose.planar(1.0, 1.0), self.clock)
        self.session.serve(*read_config(folder / "robot.yaml"), self.session.robot, self.session.transforms)
        self.server = self.session.navigator.server
        self.messages = self.new_messages()
        self.types = {one.topic: one.type for one in self.messages.outputs}

    def new_messages(self):
        return NavigatorMessages(
            self.session,
            self.clock,
            lambda: MessageContext("map", 1000.0),
            lambda topic: self.listeners.get(topic, Audience(0, 0)),
            lambda: {"odom": ""},
        )

    def listen(self, *topics):
        for topic in topics:
            count, joined = self.listeners.get(topic, Audience(0, 0))
            self.listeners[topic] = Audience(count + 1, joined + 1)

    def changes(self, seconds=1.0):
        """What is new after some time, by topic; each message is one of its type."""
        self.clock.sleep(seconds)
        found = dict(self.messages.changes())
        for topic, message in found.items():
            completed(self.types[topic], message)
        return found


@pytest.fixture
def site(tmp_path, request):
    made = Site(tmp_path, {"mesh": MESH, "costmap": COSTMAP}[getattr(request, "param", "costmap")])
    with made.session:
        yield made
        made.messages.close()


def test_where_somebody_says_that_the_robot_is_goes_to_a_localisation_on_its_side(site):
    with pytest.raises(ValueError, match="nothing here localises the robot"):
        site.session.set_initial_pose(Pose.planar(2.0, 1.0))
    messages = NavigatorMessages(
        site.session, site.clock, MessageContext, lambda topic: Audience(0, 0), robot_localizes=True
    )
    with pytest.raises(ValueError, match="in the frame 'map', got 'odom'"):
        site.session.set_initial_pose(Pose.planar(2.0, 1.0, frame_id="odom"))
    site.session.set_initial_pose(Pose.planar(2.0, 1.0, 0.5))
    ((topic, message),) = messages.changes()
    assert topic == "initialpose" and list(messages.changes()) == []
    completed("geometry_msgs/PoseWithCovarianceStamped", message)
    assert initial_pose_of(message, MessageContext()).yaw == pytest.approx(0.5)
    messages.close()
    assert site.session.on_initial_pose == []


both = pytest.mark.parametrize("site", ["costmap", "mesh"], indirect=True)


@both
def test_of_a_map_to_which_nobody_listens_no_view_is_made(site, monkeypatch):
    monkeypatch.setattr(type(site.server), "map_view", None)
    messages = site.new_messages()
    assert [one.topic for one in messages.outputs] == list(site.types) and list(messages.changes()) == []
    messages.close()


@both
def test_what_views_of_a_map_look_like_is_known_without_making_one(site):
    assert all(isinstance(site.server.map_view(name), site.server.map_view_type) for name in site.server.map_views)


@both
def test_a_topic_has_its_own_name_and_a_known_type(site):
    names = [one.topic for one in site.messages.outputs]
    assert len(set(names)) == len(names) and {"plan", "~/current_goal", "~/events", "/diagnostics"} <= set(names)


def test_a_grid_comes_once_as_a_whole_and_again_to_whoever_comes_later(site):
    site.listen(GRID)
    cells = site.changes()[GRID]["data"].reshape(40, 60)
    assert cells[30, 30] == 100 and cells[5, 5] == 0
    assert site.changes() == {}
    site.listen(GRID)
    assert list(site.changes()) == [GRID]


def test_what_has_changed_comes_as_an_update_to_those_who_take_updates(site):
    site.listen(GRID, UPDATES)
    shown = site.changes()[GRID]["data"].reshape(40, 60).copy()
    for enabled, cell in ((False, 0), (True, 100)):
        site.server.set_layer_parameters("global_costmap.area", enabled=enabled)
        site.server.served["global_costmap"].update()
        found = site.changes()
        assert list(found) == [UPDATES]
        x, y, width, height = (found[UPDATES][name] for name in ("x", "y", "width", "height"))
        shown[y : y + height, x : x + width] = found[UPDATES]["data"].reshape(height, width)
        assert (shown == maps.occupancy_cells(site.server.map_view("global_costmap").costs)).all()
        assert shown[30, 30] == cell and width * height < 100


def test_who_does_not_take_updates_gets_the_whole_grid(site):
    site.listen(GRID, UPDATES)
    site.listen(GRID)
    site.changes()
    site.server.set_layer_parameters("global_costmap.area", enabled=False)
    site.server.served["global_costmap"].update()
    assert list(site.changes()) == [GRID]


class Views:
    """A server of one map whose view is set."""

    map_views = ("global_costmap",)

    def __init__(self):
        self.runtime, self.robot, self.global_frame = self, self, "map"
        self.view = None

    def map_view(self, name):
        return self.view


STEPS = st.lists(
    st.tuples(
        st.integers(0, 3), st.integers(0, 3), st.sampled_from([0.0, 0.5, 1.0, 2.0]), st.booleans(), st.booleans()
    ),
    max_size=12,
)


@given(STEPS)
def test_who_draws_grids_and_updates_always_sees_the_map(steps):
    server, audiences, shown = Views(), {GRID: Audience(1, 1), UPDATES: Audience(1, 1)}, None
    messages = GridMessages(server, "global_costmap", MessageContext, audiences.__getitem__)
    costs, corner = np.zeros((4, 4), np.float32), 0.0
    for number, (x, y, cost, moves, joins) in enumerate(steps):
        costs[y, x], corner = cost, corner + moves
        server.view = GridView(costs.copy(), (corner, corner + 4.0, 0.0, 4.0))
        if joins:
            audiences[GRID], shown = Audience(1, audiences[GRID].joined + 1), None
        for topic, message in messages.changes(WHOLE_PERIOD / 5.0 * number):
            if topic == GRID:
                shown, at = message["data"].reshape(4, 4).copy(), message["info"]["origin"]["position"]["x"]
            else:
                across, down = slice(message["x"], message["x"] + message["width"]), message["y"]
                part = message["data"].reshape(message["height"], message["width"])
                shown[down : down + message["height"], across] = part
        assert at == corner and (shown == maps.occupancy_cells(costs)).all()


@pytest.mark.parametrize("site", ["mesh"], indirect=True)
def test_a_mesh_comes_once_and_its_costs_when_they_change(site):
    site.listen("~/mesh", "~/vertex_costs", "~/mesh_markers")
    first = site.changes()
    costs = first["~/vertex_costs"]["mesh_vertex_costs"]["costs"]
    geometry = first["~/mesh"]["mesh_geometry"]
    forbidden = [v for v, cost in zip(geometry["vertices"], costs, strict=True) if np.isinf(cost)]
    assert forbidden and all(2.7 < v["x"] < 3.3 and 2.7 < v["y"] < 3.3 for v in forbidden)
    assert len(first["~/mesh_markers"]["markers"][0]["points"]) == 3 * len(geometry["faces"])
    assert site.changes() == {}
    site.server.set_layer_parameters("area", enabled=False)
    site.server.served["mesh_map"].update()
    second = site.changes()
    assert sorted(second) == ["~/mesh_markers", "~/vertex_costs"]
    assert not np.isinf(second["~/vertex_costs"]["mesh_vertex_costs"]["costs"]).any()
    site.listen("~/mesh")
    assert list(site.changes()) == ["~/mesh"]


@pytest.mark.parametrize("site", ["mesh"], indirect=True)
@pytest.mark.parametrize("field", ["~/vector_field", "~/mesh_vector_field"])
def test_the_directions_of_a_plan_come_once_and_again_to_whoever_comes_later(site, field):
    site.session.navigator.get_path(Pose.planar(3.0, 1.0), planner="wave")
    assert list(site.changes()) == ["plan"]
    site.listen(field)
    first = site.changes()
    assert list(first) == [field]
    shown = first[field].get("markers", [first[field].get("vector_field")])[0]
    assert len(shown.get("points", shown.get("positions")))
    assert site.changes() == {}
    site.listen(field)
    assert list(site.changes()) == [field]
    site.session.navigator.get_path(Pose.planar(1.0, 3.0), planner="wave")
    assert list(site.changes()) == ["plan", field]


@both
def test_the_outline_is_where_the_robot_is(site):
    site.listen("~/footprint")
    message = site.changes()["~/footprint"]
    corners = [(round(p["x"], 6), round(p["y"], 6)) for p in message["polygon"]["points"]]
    assert message["header"]["frame_id"] == "map"
    if "mesh_map" in site.server.served:
        assert len(corners) == 16 and corners[0] == (1.3, 1.0)
    else:
        assert corners == [(0.7, 0.8), (0.7, 1.2), (1.4, 1.0)]


def test_plan_and_goal_come_also_where_nobody_listens_and_events_only_where_somebody_does(site):
    site.session.navigator.get_path(Pose.planar(3.0, 1.0))
    found = site.changes()
    assert list(found) == ["plan"] and found["plan"]["poses"][-1]["pose"]["position"]["x"] == 3.0
    site.listen("~/events")
    handle = site.session.navigator.send(MoveBaseGoal(Pose.planar(5.0, 1.0)))
    found = site.changes(0.2)
    assert found["~/current_goal"]["pose"]["position"]["x"] == 5.0 and '"kind"' in found["~/events"]["data"]
    handle.cancel()
    handle.wait()


def test_the_local_plan_is_the_path_ahead_of_the_robot_while_it_drives(site):
    site.listen("local_plan")
    path = site.session.navigator.get_path(Pose.planar(5.5, 1.0)).path
    assert "local_plan" not in site.changes()
    handle = site.session.navigator.send(ExePathGoal(path))
    poses = site.changes(2.0)["local_plan"]["poses"]
    begin, end = (poses[i]["pose"]["position"]["x"] for i in (0, -1))
    assert 1.0 <= begin <= site.server.runtime.robot.pose().x < end
    handle.cancel()
    handle.wait()
    assert "local_plan" not in site.changes()


def test_diagnostics_come_once_a_second(site):
    site.listen("/diagnostics")
    assert [len(site.changes(0.5)) for _ in range(4)] == [1, 0, 1, 0]


@given(st.lists(st.floats(0.1, 2.0), min_size=1, max_size=20), st.floats(0.0, 1.0))
def test_the_path_ahead_begins_at_the_robot_and_is_as_long_as_asked(steps, share):
    xs = np.concatenate([[0.0], np.cumsum(steps)])
    path = Path(np.column_stack([xs, np.zeros((len(xs), 2))]))
    robot = share * xs[-1]
    ahead = path_ahead(path, xs[-1] - robot, LOOK_AHEAD).positions[:, 0]
    assert ahead[0] <= robot + 1e-9 and (len(ahead) == 1 or robot - 1e-9 <= ahead[1])
    assert ahead[-1] >= min(robot + LOOK_AHEAD, xs[-1]) - 1e-9
    assert len(ahead) < 3 or ahead[-2] <= robot + LOOK_AHEAD + 1e-9
