"""Costmap plugins on hand-made maps, without a server."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.grid.costmap import Costmap, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapContext

SQUARE_ROBOT = Footprint([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])


def plan(planner, start, goal, **request):
    """Let a planner plan from (x, y, yaw) to (x, y, yaw)."""
    return planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal), **request))


class FixedCostmap(LayeredCostmap):
    """A layered costmap without layers that hands out one fixed grid."""

    def __init__(self, costmap: Costmap, footprint: Footprint = SQUARE_ROBOT):
        self.fixed = costmap
        self.cleared: list[str] = []
        super().__init__(costmap.geometry, [], footprint, frame_id=costmap.frame_id)

    def snapshot(self) -> Costmap:
        return self.fixed

    def stale_reason(self, now):
        return ""

    def clear(self, layer_names=None):
        self.cleared.append("all")
        return []

    def clear_area(self, center, size, layer_names=None, *, inside=True):
        self.cleared.append(f"area {size:g}")
        return []


class ManualClock:
    """Time that only a test moves."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time


class StandingRobot:
    """Robot information with a pose and a velocity that a test sets."""

    def __init__(self) -> None:
        self.pose_now = Pose.planar(0.0, 0.0)
        self.velocity_now = Twist()

    def pose(self) -> Pose:
        return self.pose_now

    def velocity(self) -> Twist:
        return self.velocity_now

    def recent_track(self):
        return np.zeros((0, 3))


@pytest.fixture
def make_plugin() -> Callable[..., Any]:
    """``make_plugin(Class, cells or Costmap, resolution=.., footprint=.., seed=.., transforms=.., **parameters)``."""

    def make(
        plugin_class,
        cells,
        *,
        resolution=1.0,
        footprint=SQUARE_ROBOT,
        seed=0,
        costmap=None,
        transforms=None,
        turning_radius=0.0,
        **parameters,
    ):
        grid = cells if isinstance(cells, Costmap) else Costmap(np.asarray(cells, dtype=np.uint8), resolution)
        costmap = costmap or FixedCostmap(grid, footprint)
        context = CostmapContext(
            "dut",
            plugin_class.Parameters(**parameters),
            ManualClock(),
            np.random.default_rng(seed),
            StandingRobot(),
            costmap,
            maps={"local": costmap, "global": costmap},
            transforms=transforms or TransformBuffer(),
            min_turning_radius=turning_radius,
        )
        return plugin_class(context)

    return make


@pytest.fixture
def free_grid() -> Callable[..., GridGeometry]:
    """``free_grid(width, height)`` cells of cost 0."""
    return lambda width, height: np.zeros((height, width), dtype=np.uint8)


def inflated(cells, resolution, inscribed_radius=0.2, inflation_radius=0.6, decay=10.0):
    """Cells with costmap_2d's inflation around lethal ones, by brute-force distances."""
    from scipy.ndimage import distance_transform_edt

    distance = distance_transform_edt(np.asarray(cells) != 254) * resolution
    cost = (252 * np.exp(-decay * np.maximum(distance - inscribed_radius, 0.0))).astype(int)
    cost[distance <= inscribed_radius] = 253
    cost[distance > inflation_radius] = 0
    cost[distance == 0.0] = 254
    return cost.astype(np.uint8)


@pytest.fixture
def room() -> Costmap:
    """A room of 8 m x 6 m at 0.05 m with two pillars and a wall with a gap of 1.2 m, inflated."""
    cells = np.zeros((120, 160), dtype=np.uint8)
    cells[[0, -1], :] = 254
    cells[:, [0, -1]] = 254
    cells[0:70, 80:82] = 254
    cells[94:, 80:82] = 254
    cells[50:58, 40:48] = 254
    cells[80:88, 120:128] = 254
    return Costmap(inflated(cells, 0.05), 0.05)


class DrivenRobot:
    """A kinematic robot with limited accelerations; also the ``Motion`` of recoveries.

    ``drive`` applies a command for one period; ``send`` and ``sleep`` do the same in two steps.
    """

    def __init__(self, x, y, yaw, *, period=0.05, linear_accel=3.0, angular_accel=6.0):
        self.state = np.array([x, y, yaw])
        self.twist = np.zeros(3)
        self.period = period
        self.accel = np.array([linear_accel, linear_accel, angular_accel])
        self.command = Twist()
        self.commands: list[Twist] = []
        self.trace = [self.state.copy()]
        self.clock: ManualClock | None = None
        self.on_sleep: Callable[[], None] = lambda: None

    def pose(self) -> Pose:
        return Pose.planar(*self.state)

    def velocity(self) -> Twist:
        return Twist.planar(*self.twist)

    def drive(self, command: Twist) -> None:
        wanted = np.array([command.vx, command.vy, command.wz])
        change = self.accel * self.period
        self.twist = np.clip(wanted, self.twist - change, self.twist + change)
        yaw = self.state[2] + 0.5 * self.twist[2] * self.period
        c, s = np.cos(yaw), np.sin(yaw)
        vx, vy, wz = self.twist * self.period
        self.state = self.state + np.array([c * vx - s * vy, s * vx + c * vy, wz])
        self.trace.append(self.state.copy())

    def send(self, command: Twist) -> bool:
        self.command = command
        self.commands.append(command)
        return True

    def sleep(self, seconds: float) -> bool:
        for _ in range(max(1, round(seconds / self.period))):
            self.drive(self.command)
            if self.clock is not None:
                self.clock.time += self.period
            self.on_sleep()
        return True


def lethal_under(costmap, vertices, state):
    """Whether any lethal cell's centre lies in the footprint at (x, y, yaw): an independent collision check."""
    from matplotlib.path import Path as Polygon

    c, s = np.cos(state[2]), np.sin(state[2])
    outline = vertices @ np.array([[c, s], [-s, c]]) + state[:2]
    iy, ix = np.nonzero(costmap.cells == 254)
    return bool(Polygon(outline).contains_points(costmap.cells_to_world(np.column_stack([ix, iy]))).any())


def follow(controller, path, costmap, *, start, seconds=60.0, dist_tolerance=0.1, angle_tolerance=0.2):
    """Drive a kinematic robot along ``path``; return the robot, the outcome of the last cycle and the seconds used."""
    from mbf_abstract.plugins import ControlRequest

    robot = DrivenRobot(*start)
    assert controller.set_plan(path)
    for cycle in range(int(seconds / robot.period)):
        if controller.is_goal_reached(robot.pose(), dist_tolerance, angle_tolerance):
            return robot, 0, cycle * robot.period
        result = controller.compute_velocity_commands(ControlRequest(robot.pose(), robot.velocity()))
        if not result.success:
            return robot, result.outcome, cycle * robot.period
        controller.clock.time += robot.period
        robot.commands.append(result.command)
        robot.drive(result.command)
    return robot, -1, seconds


@pytest.fixture
def closed_loop() -> SimpleNamespace:
    """The helpers above, for tests (test files do not import each other)."""
    return SimpleNamespace(follow=follow, lethal_under=lethal_under, robot=DrivenRobot, inflated=inflated)
