"""DWA and MPPI: their kernels against naive twins, their sampling rules, and closed loops in a room."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.inertia import reached
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.control.trajectory_scoring import driven_poses, footprint_discs
from mbf_costmap_nav.controllers.dwa import DWAController, sample_velocities, sample_window, slowed_down
from mbf_costmap_nav.controllers.mppi import IDLE_CYCLES, MPPIController
from mbf_costmap_nav.critics.obstacle_critic import VALUE_OF_COST
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.kernels.control.critics import alignment, furthest_reached, map_costs, mean_angle_to
from mbf_costmap_nav.kernels.control.rollout import add_noise, clip_velocities, integrate
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner

CONTROLLERS = [DWAController, MPPIController]
CAR = {"motion_model": "ackermann"}
FREE_MAP = Costmap(np.zeros((200, 200), dtype=np.uint8), 0.05, -5.0, -5.0)
seeds = st.integers(0, 2**32 - 1)


def random_velocities(seed, steps=12, samples=7, spread=1.0):
    return (np.random.default_rng(seed).standard_normal((3, steps, samples)) * spread).astype(np.float32)


# ------------------------------------------------------------------------------------------------ kernels
@settings(max_examples=20, deadline=None)
@given(seed=seeds, yaw=st.floats(-3, 3))
def test_integrated_poses_equal_step_by_step_rotation(seed, yaw):
    velocities = random_velocities(seed)
    poses = np.empty_like(velocities)
    integrate(velocities, yaw, 0.05, poses)
    x, y, heading = np.zeros(7), np.zeros(7), np.full(7, yaw)
    for t in range(12):
        vx, vy, wz = velocities[:, t].astype(float)
        before, heading = heading, heading + wz * 0.05
        c, s = 0.5 * (np.cos(before) + np.cos(heading)), 0.5 * (np.sin(before) + np.sin(heading))
        x += (vx * c - vy * s) * 0.05
        y += (vx * s + vy * c) * 0.05
    np.testing.assert_allclose(poses[:, -1], [x, y, heading], atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, yaw=st.floats(-3, 3))
def test_what_the_footprint_is_checked_along_are_the_arcs_a_robot_drives_one_after_the_other(seed, yaw):
    velocities = random_velocities(seed)[:, :, 0].T.astype(np.float64)
    velocities[3:5, 2] = 0.0
    pose, along = (1.0, -2.0, yaw), []
    for vx, vy, wz in velocities.tolist():
        along.append(arc_poses(pose, vx, vy, wz, 0.05, 0.05)[-1])
        pose = tuple(along[-1].tolist())
    np.testing.assert_allclose(driven_poses((1.0, -2.0, yaw), velocities, 0.05), along, atol=1e-12)


@pytest.mark.parametrize("turn", [-2.0, 0.5, 2.0])
def test_a_constant_velocity_leads_along_its_arc_to_a_tenth_of_a_millimetre_in_half_a_second(turn):
    velocities = np.empty((3, 10, 1), dtype=np.float32)
    velocities[:, :, 0] = np.array([0.5, 0.0, turn])[:, None]
    poses = np.empty_like(velocities)
    integrate(velocities, 0.3, 0.05, poses)
    exact = arc_poses((0.0, 0.0, 0.3), 0.5, 0.0, turn, 0.5, 0.05)
    np.testing.assert_allclose(poses[:2, :, 0], exact[:, :2].T, atol=2e-4)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, radius=st.sampled_from([0.0, 0.5]), top_speed=st.sampled_from([0.45, math.inf]))
def test_clipped_velocities_keep_all_limits(seed, radius, top_speed):
    velocities = random_velocities(seed, spread=3.0)
    now, low, high = np.zeros(3), np.array([-0.3, -0.2, -1.0]), np.array([0.5, 0.2, 1.0])
    change = np.array([0.15, 0.15, 0.2])
    clip_velocities(velocities, *(a.astype(np.float32) for a in (now, low, high, change)), radius, top_speed)
    steps = np.diff(np.concatenate([np.zeros((3, 1, 7)), velocities], axis=1), axis=1)
    assert (velocities >= low[:, None, None] - 1e-6).all() and (velocities <= high[:, None, None] + 1e-6).all()
    assert np.hypot(*(steps[:2] / change[:2, None, None])).max() <= 1.0 + 1e-5
    assert abs(steps[2]).max() <= change[2] + 1e-6 or radius
    assert np.hypot(velocities[0], velocities[1]).max() <= top_speed + 1e-6
    if radius:
        assert (abs(velocities[2]) * radius <= abs(velocities[0]) + 1e-6).all()


@settings(max_examples=20, deadline=None)
@given(seed=seeds, top_speed=st.sampled_from([0.4, math.inf]))
def test_what_both_directions_change_together_equals_a_step_by_step_limit(seed, top_speed):
    velocities, now = random_velocities(seed), np.array([0.2, -0.1, 0.0], dtype=np.float32)
    high, change = np.array([0.5, 0.3, 1.0], dtype=np.float32), np.array([0.1, 0.05, 9.0], dtype=np.float32)
    expected = np.empty((2, 12, 7))
    for n in range(7):
        last = Twist.planar(*now.tolist())
        for t in range(12):
            vx, vy = (max(-h, min(float(velocities[k, t, n]), h)) for k, h in enumerate(high[:2].tolist()))
            share = min(1.0, top_speed / math.hypot(vx, vy))
            last = reached(Twist.planar(share * vx, share * vy), last, tuple(change.tolist()))
            expected[:, t, n] = last.vx, last.vy
    clip_velocities(velocities, now, -high, high, change, 0.0, top_speed)
    np.testing.assert_allclose(velocities[:2], expected, atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, top_speed=st.floats(0.0, 2.0))
def test_a_velocity_above_the_speed_limit_keeps_its_direction(seed, top_speed):
    given_ones = random_velocities(seed).reshape(3, -1).T.astype(float)
    for vx, vy, wz in given_ones:
        speed = math.hypot(vx, vy)
        share = min(1.0, top_speed / speed)
        assert slowed_down(np.array([[vx, vy, wz]]), top_speed)[0] == pytest.approx((share * vx, share * vy, wz))
    clipped, wide = random_velocities(seed), np.full(3, 1e3, dtype=np.float32)
    clip_velocities(clipped, np.zeros(3, dtype=np.float32), -wide, wide, wide, 0.0, top_speed)
    assert clipped.reshape(3, -1).T == pytest.approx(slowed_down(given_ones, top_speed), abs=1e-5)


def test_noise_is_scaled_and_added_to_the_nominal_sequence():
    nominal, noise = random_velocities(0)[:, :, 0], random_velocities(1, samples=5)
    velocities, deviation = np.full_like(noise, 7.0), np.array([1.0, 0.0, 2.0], dtype=np.float32)
    add_noise(nominal, noise, deviation, velocities)
    expected = nominal[:, :, None] + deviation[:, None, None] * noise
    expected[1] = 7.0  # left to clip_velocities, as the robot cannot go sideways
    np.testing.assert_allclose(velocities, expected, rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, disc=st.sampled_from([0.0, 0.2]))
def test_map_costs_equal_single_look_ups(seed, disc):
    rng = np.random.default_rng(seed)
    grid = Costmap(rng.choice([0, 50, 252, 253, 254, 255], (20, 20)).astype(np.uint8), 0.1, -1.0, -1.0)
    poses = random_velocities(seed, spread=0.6)
    total = map_costs(grid.cells, 0.1, -1.0, -1.0, poses, np.array([disc], dtype=np.float32), 2, VALUE_OF_COST)
    expected = np.zeros(7)
    for t in range(1, 12, 2):
        for n in range(7):
            x, y, yaw = poses[:, t, n].astype(float)
            place = x + disc * math.cos(yaw), y + disc * math.sin(yaw)
            # The kernel counts in float32: on the border of a cell rounding decides.
            assume(all(abs(value / 0.1 - round(value / 0.1)) > 1e-4 for value in place))
            cost = grid.cost_at(*place)
            expected[n] += 0.0 if cost is None else VALUE_OF_COST[cost]
    np.testing.assert_allclose(total, expected, rtol=1e-4)


def test_alignment_of_a_trajectory_on_the_path_is_zero_and_beside_it_the_distance():
    path = np.column_stack([np.arange(0, 2, 0.1), np.zeros(20)]).astype(np.float32)
    poses = np.zeros((3, 12, 2), dtype=np.float32)
    poses[0] = 0.1 * np.arange(1, 13)[:, None]
    poses[1, :, 1] = 0.3
    off = alignment(poses, path, 0.1, 1)
    assert off[0] == pytest.approx(0.0, abs=1e-5) and off[1] == pytest.approx(0.36, abs=0.1)
    assert furthest_reached(poses, path, 1) == 12


def test_angles_are_wrapped_in_the_heading_term():
    poses = np.full((3, 4, 1), math.pi - 0.1, dtype=np.float32)
    assert mean_angle_to(poses, -math.pi + 0.1)[0] == pytest.approx(0.2, abs=1e-5)


# ----------------------------------------------------------------------------------------------- sampling
@pytest.mark.parametrize(
    ("low", "high", "count", "expected"),
    [
        pytest.param(-30, 30, 1, [-30, 0, 30], id="F075"),
        pytest.param(10, 30, 1, [10, 30], id="F076"),
        pytest.param(-30, 30, 4, [-30, -10, 0, 10, 30], id="F077"),
        pytest.param(-10, 50, 4, [-10, 0, 10, 30, 50], id="F078"),
    ],
)
def test_velocity_samples(low, high, count, expected):
    assert sample_velocities(low, high, count).tolist() == pytest.approx(expected)


@given(low=st.floats(-20.0, 20.0), width=st.floats(1e-6, 20.0), count=st.integers(2, 60))
def test_velocity_samples_are_spaced_as_numpy_spaces_them(low, width, count):
    evenly = np.linspace(low, low + width, count)
    samples = sample_velocities(low, low + width, count)
    assert set(evenly.tolist()) <= set(samples.tolist()) <= set(evenly.tolist()) | {0.0}


def test_f079_a_tiny_asymmetry_adds_zero():
    assert len(sample_velocities(-10.00001, 10, 3)) == 4


@pytest.mark.parametrize(
    ("current", "low", "high", "change", "count", "expected"),
    [
        pytest.param(2, 0, 5, 1, 2, [1, 3], id="F080"),
        pytest.param(2, 1.5, 2.5, 1, 2, [1.5, 2.5], id="F081"),
        pytest.param(2, 0, 5, 0.5, 2, [1.5, 2.5], id="F082"),
        pytest.param(2, 0, 5, 1, 3, [1, 2, 3], id="F083-three"),
        pytest.param(2, 0, 5, 1, 5, [1, 1.5, 2, 2.5, 3], id="F083-five"),
        pytest.param(0, -5, 5, 1, 2, [-1, 0, 1], id="F084"),
        pytest.param(0, -5, 5, 1, 4, [-1, -1 / 3, 0, 1 / 3, 1], id="F085"),
    ],
)
def test_dynamic_window(current, low, high, change, count, expected):
    assert sample_window(current, low, high, change, count).tolist() == pytest.approx(expected)


def test_discs_cover_a_long_robot_and_one_disc_a_square_one(make_plugin):
    from mbf_costmap_nav.grid.footprint import Footprint

    square = Footprint([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    long = Footprint([[0.6, 0.2], [-0.4, 0.2], [-0.4, -0.2], [0.6, -0.2]])
    assert footprint_discs(square).tolist() == [0.0]
    assert footprint_discs(long)[[0, -1]].tolist() == pytest.approx([-0.2, 0.4])


# --------------------------------------------------------------------------------------------- controllers
def straight(length=3.0):
    return Path.from_points([(x, 0.0, 0.0) for x in np.linspace(0.0, length, 31)])


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_a_straight_path_is_driven_forward(make_plugin, controller_class):
    controller = make_plugin(controller_class, FREE_MAP)
    controller.set_plan(straight())
    for _ in range(5):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.2)))
    assert result.command.vx > 0.2 and abs(result.command.wz) < 0.3


@pytest.mark.parametrize(("controller_class", "model"), [(DWAController, {}), (MPPIController, CAR)])
def test_a_robot_that_lets_somebody_by_is_not_stuck_and_names_them(make_plugin, controller_class, model):
    controller = make_plugin(controller_class, FREE_MAP, min_vel_x=0.0, **model)
    comes = TrackedObject(4, Motion.MOVING, 0.9, 0.0, 0.0, -0.4, 0.0, 0.25, 5.0, 0.0, 0.0, 0.0, "map")
    controller.navigation_map.tracked_objects = lambda now: (comes,)
    controller.set_plan(straight())
    for _ in range(IDLE_CYCLES + 20):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist()))
        assert result.success and abs(result.command.vx) < 0.05
    assert result.hindered_by == "object 4 moves in the way, at (0.90, 0.00)"
    controller.navigation_map.tracked_objects = lambda now: ()
    assert controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist())).hindered_by == ""


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_a_robot_walled_in_has_no_valid_command_and_stands(make_plugin, controller_class):
    cells = np.full((200, 200), 253, dtype=np.uint8)
    controller = make_plugin(controller_class, Costmap(cells, 0.05, -5.0, -5.0))
    controller.set_plan(straight())
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist()))
    assert result.outcome == ExePathOutcome.NO_VALID_CMD and result.command is None


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_the_same_seed_gives_the_same_commands(make_plugin, room, controller_class):
    def commands():
        controller = make_plugin(controller_class, room, seed=7)
        controller.set_plan(Path.from_points([(x, 1.0, 0.0) for x in np.linspace(1, 3, 21)]))
        request = ControlRequest(Pose.planar(1.0, 1.1, 0.3), Twist.planar(0.2))
        return [controller.compute_velocity_commands(request).command for _ in range(3)]

    assert commands() == commands()


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_it_drives_through_the_room_without_touching_anything(make_plugin, room, closed_loop, controller_class):
    planner = make_plugin(ThetaStarPlanner, room, cost_factor=10.0)
    plan = planner.make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(7, 1, math.pi / 2)))
    controller = make_plugin(controller_class, room)
    robot, outcome, _ = closed_loop.follow(controller, plan.path, room, start=(1, 1, 0), angle_tolerance=0.4)
    assert outcome == 0
    vertices = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    assert not any(closed_loop.lethal_under(room, vertices, state) for state in robot.trace[::5])


def test_mppi_drives_around_an_obstacle_that_is_on_the_path(make_plugin, closed_loop):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[97:104, 128:134] = 254
    costmap = Costmap(closed_loop.inflated(cells, 0.05, decay=4.0), 0.05, -5.0, -5.0)
    robot, outcome, _ = closed_loop.follow(make_plugin(MPPIController, costmap), straight(), costmap, start=(0, 0, 0))
    assert outcome == 0 and max(abs(state[1]) for state in robot.trace) > 0.3


def test_an_ackermann_robot_gets_steering_angles_within_its_turning_circle(make_plugin):
    controller = make_plugin(
        MPPIController, FREE_MAP, motion_model="ackermann", wheelbase=0.4, min_turning_radius=0.8, batch_size=500
    )
    controller.set_plan(Path.from_points([(0, y, 0.0) for y in np.linspace(0, 3, 31)]))
    for _ in range(5):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.3))).command
    assert isinstance(command, AckermannCommand)
    assert 0.0 < command.steering_angle <= math.atan(0.4 / 0.8) + 1e-3


def test_mppi_reports_the_sequence_it_means_to_drive_next_and_dwa_reports_none(make_plugin):
    controller = make_plugin(MPPIController, FREE_MAP, batch_size=500)
    controller.set_plan(straight())
    for _ in range(20):
        controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.3)))

    motion = controller.planned_motion()

    assert motion.velocities.shape == (controller.parameters.time_steps, 3)
    forward, sideways, turn = motion.velocities.sum(axis=0) * motion.step_time
    assert forward > 0.3 and sideways == 0.0 and abs(turn) < 0.2
    assert make_plugin(DWAController, FREE_MAP).planned_motion() is None


def test_an_omnidirectional_robot_drives_sideways(make_plugin):
    weights = {"twirling": 20.0, "path_angle": 0.0}
    controller = make_plugin(MPPIController, FREE_MAP, motion_model="omni", batch_size=1000, critics=weights)
    controller.set_plan(Path.from_points([(0, y, 0.0) for y in np.linspace(0, 3, 31)]))
    for _ in range(10):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist())).command
    assert command.vy > 0.05


BEND = Path.from_points(
    [*[(x, 0.0, 0.0) for x in np.linspace(0, 2, 21)], *[(2.0, y, 0.0) for y in np.linspace(0.1, 2, 20)]]
)


def test_an_ackermann_robot_drives_a_bend_without_ever_turning_tighter_than_it_can(make_plugin, closed_loop):
    radius = 0.6
    controller = make_plugin(
        MPPIController, FREE_MAP, motion_model="ackermann", min_turning_radius=radius, batch_size=500
    )
    robot, outcome, _ = closed_loop.follow(
        controller, BEND, FREE_MAP, start=(0, 0, 0), dist_tolerance=0.25, angle_tolerance=math.pi
    )
    assert outcome == 0
    steps = np.diff(np.array(robot.trace), axis=0)
    driven, turned = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    assert (turned <= driven / radius + 2e-3).all()


def test_an_omnidirectional_robot_drives_a_bend_without_turning(make_plugin, closed_loop):
    weights = {"twirling": 20.0, "path_angle": 0.0, "prefer_forward": 0.0}
    controller = make_plugin(MPPIController, FREE_MAP, motion_model="omni", batch_size=500, critics=weights)
    robot, outcome, _ = closed_loop.follow(
        controller, BEND, FREE_MAP, start=(0, 0, 0), dist_tolerance=0.2, angle_tolerance=math.pi
    )
    assert outcome == 0
    assert max(abs(state[2]) for state in robot.trace) < 0.4


@pytest.mark.parametrize("gap", [12, 9], ids=["wide", "it keeps to its path"])
def test_both_directions_of_an_omnidirectional_robot_change_together(make_plugin, gap):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:, 112:114] = 254
    cells[96 : 96 + gap, 112:114] = 0
    model = {
        "motion_model": "omni",
        "batch_size": 500,
        "acc_lim_x": 2.0,
        "acc_lim_y": 1.0,
        "vx_std": 0.6,
        "vy_std": 0.6,
    }
    controller = make_plugin(MPPIController, Costmap(cells, 0.05, -5.0, -5.0), **model)
    controller.set_plan(Path.from_points([(x, 0.02, 0.0) for x in np.linspace(0.0, 2.0, 21)]))
    for measured in (Twist.planar(0.2, 0.4), Twist.planar(0.0, -0.3, 0.5), Twist.planar(0.5)):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.0, 0.02), measured)).command
        gains = (command.vx - measured.vx) / (2.0 * 0.05), (command.vy - measured.vy) / (1.0 * 0.05)
        assert math.hypot(*gains) <= 1.0 + 1e-5
        assert controller._keeping.is_keeping == (gap == 9)


def test_a_differential_robot_never_moves_sideways(make_plugin):
    controller = make_plugin(MPPIController, FREE_MAP, batch_size=500)
    controller.set_plan(Path.from_points([(0, y, 0.0) for y in np.linspace(0, 3, 31)]))
    for _ in range(5):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist())).command
        assert command.vy == 0.0


@pytest.mark.parametrize("radius", [1.0, 2.0])
@pytest.mark.parametrize("off", [math.pi / 4, math.pi / 2], ids=["45 degrees", "90 degrees"])
def test_a_car_that_looks_away_from_its_path_turns_onto_it(make_plugin, closed_loop, radius, off):
    controller = make_plugin(
        MPPIController, FREE_MAP, motion_model="ackermann", min_turning_radius=radius, batch_size=1000
    )
    path = Path.from_points([(x, 0.0, 0.0) for x in np.linspace(-3.0, 3.0, 121)])
    robot, outcome, _ = closed_loop.follow(
        controller, path, FREE_MAP, start=(-3.0, 0.0, off), seconds=35.0, dist_tolerance=0.2, angle_tolerance=0.3
    )
    assert outcome == 0, f"ended at {robot.state}"


@pytest.mark.parametrize(
    ("controller_class", "parameters"),
    [(MPPIController, {"motion_model": "omni", "batch_size": 500}), (DWAController, {"max_vel_y": 0.5})],
    ids=["mppi", "dwa"],
)
def test_an_omnidirectional_robot_keeps_the_speed_limit_on_a_slant_too(
    make_plugin, closed_loop, monkeypatch, controller_class, parameters
):
    controller = make_plugin(controller_class, FREE_MAP, **parameters)
    monkeypatch.setattr(controller.costmap, "speed_limit", lambda x, y, full: min(full, 0.3))
    path = Path.from_points([(x, x, 0.0) for x in np.linspace(0, 3, 61)], Pose.planar(0, 0, 0).orientation)
    controller.set_plan(path)
    robot, speeds = closed_loop.robot(0.0, 0.0, 0.0), []
    for _ in range(60):
        command = controller.compute_velocity_commands(ControlRequest(robot.pose(), robot.velocity())).command
        speeds.append(math.hypot(command.vx, command.vy))
        robot.drive(command)
    assert 0.25 < max(speeds) <= 0.3 + 1e-6
