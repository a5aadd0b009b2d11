"""A car keeps to paths that are as tight as it can steer: the kernel against its naive twin, and whole drives."""

import math
from itertools import product

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.control.close_steering import STEERINGS
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.control.steering import best_sequence
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner

CAR = Footprint([[0.8, 0.25], [-0.2, 0.25], [-0.2, -0.25], [0.8, -0.25]])
RADIUS = 0.7


def naive_best(grid, check, start, wanted, lengths, curvatures, now, steering_cost, reach, step, first_step):
    """All sequences one after the other, each arc integrated in small steps of its own."""

    def moved(pose, curvature, length):
        x, y, yaw = pose
        if abs(curvature) < 1e-9:
            return x + length * math.cos(yaw), y + length * math.sin(yaw), yaw
        turn, sign = curvature * abs(length), math.copysign(1.0, length)
        dx, dy = math.sin(yaw + turn) - math.sin(yaw), math.cos(yaw) - math.cos(yaw + turn)
        return x + sign * dx / curvature, y + sign * dy / curvature, yaw + turn

    best = math.inf, 0.0, math.inf
    for sequence in product(curvatures, repeat=len(lengths)):
        pose, before, cost, beside = tuple(start), now, 0.0, math.inf
        looked_at = [moved(pose, sequence[0], first_step)]
        for curvature, length, (x, y, yaw) in zip(sequence, lengths, wanted, strict=True):
            count = math.ceil(abs(length) / step)
            looked_at += [moved(pose, curvature, length * (k + 1) / count) for k in range(count)]
            pose = moved(pose, curvature, length)
            side = (pose[1] - y) * math.cos(yaw) - (pose[0] - x) * math.sin(yaw)
            beside = side**2 + (side + reach * math.remainder(pose[2] - yaw, 2.0 * math.pi)) ** 2
            cost += beside + steering_cost * (curvature - before) ** 2
            before = curvature
        if cost < best[0] and check.first_collision(grid, np.array(looked_at)) < 0:
            best = cost, sequence[0], beside
    return best[1:]


@pytest.mark.parametrize("seed", range(12))
def test_the_kernel_finds_the_sequence_that_a_look_at_all_finds(seed):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.uniform(size=(80, 80)) < (0.004, 0.0, 0.02)[seed % 3], 254, 0).astype(np.uint8)
    grid, check = Costmap(cells, 0.05), FootprintCheck(CAR, 0.05)
    start, direction = np.append(rng.uniform(1.2, 2.8, 2), rng.uniform(-3.0, 3.0)), rng.choice([-1.0, 1.0])
    lengths, reach = direction * np.array([0.06, 0.1, 0.14]) * rng.uniform(0.3, 2.0), 0.8
    wanted = start + np.cumsum(rng.uniform(-0.1, 0.1, (3, 3)), axis=0)
    steering = rng.uniform(-1.4, 1.4), rng.choice([0.0, 1e-4])
    steps = reach, 0.011, direction * 0.005
    geometry, curvatures = np.array([0.05, 0.0, 0.0]), STEERINGS[:5] / RADIUS
    found = best_sequence(cells, geometry, check.samples, start, wanted, lengths, curvatures, *steering, *steps)
    assert found == pytest.approx(naive_best(grid, check, start, wanted, lengths, curvatures, *steering, *steps))


def drive(controller, path, start, seconds=120.0, radius=RADIUS):
    """Drive without inertia; return how it ended, and how far base and nose were beside the path (n, 2) [m]."""
    tracker, pose, velocity, beside = PathTracker(path, dimensions=2), Pose.planar(*start), Twist(), []
    tracker.cusp_reached = 0.01
    assert controller.set_plan(path)
    for _ in range(round(seconds / 0.05)):
        if controller.is_goal_reached(pose, 0.1, 0.25):
            return "arrived", np.array(beside)
        result = controller.compute_velocity_commands(ControlRequest(pose, velocity))
        controller.clock.time += 0.05
        if not result.success:
            return result.outcome, np.array(beside)
        velocity = result.command
        assert abs(velocity.wz) * radius <= abs(velocity.vx) * (1.0 + 1e-6) + 1e-9
        turn = 0.05 * velocity.wz
        x, y = (
            (pose.x + 0.05 * velocity.vx * math.cos(pose.yaw + 0.5 * turn)),
            (pose.y + 0.05 * velocity.vx * math.sin(pose.yaw + 0.5 * turn)),
        )
        pose = Pose.planar(x, y, pose.yaw + turn)
        tracker.update((x, y))
        nearest = path[int(np.argmin(np.abs(tracker.lengths - tracker.progress)))]
        nose = 0.8 * math.remainder(pose.yaw - nearest.yaw, 2.0 * math.pi)
        beside.append((tracker.deviation, abs(nose)))
    return "late", np.array(beside)


