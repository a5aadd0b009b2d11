"""MPPI on the surface: drives plans, goes round what the plan did not know, says when nothing is free."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.cvp import CVPPlanner


def straight_path(y=3.0):
    return Path.from_points([(x, y, 0.0) for x in np.linspace(0.8, 5.2, 45)])


def pillar(vertices):
    return np.where(np.hypot(vertices[:, 0] - 3.0, vertices[:, 1] - 3.0) < 0.45, np.inf, 0.0)


def test_it_drives_a_plan_over_hills_to_the_goal_pose(make_plugin, hills, drive, pose_on):
    goal = Pose.planar(5.0, 4.6, 1.0)
    plan = make_plugin(CVPPlanner, hills).make_plan(PlanRequest(Pose.planar(0.8, 0.8), goal))
    controller = make_plugin(MPPIController, hills)
    assert controller.set_plan(plan.path)
    poses = drive(controller, hills, pose_on(hills, (0.8, 0.8, 0), (-0.3, 1, 0)), 30.0)
    assert controller.is_goal_reached(poses[-1], 0.15, 0.2), poses[-1]


@pytest.mark.parametrize("seed", [4, 6])
def test_it_does_not_stand_still_just_short_of_the_goal_whatever_it_samples(make_plugin, hills, drive, pose_on, seed):
    plan = make_plugin(CVPPlanner, hills).make_plan(PlanRequest(Pose.planar(0.8, 0.8), Pose.planar(5.0, 4.6, 1.0)))
    controller = make_plugin(MPPIController, hills)
    controller.rng = np.random.default_rng(seed)
    controller.set_plan(plan.path)
    poses = drive(controller, hills, pose_on(hills, (0.8, 0.8, 0), (-0.3, 1, 0)), 16.0)
    assert controller.is_goal_reached(poses[-1], 0.1, 0.2), poses[-1]


@pytest.mark.parametrize("beside_goal", [(4.4, 3.6), (4.9, 3.0)])
def test_a_robot_that_got_beside_its_goal_or_past_it_still_drives_to_it(
    make_plugin, plain, drive, pose_on, beside_goal
):
    mesh_map = plain()
    controller = make_plugin(MPPIController, mesh_map)
    controller.set_plan(Path.from_points([(x, 3.0, 0.0) for x in np.linspace(3.8, 4.4, 7)]))
    poses = drive(controller, mesh_map, pose_on(mesh_map, (*beside_goal, 0), (1, 0, 0)), 20.0)
    assert controller.is_goal_reached(poses[-1], 0.15, 0.3), poses[-1]


def test_a_cost_limit_changed_between_two_goals_counts_at_once(make_plugin, plain, paint, pose_on):
    mesh_map = paint(plain(spacing=0.1), lambda v: np.full(len(v), 0.6))
    controller = make_plugin(MPPIController, mesh_map)
    request = ControlRequest(pose_on(mesh_map, (0.8, 3, 0), (1, 0, 0)), Twist())
    controller.set_plan(straight_path())
    assert controller.compute_velocity_commands(request).outcome == ExePathOutcome.SUCCESS
    controller.parameters = controller.parameters.model_copy(update={"cost_limit": 0.5})
    controller.set_plan(straight_path())
    assert controller._blocked().all()


def test_it_goes_round_an_obstacle_that_appeared_after_planning(make_plugin, plain, paint, drive, pose_on):
    mesh_map = plain(spacing=0.1)
    controller = make_plugin(MPPIController, mesh_map)
    controller.set_plan(straight_path())
    paint(mesh_map, pillar)
    poses = drive(controller, mesh_map, pose_on(mesh_map, (0.8, 3, 0), (1, 0, 0)), 40.0)
    assert controller.is_goal_reached(poses[-1], 0.15, 4.0), poses[-1]
    assert min(math.hypot(pose.x - 3.0, pose.y - 3.0) for pose in poses) > 0.4


def drive_car(controller, pose, wheelbase, angle_tolerance):
    """A kinematic car under a controller, for 20 s at most; the pose it comes to."""
    for _ in range(400):
        if controller.is_goal_reached(pose, 0.2, angle_tolerance):
            break
        command = controller.compute_velocity_commands(ControlRequest(pose, Twist())).command
        assert isinstance(command, AckermannCommand) and abs(command.steering_angle) <= 0.5
        yaw = pose.yaw + 0.05 * command.speed * math.tan(command.steering_angle) / wheelbase
        step = 0.05 * command.speed
        pose = Pose.planar(pose.x + step * math.cos(yaw), pose.y + step * math.sin(yaw), yaw)
    return pose


@pytest.mark.parametrize("heading", [math.pi / 2, -math.pi / 4, 2.5])
def test_an_ackermann_robot_arrives_with_the_heading_of_the_goal(make_plugin, plain, heading):
    controller = make_plugin(MPPIController, plain(), motion_model="ackermann", wheelbase=0.4)
    points = [(x, 2.5, 0.0) for x in np.linspace(0.8, 4.4, 37)]
    goal = Pose.planar(4.4, 2.5, heading)
    controller.set_plan(Path.from_points(points, goal.orientation))
    pose = drive_car(controller, Pose.planar(0.8, 2.5), 0.4, angle_tolerance=0.25)
    assert controller.is_goal_reached(pose, 0.2, 0.25), (pose, heading)


def test_an_ackermann_robot_gets_steering_and_reaches_the_goal(make_plugin, plain, pose_on):
    mesh_map = plain()
    controller = make_plugin(MPPIController, mesh_map, motion_model="ackermann", wheelbase=0.4)
    controller.set_plan(Path.from_points([(0.8, 1.0, 0.0), (3.0, 1.2, 0.0), (4.5, 2.5, 0.0), (4.8, 4.8, 0.0)]))
    pose = drive_car(controller, Pose.planar(0.8, 1.0), 0.4, angle_tolerance=math.pi)
    assert controller.is_goal_reached(pose, 0.2, math.pi), pose


def test_a_car_without_a_wheelbase_is_commanded_curves_that_it_drives_whatever_its_axles(make_plugin, plain):
    path = Path.from_points([(0.8, 1.0, 0.0), (3.0, 1.2, 0.0), (4.5, 2.5, 0.0), (4.8, 4.8, 0.0)])
    commands = {}
    for wheelbase in (0.0, 0.5):
        controller = make_plugin(MPPIController, plain(), motion_model="ackermann", wheelbase=wheelbase)
        controller.min_turning_radius = 1.75
        controller.set_plan(path)
        commands[wheelbase] = controller.compute_velocity_commands(
            ControlRequest(Pose.planar(0.8, 1.0), Twist())
        ).command
    twist, steered = commands[0.0], commands[0.5]
    assert twist.vx == steered.speed > 0.0
    assert twist.wz == pytest.approx(steered.speed * math.tan(steered.steering_angle) / 0.5) != 0.0
    assert abs(twist.wz) * 1.75 <= twist.vx * (1.0 + 1e-9)


@pytest.mark.parametrize("yaw", [1.6, 2.4, 2.8, math.pi])
def test_a_car_turns_round_onto_a_path_that_begins_behind_it(make_plugin, plain, yaw):
    controller = make_plugin(MPPIController, plain(12.0, 12.0), motion_model="ackermann", wheelbase=0.4)
    controller.set_plan(Path.from_points([(x, 6.0, 0.0) for x in np.linspace(5.0, 9.0, 41)]))
    pose = drive_car(controller, Pose.planar(5.0, 6.0, yaw), 0.4, angle_tolerance=math.pi)
    assert controller.is_goal_reached(pose, 0.2, math.pi), pose


def test_a_car_at_the_goal_with_a_wrong_heading_says_so_instead_of_standing_there(make_plugin, plain):
    controller = make_plugin(MPPIController, plain(), motion_model="ackermann", wheelbase=0.4)
    controller.set_plan(Path.from_points([(x, 2.5, 0.0) for x in np.linspace(3.4, 4.4, 11)]))
    for _ in range(60):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(4.4, 2.5, 0.6), Twist()))
        if not result.success:
            break
    assert result.outcome == ExePathOutcome.NO_VALID_CMD and "0.60 rad" in result.message


@pytest.mark.parametrize("model", ["differential", "ackermann"])
def test_it_reports_what_it_means_to_drive_next_with_the_turns_of_a_car_as_yaw_rates(make_plugin, plain, model):
    controller = make_plugin(MPPIController, plain(), motion_model=model, wheelbase=0.4)
    assert controller.planned_motion() is None
    controller.set_plan(Path.from_points([(0.8, 1.0, 0.0), (3.0, 3.2, 0.0), (3.0, 5.0, 0.0)]))
    pose = Pose.planar(0.8, 1.0)
    for _ in range(30):
        controller.compute_velocity_commands(ControlRequest(pose, Twist()))

    motion = controller.planned_motion()

    assert motion.velocities.shape == (controller.parameters.time_steps, 3)
    assert motion.step_time == controller.parameters.model_dt
    forward, sideways, turn = motion.velocities.sum(axis=0) * motion.step_time
    assert forward > 0.1 and sideways == 0.0 and turn > 0.1  # to the left, where the path leads
    if model == "ackermann":
        limit = np.abs(motion.velocities[:, 0]) * math.tan(controller.parameters.max_steering_angle) / 0.4
        assert (np.abs(motion.velocities[:, 2]) <= limit + 1e-9).all()


def coarse_with_a_fine_band():
    """A flat mesh of 6 m x 6 m with edges of 1 m and, around x = 3 m, of 0.06 m."""
    xs = np.concatenate([np.arange(3.0), 3.0 + 0.06 * np.arange(-5, 6), np.arange(4.0, 7.0)])
    grid = MeshMap.from_heights(np.zeros((7, len(xs))), 1.0, 1.0)
    return MeshMap.from_arrays(np.column_stack([xs[grid.vertices[:, 0].astype(int)], grid.vertices[:, 1:]]), grid.faces)


@pytest.mark.parametrize("refined", [False, True])
def test_a_wall_thinner_than_a_step_is_not_jumped_over(make_plugin, plain, paint, refined):
    mesh_map = coarse_with_a_fine_band() if refined else plain(spacing=0.1)
    paint(mesh_map, lambda v: np.where(np.abs(v[:, 0] - 3.0) < 0.01, np.inf, 0.0))
    controller = make_plugin(MPPIController, mesh_map, model_dt=0.5, time_steps=8, max_vel_x=2.0)
    controller.set_plan(straight_path())
    pose = Pose.planar(1.0, 3.0)
    for _ in range(200):
        result = controller.compute_velocity_commands(ControlRequest(pose, Twist()))
        if not result.success:
            break
        yaw = pose.yaw + 0.05 * result.command.wz
        step = 0.05 * result.command.vx * np.array([np.cos(yaw), np.sin(yaw)])
        pose = Pose.planar(pose.x + step[0], pose.y + step[1], yaw)
    assert 2.0 < pose.x < 2.95


def test_a_robot_that_lets_somebody_by_is_not_stuck_and_names_them(make_plugin, plain):
    controller = make_plugin(MPPIController, plain(), moving_objects={"weight": 200.0})
    comes = TrackedObject(4, Motion.MOVING, 1.5, 3.0, 0.0, -0.2, 0.0, 0.25, 5.0, 0.0, 0.0, 0.0, "map")
    controller.mesh_map.tracked_objects = lambda now: (comes,)
    controller.set_plan(straight_path())
    for _ in range(40):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.8, 3.0), Twist()))
        assert result.success and result.command.vx < 0.2
    assert result.hindered_by == "object 4 moves in the way, at (1.50, 3.00)"
    controller.mesh_map.tracked_objects = lambda now: ()
    assert controller.compute_velocity_commands(ControlRequest(Pose.planar(0.8, 3.0), Twist())).hindered_by == ""


def test_walled_in_on_all_sides_it_finds_no_valid_command(make_plugin, plain, paint):
    def ring(v):
        distance = np.hypot(v[:, 0] - 1.0, v[:, 1] - 1.0)
        return np.where((distance > 0.2) & (distance < 0.5), np.inf, 0.0)

    controller = make_plugin(MPPIController, paint(plain(spacing=0.05, width=2.0, height=2.0), ring))
    controller.set_plan(Path.from_points([(0.5, 1.0, 0.0), (1.9, 1.0, 0.0)]))
    pose, result = Pose.planar(1.0, 1.0), None
    for _ in range(60):  # it may use the room it has before it gives up
        result = controller.compute_velocity_commands(ControlRequest(pose, Twist()))
        if not result.success:
            break
        pose = Pose.planar(pose.x + 0.05 * result.command.vx, 1.0)
    assert result.outcome == ExePathOutcome.NO_VALID_CMD and result.command is None
    assert pose.x < 1.21


def test_off_the_surface_is_out_of_map(make_plugin, plain):
    controller = make_plugin(MPPIController, plain())
    controller.set_plan(straight_path())
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(1.0, 3.0, z=3.0), Twist()))
    assert result.outcome == ExePathOutcome.OUT_OF_MAP


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_path_far_away_is_missed(make_plugin, plain, side):
    controller = make_plugin(MPPIController, plain(), max_path_distance=1.0)
    assert not controller.set_plan(Path(np.zeros((0, 3))))
    controller.set_plan(straight_path())
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(2.0, 3.0 + 1.5 * side), Twist()))
    assert result.outcome == ExePathOutcome.MISSED_PATH


def test_two_controllers_with_one_seed_give_the_same_commands(make_plugin, hills):
    commands = []
    for _ in range(2):
        controller = make_plugin(MPPIController, hills)
        controller.set_plan(straight_path())
        request = ControlRequest(Pose.planar(1.0, 3.2, 0.3), Twist())
        commands.append([controller.compute_velocity_commands(request).command for _ in range(3)])
    assert commands[0] == commands[1]


def test_a_side_slope_is_avoided_when_tilt_weighs(make_plugin, drive, pose_on):
    from mbf_mesh_nav.map.mesh_map import MeshMap

    x, y = np.meshgrid(np.arange(61) * 0.1, np.arange(61) * 0.1)
    ridge = MeshMap.from_heights(0.6 * np.exp(-(((x - 3) / 0.8) ** 2) - ((y - 3) / 0.5) ** 2), 0.1, 0.1)
    heights = {}
    for weight in (0.0, 20.0):
        controller = make_plugin(MPPIController, ridge, tilt_weight=weight, path_weight=1.0)
        controller.set_plan(straight_path(y=3.3))
        poses = drive(controller, ridge, pose_on(ridge, (0.8, 3.3, 0), (1, 0, 0)), 30.0)
        heights[weight] = max(pose.z for pose in poses)
    assert heights[20.0] < 0.7 * heights[0.0]
