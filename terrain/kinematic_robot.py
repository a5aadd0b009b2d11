"""A robot without physics: it does what it is told, within its limits, on flat ground or on a heightfield.

Use it for sweeps of hundreds of runs and for tests of planners and controllers: it steps some thirty times faster
than Bullet. It never slips or tips over, so do not judge routes over rough ground with it. Walls of an occupancy grid,
obstacles and actors stop it, which counts as a collision; they do not push it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mbf_abstract.geometry import Command, Pose, Twist, normalize_angle
from mbf_abstract.robot import Odometry
from terrain.drive import commanded_twist
from terrain.heightfield import Heightfield
from terrain.mishaps import MotionSample, Thing
from terrain.occupancy import OccupancyGrid, wall_triangles
from terrain.robot_models import RobotSpec
from terrain.solids import joined
from terrain.upright_solids import UprightSolid

FloatArray = NDArray[np.float64]

TIME_STEP = 1.0 / 60.0
BLOCKED_GAP = 0.1  # m; what stopped a robot is nearer than its radius and this, more than it drives in a step
FLOOR = 1000.0  # m; half the size of the floor that sensors see in a world without a map


class KinematicWorld:
    """Ground and walls without physics; has the clock and the interface that ``Simulation`` steps.

    Parameters
    ----------
    terrain : Heightfield, optional
        Ground; level at z = 0 without it.
    building : OccupancyGrid, optional
        Its occupied cells are walls.
    """

    time_step = TIME_STEP

    def __init__(self, terrain: Heightfield | None = None, building: OccupancyGrid | None = None) -> None:
        self.terrain = terrain
        self.building = building
        self.robots: list[KinematicRobot] = []
        self.solids: list[UprightSolid] = []
        self.things: dict[int, Thing] = {}
        self.step_count = 0
        self._before_step: list[Callable[[], None]] = []
        self._clearance: FloatArray | None = None
        if building is not None:
            distance = ndimage.distance_transform_edt(~building.occupied)
            self._clearance = np.asarray(distance, dtype=float) * building.resolution

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.step_count * TIME_STEP

    def step(self) -> None:
        """Advance by one time step."""
        for callback in self._before_step:
            callback()
        self.step_count += 1
        for robot in self.robots:
            robot.advance(TIME_STEP)

    def before_step(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` before each step: moving actors, faults."""
        self._before_step.append(callback)

    def close(self) -> None:
        """Do nothing; there is nothing to free."""

    def __enter__(self) -> KinematicWorld:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def add_box(self, pose: Pose, size: Sequence[float], moving: bool = False) -> int:
        """Stand a box of ``size`` (3,) [m] with its middle at ``pose``; ``moving`` if it will be put elsewhere."""
        self.solids.append(UprightSolid(pose, size, moving))
        return len(self.solids) - 1

    def add_cylinder(self, pose: Pose, radius: float, height: float, moving: bool = False) -> int:
        """Stand a cylinder; as ``add_box``."""
        return self.add_box(pose, (radius, height), moving)

    def place_body(self, body: int, pose: Pose) -> None:
        """Put a box or cylinder at ``pose`` at once."""
        self.solids[body].pose = pose

    @property
    def has_moving_bodies(self) -> bool:
        """Whether anything may move besides the robots."""
        return any(solid.moving for solid in self.solids)

    def contains(self, x: float, y: float) -> bool:
        """Whether there is ground at (x, y) [m]."""
        terrain = self.terrain
        return terrain is None or (terrain.x0 <= x <= terrain.x_max and terrain.y0 <= y <= terrain.y_max)

    def clearance_at(self, x: float, y: float) -> float:
        """Distance [m] from (x, y) to the nearest wall, obstacle or actor; inf without any."""
        solid = min((solid.distance(x, y) for solid in self.solids), default=math.inf)
        return min(solid, self._wall_clearance(x, y))

    def touched_at(self, x: float, y: float, radius: float) -> frozenset[Thing]:
        """What a disc of ``radius`` [m] at (x, y) touches."""
        touched = {
            self.things.get(body, Thing.WALL) for body, solid in enumerate(self.solids) if solid.distance(x, y) < radius
        }
        return frozenset(touched | ({Thing.WALL} if self._wall_clearance(x, y) < radius else set()))

    def _wall_clearance(self, x: float, y: float) -> float:
        if self.building is None or self._clearance is None:
            return math.inf
        ix = math.floor((x - self.building.origin_x) / self.building.resolution)
        iy = math.floor((y - self.building.origin_y) / self.building.resolution)
        ny, nx = self._clearance.shape
        return float(self._clearance[iy, ix]) if 0 <= ix < nx and 0 <= iy < ny else math.inf

    def pose_at(self, x: float, y: float, yaw: float) -> Pose:
        """Pose on the ground; on a heightfield tilted with it. Raises ValueError off the terrain."""
        return Pose.planar(x, y, yaw) if self.terrain is None else self.terrain.pose_at(x, y, yaw)

    def static_triangles(self) -> tuple[FloatArray, NDArray[np.int32]]:
        """All that sensors can see as one mesh: vertices (n, 3) float64 [m], faces (m, 3) int32."""
        return joined([self._ground_triangles(), *(solid.triangles() for solid in self.solids if not solid.moving)])

    def _ground_triangles(self) -> tuple[FloatArray, NDArray[np.int32]]:
        """The ground with the walls of the building."""
        if self.terrain is not None:
            return self.terrain.triangles()
        floor = FLOOR * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
        floor_faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
        if self.building is None:
            return floor, floor_faces
        vertices, faces = wall_triangles(self.building)
        return np.concatenate([floor, vertices]), np.concatenate([floor_faces, faces + np.int32(4)])


