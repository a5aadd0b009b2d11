"""The maps as the server runs them: updated at their rate, only while somebody needs them, current for a controller."""

from dataclasses import replace

import pytest

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import ExePathGoal, RecoveryGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock

CONFIG = """
backend: costmap
controller_patience: 1.0
shutdown_costmaps: SHUTDOWN
shutdown_costmaps_delay: 1.0
clear_on_shutdown: true
planners: [{name: astar, type: astar}]
controllers:
  - {name: pursuit, type: regulated_pure_pursuit}
  - {name: far_sighted, type: regulated_pure_pursuit, costmap: global}
recovery_behaviors: [{name: back_up, type: back_up}]
back_up: {time_limit: 3.0, speed: 0.2}
global_costmap: &map
  width: 20.0
  height: 20.0
  origin_x: -10.0
  origin_y: -10.0
  robot_radius: 0.2
  update_frequency: 10.0
  layers: [{name: obstacles, type: obstacle}]
  obstacles: {sources: {scan: {obstacle_max_range: 5.0, expected_update_rate: RATE}}}
local_costmap: *map
"""
BOX = Pose.planar(0.0, 3.05)


@pytest.fixture
def start(tmp_path):
    """``start(shutdown="false", rate=0)``: a server on simulated time; it and its robot are closed at the end."""
    clock, transforms, opened = SimClock(), TransformBuffer(), []

    def start(shutdown="false", rate=0.0, local="*map", events=None):
        file = tmp_path / "maps.yaml"
        text = CONFIG.replace("SHUTDOWN", shutdown).replace("RATE", str(rate))
        file.write_text(text.replace("local_costmap: *map", f"local_costmap: {local}"))
        robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
        opened.extend([navigator := Navigator.from_file(file, robot, clock, transforms, events), robot])
        return navigator, clock

    yield start
    for thing in opened:
        thing.close()


def see_the_box(navigator, clock):
    navigator.server.take_scan(RangeScan("scan", "map", (0.0, 0.0, 0.0), [(0.0, 3.05, 0.0)], [True], clock.now()))


def follow(length):
    return ExePathGoal(Path.from_points([(0.0, 0.0, 0.0), (length / 2.0, 0.0, 0.0), (length, 0.0, 0.0)]))


def age(served, clock):
    return clock.now() - served.map.last_update


def ages(navigator, clock):
    return [age(served, clock) for served in navigator.server.served.values()]


def test_all_plugins_share_the_two_maps_and_work_on_the_one_they_are_bound_to(start):
    navigator, _ = start()
    server = navigator.server
    plugins = {plugin.name: plugin.instance for kind in PluginKind for plugin in server.plugins.all_of(kind)}
    both = {"local": server.local_costmap, "global": server.global_costmap}
    assert all(plugin.maps == both for plugin in plugins.values())
    bound = {
        name: "global" if plugin.navigation_map is server.global_costmap else "local"
        for name, plugin in plugins.items()
    }
    assert bound == {"astar": "global", "pursuit": "local", "far_sighted": "global", "back_up": "local"}


def test_maps_run_all_the_time_by_default(start):
    navigator, clock = start()
    clock.sleep(5.0)
    assert max(ages(navigator, clock)) <= 0.1 + 1e-9


def test_idle_maps_stop_and_forget_and_the_next_goal_gets_a_fresh_one(start):
    navigator, clock = start(shutdown="true")
    see_the_box(navigator, clock)
    navigator.server.queries.update_map()
    assert navigator.server.queries.check_point(BOX).state is CellState.LETHAL
    clock.sleep(5.0)
    assert min(ages(navigator, clock)) > 3.0
    assert navigator.get_path(BOX).success
    assert min(ages(navigator, clock)) == 0.0


def test_a_goal_keeps_both_maps_running_to_its_end(start):
    navigator, clock = start(shutdown="true")
    oldest = []
    handle = navigator.server.exe_path.send(follow(2.0))
    while not handle.done:
        clock.sleep(0.05)
        oldest.extend(ages(navigator, clock))
    assert handle.wait().success and len(oldest) > 60 and max(oldest) <= 0.1 + 1e-9
    clock.sleep(2.0)
    assert min(ages(navigator, clock)) > 0.5