def planned(make_plugin, grid, start, goal):
    """A path of the planner, and a controller on the same map."""
    car = {"footprint": CAR, "turning_radius": RADIUS}
    result = make_plugin(HybridAStarPlanner, grid, **car).make_plan(
        PlanRequest(Pose.planar(*start), Pose.planar(*goal))
    )
    assert result.success, result.message
    return result.path, make_plugin(RegulatedPurePursuitController, grid, **car)


@pytest.mark.parametrize("goal", [(2.0, 3.4, math.pi), (4.0, 2.8, 0.5 * math.pi), (2.2, 2.2, -2.5), (3.0, 2.0, 0.0)])
def test_a_car_keeps_to_the_tightest_curves_and_to_cusps(make_plugin, goal):
    path, controller = planned(make_plugin, Costmap(np.zeros((120, 120), dtype=np.uint8), 0.05), (2.0, 2.0, 0.0), goal)
    ending, beside = drive(controller, path, (2.0, 2.0, 0.0))
    assert ending == "arrived"
    assert beside[:, 0].max() < 0.03 and beside[:, 1].max() < 0.08


def bay(width):
    """A lane of 2.6 m with a bay for parking beside it, ``width`` [m] wide."""
    cells = np.full((120, 160), 254, dtype=np.uint8)
    cells[50:102, 5:155] = 0
    left = round((4.0 - 0.5 * width) / 0.05)
    cells[26:50, left : left + round(width / 0.05)] = 0
    return Costmap(cells, 0.05)


@pytest.mark.parametrize("goal", [(4.0, 1.6, 0.5 * math.pi), (4.0, 2.2, -0.5 * math.pi)], ids=["backward", "forward"])
def test_a_car_parks_in_a_bay_with_ten_centimetres_to_spare(make_plugin, goal):
    start = 1.2, 3.6, 0.0
    path, controller = planned(make_plugin, bay(0.7), start, goal)
    assert drive(controller, path, start)[0] == "arrived"


def test_what_stands_on_the_path_still_blocks_it(make_plugin):
    grid, start = Costmap(np.zeros((120, 120), dtype=np.uint8), 0.05), (1.0, 2.0, 0.0)
    path, controller = planned(make_plugin, grid, start, (5.0, 2.0, 0.0))
    grid.cells[30:50, 70:74] = 254
    ending, beside = drive(controller, path, start)
    assert ending == ExePathOutcome.BLOCKED_PATH and beside[:, 0].max() < 0.25


@pytest.mark.parametrize("yaw", [0.5 * math.pi, 2.0])
def test_headings_that_do_not_look_along_the_path_are_not_steered_to(make_plugin, yaw):
    grid = Costmap(np.zeros((120, 120), dtype=np.uint8), 0.05)
    controller = make_plugin(RegulatedPurePursuitController, grid, footprint=CAR, turning_radius=RADIUS)
    points = np.column_stack([np.arange(1.0, 4.0, 0.1), np.full(30, 2.0), np.zeros(30)])
    path = Path(points, np.tile([0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)], (30, 1)), "map")
    assert controller.set_plan(path)
    pose = Pose.planar(1.5, 2.0, math.pi if controller.tracker.driving_backward else 0.0)
    command = controller.compute_velocity_commands(ControlRequest(pose, Twist())).command
    assert abs(command.wz) < 0.05 * abs(command.vx)


BUS = Footprint([[9.0, 1.25], [-3.0, 1.25], [-3.0, -1.25], [9.0, -1.25]])
TOY = Footprint([[0.06, 0.03], [-0.02, 0.03], [-0.02, -0.03], [0.06, -0.03]])


@pytest.mark.parametrize(
    ("outline", "radius", "resolution", "speed", "start", "goal", "beside_path"),
    [
        (BUS, 8.0, 0.1, 2.0, (20.0, 20.0, 0.0), (20.0, 26.0, math.pi), 0.25),
        (TOY, 0.08, 0.01, 0.3, (1.0, 1.0, 0.0), (1.5, 1.2, -2.0), 0.02),
    ],
    ids=["bus", "toy"],
)
def test_cars_of_all_sizes_keep_to_their_paths(
    make_plugin, outline, radius, resolution, speed, start, goal, beside_path
):
    grid = Costmap(np.zeros((600, 600), dtype=np.uint8), resolution)
    car = {"footprint": outline, "turning_radius": radius}
    result = make_plugin(HybridAStarPlanner, grid, **car).make_plan(
        PlanRequest(Pose.planar(*start), Pose.planar(*goal))
    )
    controller = make_plugin(RegulatedPurePursuitController, grid, max_vel_x=speed, **car)
    ending, beside = drive(controller, result.path, start, radius=radius)
    assert ending == "arrived" and beside[:, 0].max() < beside_path


