"""Controllers and recoveries on a costmap in another frame than paths and poses do what they do in the same one."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.recoveries.back_up import BackUpRecovery
from mbf_abstract.maps.recoveries.clear import ClearRecovery
from mbf_abstract.maps.recoveries.move_away import MoveAwayRecovery
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlRequest, RecoveryRequest
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.controllers.rotation_shim import RotationShimController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.recoveries.escape import EscapeRecovery

T_map_odom = Transform((2.0, 1.0, 0.0), quaternion_from_yaw(math.pi / 2), "map", "odom", static=True)
CONTROLLERS = [RegulatedPurePursuitController, DWAController, MPPIController, RotationShimController]


def in_map_and_odom(*boxes):
    """The same 10 m x 10 m at 0.1 m with lethal boxes (x0, y0, x1, y1) [m], as a grid in each frame."""
    cells = np.zeros((100, 100), dtype=np.uint8)
    for box in boxes:
        x0, y0, x1, y1 = (round((v + 5.0) / 0.1) for v in box)
        cells[y0:y1, x0:x1] = 254
    return Costmap(cells, 0.1, -5.0, -5.0), Costmap(cells[:, ::-1].T, 0.1, -6.0, -3.0, "odom")


@pytest.fixture
def make_pair(make_plugin):
    """The same plugin on the grid in map and on the one in odom."""
    transforms = TransformBuffer()
    transforms.set(T_map_odom)

    def make(plugin_class, *boxes, **parameters):
        return [
            make_plugin(plugin_class, grid, transforms=transforms, **parameters) for grid in in_map_and_odom(*boxes)
        ]

    return make


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_a_controller_gives_the_same_command_on_a_map_in_another_frame(make_pair, controller_class):
    path = Path.from_points([(0.0, 0.0, 0.0), (1.0, 0.3, 0.0), (2.0, 0.3, 0.0), (3.0, 1.0, 0.0)])
    request = ControlRequest(Pose.planar(0.23, 0.04, 0.2), Twist.planar(0.3))
    in_map, in_odom = (
        (controller.set_plan(path), controller.compute_velocity_commands(request))
        for controller in make_pair(controller_class, (1.0, -0.75, 1.4, -0.45))
    )
    assert in_map[0] and in_odom[0] and in_map[1].success
    expected, command = in_map[1].command, in_odom[1].command
    assert [command.vx, command.vy, command.wz] == pytest.approx([expected.vx, expected.vy, expected.wz], abs=1e-3)


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_arrival_and_progress_stay_in_the_frame_of_the_path(make_pair, controller_class):
    _, controller = make_pair(controller_class)
    controller.set_plan(Path.from_points([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0)]))
    controller.compute_velocity_commands(ControlRequest(Pose.planar(0.1, 0.0), Twist()))
    assert not controller.is_goal_reached(Pose.planar(0.3, 0.0), 0.1, 0.1)
    assert controller.is_goal_reached(Pose.planar(0.45, 0.0), 0.1, 0.1)


def test_a_wall_in_the_other_frame_blocks_the_path_where_it_is(make_pair):
    answers = []
    for controller in make_pair(RegulatedPurePursuitController, (0.5, -1.0, 0.7, 1.0)):
        controller.set_plan(Path.from_points([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]))
        answers.append(controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.5))))
    assert [answer.outcome for answer in answers] == [ExePathOutcome.BLOCKED_PATH] * 2


@pytest.mark.parametrize(
    ("recovery", "box"),
    [
        (BackUpRecovery, (-0.7, -1.0, -0.5, 1.0)),
        (EscapeRecovery, (0.1, -1.0, 0.3, 1.0)),
        (MoveAwayRecovery, (0.3, -0.2, 0.5, 0.2)),
        (ClearRecovery, (0.3, -0.2, 0.5, 0.2)),
    ],
)
def test_a_recovery_does_the_same_on_a_map_in_another_frame(make_pair, closed_loop, recovery, box):
    ends = []
    for plugin in make_pair(recovery, box):
        robot = closed_loop.robot(0.02, 0.03, 0.0)
        robot.clock = plugin.clock
        result = plugin.run_behavior(RecoveryRequest(robot))
        ends.append([result.outcome, *robot.state])
    assert ends[0] == pytest.approx(ends[1], abs=0.011)  # two periods: cells round differently in the two grids


def test_without_a_way_to_the_frame_of_the_map_nothing_moves(make_plugin, closed_loop):
    _, grid = in_map_and_odom()
    controller = make_plugin(RegulatedPurePursuitController, grid)
    assert not controller.set_plan(Path.from_points([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]))
    robot = closed_loop.robot(0.0, 0.0, 0.0)
    result = make_plugin(BackUpRecovery, grid).run_behavior(RecoveryRequest(robot))
    assert result.outcome == RecoveryOutcome.TF_ERROR and "odom" in result.message
    assert all(command.is_stopped() for command in robot.commands)


CONFIG = """
backend: costmap
planners: [{name: astar, type: astar, costmap: PLANNERS_MAP}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
recovery_behaviors: [{name: clear, type: clear, costmap: local}]
global_costmap: {width: 10.0, height: 10.0, origin_x: -5.0, origin_y: -5.0, robot_radius: 0.2}
local_costmap: {rolling_window: true, frame_id: odom, width: 4.0, height: 4.0, robot_radius: 0.2, resolution: 0.05}
"""


@pytest.fixture
def start(tmp_path):
    """``start(planners_map)``: a server whose robot's odometry is turned and moved against the map."""
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
    robot.T_map_odom = Transform((1.0, -2.0, 0.0), quaternion_from_yaw(2.0), "map", "odom")
    clock.sleep(0.1)

    def start(planners_map):
        file = tmp_path / "odom.yaml"
        file.write_text(CONFIG.replace("PLANNERS_MAP", planners_map))
        return Navigator.from_file(file, robot, clock, transforms), robot, clock

    yield start
    robot.close()


def test_a_robot_drives_with_its_local_map_in_odom_also_when_the_localisation_corrects_itself(start):
    navigator, robot, clock = start("global")
    with navigator:
        clock.sleep(0.5)
        assert navigator.go_to(Pose.planar(-1.0, 1.0, 0.5)).success
        robot.T_map_odom = Transform((1.1, -2.1, 0.0), quaternion_from_yaw(1.9), "map", "odom")
        clock.sleep(0.5)
        assert navigator.recover("clear").success
        arrived = navigator.go_to(Pose.planar(2.0, 2.0, 0.5))
        assert arrived.success and arrived.final_pose.distance_to(Pose.planar(2.0, 2.0)) < 0.1


def test_a_planner_on_a_map_in_another_frame_than_its_plans_is_refused(start):
    with pytest.raises(ServerError, match="plans are made in the frame 'map', but its costmap is in 'odom'"):
        start("local")
