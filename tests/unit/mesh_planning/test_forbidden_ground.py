"""Ground the map forbids: robots that stand on it get away, none drives farther in. Past the border is no ground."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.maps.recoveries.back_up import BackUpRecovery
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest, RecoveryRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.controllers.path_follower import PathFollower
from mbf_mesh_nav.kernels.search.forbidden_surface import LETHAL_RANK, may_enter, rank_at
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.planners.heading_astar import HeadingAStarPlanner
from mbf_mesh_nav.planners.repairing import RepairingPlanner
from mbf_mesh_nav.recoveries.escape import EscapeRecovery

PLANNERS = (DijkstraPlanner, AStarPlanner, CVPPlanner, AnyAnglePlanner, HeadingAStarPlanner, RepairingPlanner)
PERIOD = 0.1
WALL_FRONT, WALL_BACK, RING = 3.0, 3.5, 0.3


@pytest.fixture
def walled(paint):
    """A plain of 6 m x 6 m with a lethal block across its middle, and a ring of cost 1 around that."""
    mesh_map = MeshMap.from_heights(np.zeros((61, 61)), 0.1, 0.1)

    def costs(vertices):
        along = np.maximum(np.maximum(WALL_FRONT - vertices[:, 0], vertices[:, 0] - WALL_BACK), 0.0)
        gap = np.hypot(along, np.maximum(np.abs(vertices[:, 1] - 3.0) - 0.6, 0.0))
        return np.where(gap < 1e-9, np.inf, np.where(gap <= RING, 1.0, 0.0))

    return paint(mesh_map, costs)


class Robot:
    """A robot that moves at once as commanded, on the plane z = 0."""

    def __init__(self, x, y, yaw=0.0):
        self.x, self.y, self.yaw, self.places = x, y, yaw, [(x, y)]

    def pose(self):
        return Pose.planar(self.x, self.y, self.yaw)

    def velocity(self):
        return Twist()

    def send(self, command):
        speed = command.speed if isinstance(command, AckermannCommand) else command.vx
        turn = speed * math.tan(command.steering_angle) / 0.5 if isinstance(command, AckermannCommand) else command.wz
        self.x += speed * math.cos(self.yaw) * PERIOD
        self.y += speed * math.sin(self.yaw) * PERIOD
        self.yaw += turn * PERIOD
        self.places.append((self.x, self.y))
        return True

    def sleep(self, _):
        return True

    def recent_track(self):
        return np.zeros((0, 3))

    def was_in_the_block(self):
        return any(WALL_FRONT <= x <= WALL_BACK and abs(y - 3.0) <= 0.6 for x, y in self.places)


@pytest.mark.parametrize("front", [0.05, 0.15, 0.25, 0.5])
@pytest.mark.parametrize(
    ("controller_class", "options"),
    [(PathFollower, {}), (MPPIController, {}), (MPPIController, {"motion_model": "ackermann"})],
)
def test_no_controller_drives_into_an_obstacle_from_the_forbidden_ring_around_it(
    make_plugin, walled, controller_class, options, front
):
    controller, robot = make_plugin(controller_class, walled, **options), Robot(WALL_FRONT - front, 3.0)
    controller.set_plan(Path.from_points(np.array([[x, 3.0, 0.0] for x in np.arange(1.0, 5.01, 0.2)])))
    for _ in range(100):
        result = controller.compute_velocity_commands(ControlRequest(robot.pose(), Twist()))
        if result.outcome != ExePathOutcome.SUCCESS:
            break
        robot.send(result.command)
    assert not robot.was_in_the_block()
    assert result.outcome in {ExePathOutcome.BLOCKED_PATH, ExePathOutcome.NO_VALID_CMD}


@pytest.mark.parametrize("controller_class", [PathFollower, MPPIController])
def test_a_robot_in_the_ring_may_drive_away_from_the_obstacle(make_plugin, walled, controller_class):
    controller, robot = make_plugin(controller_class, walled), Robot(WALL_FRONT - 0.2, 3.0, math.pi)
    controller.set_plan(Path.from_points(np.array([[x, 3.0, 0.0] for x in np.arange(2.8, 0.9, -0.2)])))
    while robot.x > 1.2 and len(robot.places) < 200:
        result = controller.compute_velocity_commands(ControlRequest(robot.pose(), Twist()))
        assert result.outcome == ExePathOutcome.SUCCESS, result.message
        robot.send(result.command)
    assert robot.x <= 1.2


def test_backing_up_ends_before_an_obstacle_behind_the_forbidden_ring(make_plugin, walled):
    robot = Robot(WALL_BACK + 0.2, 3.0)
    walled.inscribed_radius = 0.05
    recovery = make_plugin(BackUpRecovery, walled, robot=robot)
    result = recovery.run_behavior(RecoveryRequest(robot, CancelToken()))
    assert not robot.was_in_the_block()
    assert "an obstacle is in the way" in result.message


@pytest.fixture
def crossed(make_plugin, paint):
    """What backing up by 1.5 m from x = 4 m ends with, over a band across x = 3 m, and the robot."""

    def crossed(cost, driven, **options):
        mesh_map = MeshMap.from_heights(np.zeros((61, 61)), 0.1, 0.1)
        band = paint(mesh_map, lambda vertices: np.where(np.abs(vertices[:, 0] - 3.0) < 0.16, cost, 0.0))
        band.inscribed_radius = 0.05
        robot = Robot(4.0, 3.0)
        robot.recent_track = lambda: np.array([[x, 3.0, 0.0] for x in np.arange(driven, 4.0, 0.05)])
        recovery = make_plugin(BackUpRecovery, band, robot=robot, distance=1.5, **options)
        return recovery.run_behavior(RecoveryRequest(robot, CancelToken())), robot

    return crossed


def test_backing_up_along_the_track_crosses_costly_ground_the_robot_has_driven_over(crossed):
    result, robot = crossed(1.2, driven=1.0, along_track=True)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert robot.x == pytest.approx(2.5, abs=0.05)


@pytest.mark.parametrize(
    ("cost", "driven", "options"),
    [
        (np.inf, 1.0, {"along_track": True}),  # it became lethal behind the robot
        (1.2, 3.3, {"along_track": True}),  # the track ends before it
        (1.2, 1.0, {}),
    ],
)
def test_backing_up_does_not_cross_lethal_ground_nor_costly_ground_off_the_track(crossed, cost, driven, options):
    result, robot = crossed(cost, driven, **options)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert robot.x > 3.1


def test_escape_does_not_cross_a_lethal_wall(make_plugin, paint):
    mesh_map = MeshMap.from_heights(np.zeros((61, 61)), 0.1, 0.1)
    # Costly ground between two lethal lines; what is free lies beyond them only.
    costs = lambda v: np.where(np.abs(np.abs(v[:, 1] - 3.0) - 0.5) < 0.06, np.inf, np.abs(v[:, 1] - 3.0) < 0.5)  # noqa: E731
    robot = Robot(3.0, 3.1)
    result = make_plugin(EscapeRecovery, paint(mesh_map, costs)).run_behavior(RecoveryRequest(robot, CancelToken()))
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert len(set(robot.places)) == 1


def test_escape_leaves_the_lethal_patch_the_robot_stands_on(make_plugin, walled):
    robot = Robot(WALL_FRONT + 0.12, 3.0, math.pi)
    result = make_plugin(EscapeRecovery, walled).run_behavior(RecoveryRequest(robot, CancelToken()))
    assert result.outcome == RecoveryOutcome.SUCCESS
    assert robot.x < WALL_FRONT - RING


@given(st.floats(0, 1), st.floats(0, 1), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_rank_is_that_between_the_corners_of_a_face_but_none_where_the_nearest_is_free(u, v, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = rng.uniform(-1, 1, (3, 3)), np.array([[0, 1, 2]], np.int32)
    ranks = rng.choice([0.0, 1.0, 1.5, LETHAL_RANK], 3).astype(np.float32)
    weights = np.array([1.0 - max(u, v), max(u, v) - min(u, v), min(u, v)])
    assume(np.diff(np.sort(weights))[-1] > 1e-6)
    point = tuple((weights @ vertices).tolist())
    found = rank_at(vertices, faces, ranks, 0, point)
    free = ranks[weights.argmax()] == 0.0
    assert found == (0.0 if free else pytest.approx(weights @ ranks, abs=1e-3))


@pytest.mark.parametrize(
    ("before", "now", "allowed"),
    [
        (0, 0, True),
        (4, 0, True),
        (1, 1, True),
        (2, 1, True),
        (3.9, 3, True),
        (0, 1, False),
        (1, 1.5, False),
        (4, 4, False),
    ],
)
def test_forbidden_ground_is_entered_only_from_ground_as_hard(before, now, allowed):
    assert may_enter(float(before), float(now)) == allowed


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_robot_in_the_ring_hears_how_it_gets_away(make_plugin, walled, planner_class):
    walled.inscribed_radius = RING
    for yaw, way in ((0.0, "backing up"), (math.pi, "driving on")):
        request = PlanRequest(Pose.planar(2.8, 3.0, yaw), Pose.planar(1.0, 3.0))
        result = make_plugin(planner_class, walled).make_plan(request)
        assert result.outcome == GetPathOutcome.BLOCKED_START
        assert "is blocked: cost 1" in result.message and f"it gets away by {way}" in result.message


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_goal_past_the_border_is_out_of_the_map(make_plugin, plain, planner_class):
    planner = make_plugin(planner_class, plain())
    result = planner.make_plan(PlanRequest(Pose.planar(1.0, 3.0), Pose.planar(6.3, 3.0)))
    assert result.outcome == GetPathOutcome.OUT_OF_MAP and "past its border" in result.message
    assert planner.make_plan(PlanRequest(Pose.planar(1.0, 3.0), Pose.planar(6.03, 3.0))).success


def test_a_robot_past_the_border_stands_on_no_ground(plain):
    mesh_map = plain()
    assert mesh_map.pose_check(PlaceQuery())(Pose.planar(-0.3, 3.0)).state == CellState.OUTSIDE
    assert mesh_map.point_check()(Pose.planar(-0.3, 3.0)).state == CellState.OUTSIDE
    assert mesh_map.point_check()(Pose((0.0, 3.0, 0.3))).state != CellState.OUTSIDE


def test_a_path_that_leaves_the_surface_is_blocked_at_its_border(make_plugin, plain):
    controller = make_plugin(PathFollower, plain())
    controller.set_plan(Path.from_points(np.array([[4.0, 3.0, 0.0], [8.0, 3.0, 0.0]])))
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(5.5, 3.0), Twist()))
    assert result.outcome == ExePathOutcome.BLOCKED_PATH and "would touch it at (6.10, 3.00" in result.message