@pytest.mark.parametrize("goal", [(4.0, 1.6, 0.5 * math.pi), (4.0, 2.2, -0.5 * math.pi)], ids=["backward", "forward"])
def test_mppi_keeps_a_car_to_the_manoeuvre_that_its_samples_would_cut(make_plugin, goal):
    grid, start = bay(0.7), (1.2, 3.6, 0.0)
    path, _ = planned(make_plugin, grid, start, goal)
    car = {"footprint": CAR, "turning_radius": RADIUS}
    controller = make_plugin(MPPIController, grid, motion_model="ackermann", batch_size=500, **car)
    assert drive(controller, path, start)[0] == "arrived"
    controller.parameters = controller.parameters.model_copy(update={"max_vel_x": 0.2})
    controller.parameters_changed()
    assert controller.set_plan(path)
    command = controller.compute_velocity_commands(ControlRequest(Pose.planar(*start), Twist())).command
    assert 0.0 < abs(command.vx) <= 0.2


def test_a_car_drives_as_fast_as_it_may_where_its_path_is_straight_and_slowly_in_its_tightest_curve(make_plugin):
    grid = Costmap(np.zeros((200, 280), dtype=np.uint8), 0.05)
    turns = np.clip((np.arange(0.0, 13.0, 0.05) - 6.0) / 0.75, 0.0, 0.5 * math.pi)  # straight on, and left round
    steps = np.column_stack([np.cos(turns), np.sin(turns)]) * 0.05
    places = np.array([1.0, 1.0]) + np.cumsum(steps, axis=0)
    path = Path.from_poses(
        [Pose.planar(x, y, yaw) for (x, y), yaw in zip(places.tolist(), turns.tolist(), strict=True)]
    )
    controller = make_plugin(RegulatedPurePursuitController, grid, footprint=CAR, turning_radius=RADIUS)
    speeds, answer = [], controller.compute_velocity_commands

    def noting(request):
        result = answer(request)
        speeds.append((request.pose.x, request.pose.y, result.command.vx))
        return result

    controller.compute_velocity_commands = noting
    ending, beside = drive(controller, path, (1.05, 1.0, 0.0))
    assert ending == "arrived" and beside[:, 0].max() < 0.05
    full = controller.parameters.max_vel_x
    along = np.array(speeds)
    straight, curve = (along[:, 0] > 2.0) & (along[:, 0] < 5.5), (along[:, 0] > 7.0) & (along[:, 1] < 1.5)
    assert along[straight, 2].min() == pytest.approx(full)
    assert along[curve, 2].max() < 0.9 * full


LONG_OUTLINE = [(0.45, 0.2), (-0.45, 0.2), (-0.45, -0.2), (0.45, -0.2)]


@pytest.mark.parametrize("first_corner", [0, 2])
@pytest.mark.parametrize("base", [-0.3, 0.0, 0.3], ids=["base at the rear", "in the middle", "at the front"])
@pytest.mark.parametrize("gear", [1.0, -1.0], ids=["forward", "in reverse"])
@pytest.mark.parametrize(("off", "turned"), [(0.15, 0.0), (-0.15, 0.1), (0.1, -0.15)])
def test_a_car_beside_a_straight_path_comes_back_to_it_and_stays(make_plugin, first_corner, base, gear, off, turned):
    corners = np.roll(LONG_OUTLINE, first_corner, axis=0) - (base, 0.0)
    grid, yaw = Costmap(np.zeros((60, 280), dtype=np.uint8), 0.05), 0.0 if gear > 0.0 else math.pi
    along = np.arange(1.5, 11.5, 0.05)
    path = Path.from_poses([Pose.planar(x, 1.5, yaw) for x in along.tolist()])
    car = {"footprint": Footprint(corners.tolist()), "turning_radius": RADIUS}
    controller = make_plugin(RegulatedPurePursuitController, grid, **car)
    ending, beside = drive(controller, path, (1.5, 1.5 + off, yaw + turned))
    assert ending == "arrived"
    settled = len(beside) // 2
    assert beside[settled:, 0].max() < 0.02, "it has come back by the middle of the path"