def test_maps_begin_and_cease_to_run_when_the_parameter_changes(start):
    navigator, clock = start(shutdown="true")
    clock.sleep(5.0)
    navigator.server.set_parameters(shutdown_costmaps=False)
    clock.sleep(0.3)
    assert max(ages(navigator, clock)) <= 0.1 + 1e-9
    navigator.server.set_parameters(shutdown_costmaps=True)
    clock.sleep(3.0)
    assert min(ages(navigator, clock)) > 1.5


def test_a_map_runs_to_the_end_of_its_last_user_and_through_the_delay(start):
    navigator, clock = start(shutdown="true")
    served = navigator.server.served["local_costmap"]
    with served.in_use():
        with served.in_use():
            clock.sleep(5.0)
        clock.sleep(5.0)
        assert age(served, clock) <= 0.1 + 1e-9, "one user is left"
    clock.sleep(0.8)
    with served.in_use():
        pass
    clock.sleep(0.8)
    assert age(served, clock) <= 0.1 + 1e-9, "each use begins the delay anew"
    clock.sleep(1.2)
    assert age(served, clock) > 0.8


def test_work_that_fails_does_not_stay_a_user_of_the_map(start):
    navigator, clock = start(shutdown="true")
    served = navigator.server.served["local_costmap"]
    with pytest.raises(RuntimeError, match="boom"), served.in_use():
        raise RuntimeError("boom")
    clock.sleep(5.0)
    assert age(served, clock) > 3.0


def test_a_silent_sensor_stops_the_robot_and_ends_the_goal(start):
    navigator, clock = start(rate=0.5)
    see_the_box(navigator, clock)
    handle = navigator.server.exe_path.send(follow(8.0))
    clock.sleep(3.0)
    ended = handle.wait()
    assert ended.outcome == ExePathOutcome.MAP_ERROR and "source 'scan' is silent" in ended.message
    assert 0.1 < ended.final_pose.x < 1.0


def test_a_controller_on_the_global_map_needs_that_one_to_be_current(start):
    navigator, clock = start(rate=0.5, local="{rolling_window: true, width: 4.0, height: 4.0, robot_radius: 0.2}")
    clock.sleep(1.0)
    ended = navigator.server.exe_path.send(replace(follow(1.0), controller="far_sighted")).wait()
    assert not ended.success and ended.plugin_outcome == ExePathOutcome.MAP_ERROR
    assert "source 'scan' has not sent anything yet" in ended.plugin_message and ended.final_pose.x == 0.0
    assert navigator.server.exe_path.send(follow(1.0)).wait().success


def test_a_stale_global_map_is_reported_by_its_name_and_keeps_neither_a_plan_nor_the_robot(start):
    navigator, clock = start(rate=0.5, local="{rolling_window: true, width: 4.0, height: 4.0, robot_radius: 0.2}")
    clock.sleep(1.0)
    server = navigator.server
    assert server.map_problem() == server.map_problem("local_costmap") == ""
    assert "source 'scan' has not sent anything yet" in server.map_problem("global_costmap")
    with pytest.raises(ServerError, match="there is no map 'mesh_map', only global_costmap, local_costmap"):
        server.map_problem("mesh_map")
    assert navigator.go_to(Pose.planar(1.0, 0.0)).success


def test_a_recovery_stands_while_its_map_is_not_current(start):
    navigator, clock = start(rate=0.5)
    ended = navigator.recover("back_up")
    assert ended.outcome == RecoveryOutcome.PAT_EXCEEDED and "source 'scan' has not sent anything yet" in ended.message
    assert navigator.robot_pose().x == 0.0
    handle = navigator.send(RecoveryGoal("back_up"))
    while not handle.done:
        see_the_box(navigator, clock)
        clock.sleep(0.2)
    assert handle.wait().success and navigator.robot_pose().x < -0.25


def test_a_map_whose_inflation_is_narrower_than_the_robot_is_served_with_a_warning(start):
    events = EventBus(lambda: 0.0, [MemorySink()])
    start(local="{robot_radius: 0.6, layers: [{name: i, type: inflation}], i: {inflation_radius: 0.3}}", events=events)
    narrow, outlines = [one for one in events.memory.of_kind(EventKind.MAP) if one.source == "local_costmap"]
    assert "smaller than the inscribed radius" in narrow.data["message"]
    assert "is another one on global_costmap, 0.2 m" in outlines.data["message"]