class KinematicRobot:
    """A robot that follows commands exactly, within the speed and acceleration limits of its model.

    Parameters
    ----------
    world : KinematicWorld
    spec : RobotSpec
    pose : Pose
        Start; only x, y and yaw count.
    command_timeout : float
        It brakes this long [s] after the last command.
    """

    def __init__(self, world: KinematicWorld, spec: RobotSpec, pose: Pose, command_timeout: float = 0.5) -> None:
        self.world = world
        self.spec = spec
        self.command_timeout = command_timeout
        self._x, self._y, self._yaw = pose.x, pose.y, pose.yaw
        self._vx = self._wz = 0.0
        self._command: Command = Twist()
        self._command_stamp = world.time
        self._blocked = False
        world.robots.append(self)

    def send_command(self, command: Command) -> None:
        """Hold a command until the next one or the time-out."""
        self._command, self._command_stamp = command, self.world.time

    def stop(self) -> None:
        """Brake."""
        self.send_command(Twist())

    def advance(self, seconds: float) -> None:
        """Move on by one small time step; ground that ends and walls stop the robot."""
        if self.world.time - self._command_stamp > self.command_timeout:
            self._command = Twist()
        wanted = commanded_twist(self.spec, self._command)
        self._vx = _approach(self._vx, wanted.vx, self.spec.max_acceleration * seconds)
        self._wz = _approach(self._wz, wanted.wz, self.spec.max_yaw_acceleration * seconds)
        middle = self._yaw + 0.5 * self._wz * seconds
        step = self._vx * seconds * self._level_share(middle)
        x, y = self._x + step * math.cos(middle), self._y + step * math.sin(middle)
        self._blocked = not self._can_stand(x, y)
        if self._blocked:
            self._vx = 0.0
        else:
            self._x, self._y = x, y
        self._yaw = normalize_angle(self._yaw + self._wz * seconds)

    def _level_share(self, yaw: float) -> float:
        """Share of a move along the ground that is seen from above: the cosine of the slope ahead."""
        if self.world.terrain is None:
            return 1.0
        _, slope_x, slope_y = self.world.terrain.ground_at(self._x, self._y)
        return 1.0 / math.hypot(1.0, slope_x * math.cos(yaw) + slope_y * math.sin(yaw))

    def _can_stand(self, x: float, y: float) -> bool:
        if not self.world.contains(x, y):
            return False
        clearance = self.world.clearance_at(x, y)  # a robot that is too near a wall may still move away from it
        return clearance >= self.spec.inscribed_radius or clearance > self.world.clearance_at(self._x, self._y)

    def place(self, pose: Pose) -> None:
        """Put the robot at the x, y and yaw of ``pose`` at once, at rest."""
        self._x, self._y, self._yaw = pose.x, pose.y, pose.yaw
        self._vx = self._wz = 0.0

    def settle(self) -> None:
        """Do nothing; without gravity there is nothing to settle."""

    def pose(self) -> Pose:
        """Ground truth of base_link in ``map``, stamped with the world's time."""
        return self.world.pose_at(self._x, self._y, self._yaw).stamped(self.world.time)

    def velocity(self) -> Twist:
        """Ground truth of the velocity, in base_link."""
        return Twist.planar(self._vx, 0.0, self._wz)

    def rolling_velocity(self) -> Twist:
        """Return the velocity: these wheels never slip."""
        return self.velocity()

    def odometry(self) -> Odometry:
        """Velocity for the core's ``Robot`` protocol."""
        return Odometry(self.velocity(), self.world.time)

    def motion_sample(self) -> MotionSample:
        """Collect what ``MishapMonitor`` looks at."""
        commanded = commanded_twist(self.spec, self._command)
        velocity = self.velocity()
        reach = self.spec.inscribed_radius + (BLOCKED_GAP if self._blocked else 0.0)
        touched = self.world.touched_at(self._x, self._y, reach)
        if self._blocked and not touched:  # the ground ends here
            touched = frozenset({Thing.WALL})
        return MotionSample(self.pose(), velocity, commanded, velocity, touched=touched)


def _approach(value: float, target: float, most: float) -> float:
    """Move ``value`` towards ``target`` by at most ``most``."""
    return value + max(-most, min(most, target - value))
