"""A robot without physics: it follows commands within its limits, on flat ground or on a heightfield.

Use it for sweeps of hundreds of runs and for tests of planners and controllers: it steps some thirty times faster
than Bullet. It never slips or tips over, so do not judge routes over rough ground with it. Walls of an occupancy grid,
obstacles and actors stop it where its outline touches them, which counts as a collision; they do not push it. A car
turns only as its steered wheels do, so it never drives a tighter curve than its turning circle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command, Pose, Twist, normalize_angle
from terrain.physics.actors import Fellow
from terrain.physics.drive import STEERING_SPEED, commanded_twist, steering_command
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.motion_sample import MotionSample, Thing
from terrain.physics.robot_models import Drive, RobotSpec

STOPPING_GAP = 0.03  # m; no robot here drives farther in a step


class KinematicRobot:
    """A robot that follows commands exactly, within the speed and acceleration limits of its model.

    Parameters
    ----------
    pose : Pose
        Start; only x, y and yaw count.
    command_timeout : float
        It brakes this long [s] after the last command.

    Attributes
    ----------
    fellows : sequence of Fellow
        Other robots in the world, which it can touch.
    """

    def __init__(self, world: KinematicWorld, spec: RobotSpec, pose: Pose, command_timeout: float = 0.5) -> None:
        self.world = world
        self.spec = spec
        self.command_timeout = command_timeout
        self._outline = spec.footprint_array()
        self._x, self._y, self._yaw = pose.x, pose.y, pose.yaw
        self._vx = self._vy = self._wz = self._steering = 0.0
        self._command: Command = Twist()
        self._command_stamp = world.time
        self._blocked = False
        self.fellows: Sequence[Fellow] = ()
        self._touched: frozenset[Thing] = frozenset()
        world.robots.append(self)

    def send_command(self, command: Command) -> None:
        """Hold a command until the next one or the time-out."""
        self._command, self._command_stamp = command, self.world.time

    def advance(self, seconds: float) -> None:
        """Move on by one small time step; ground that ends and what the outline would touch stop the robot."""
        if self.world.time - self._command_stamp > self.command_timeout:
            self._command = Twist()
        self._accelerate(seconds)
        middle = self._yaw + 0.5 * self._wz * seconds
        step = self._vx * seconds * self._level_share(middle)
        x, y = self._x + step * math.cos(middle), self._y + step * math.sin(middle)
        if self._vy != 0.0:
            left = middle + 0.5 * math.pi
            side = self._vy * seconds * self._level_share(left)
            x, y = x + side * math.cos(left), y + side * math.sin(left)
        yaw = normalize_angle(self._yaw + self._wz * seconds)
        self._blocked = not self._can_stand(x, y, yaw)
        if self._blocked:
            self._vx = self._vy = self._wz = 0.0
        else:
            self._x, self._y, self._yaw = x, y, yaw

    def _accelerate(self, seconds: float) -> None:
        """Bring speed and yaw rate nearer to the command; those of a car are tied by the angle of its wheels."""
        spec, wanted = self.spec, commanded_twist(self.spec, self._command)
        self._vx = _approach(self._vx, wanted.vx, spec.max_acceleration * seconds)
        self._vy = _approach(self._vy, wanted.vy, spec.max_acceleration * seconds)
        if spec.drive is Drive.ACKERMANN:
            angle = steering_command(spec, self._command)
            self._steering = _approach(self._steering, angle, STEERING_SPEED * seconds)
            self._wz = self._vx * math.tan(self._steering) / spec.wheelbase
        else:
            self._wz = _approach(self._wz, wanted.wz, spec.max_yaw_acceleration * seconds)

    def _level_share(self, yaw: float) -> float:
        """Share of a move along the ground that is seen from above: the cosine of the slope ahead."""
        if self.world.terrain is None:
            return 1.0
        _, slope_x, slope_y = self.world.terrain.ground_at(self._x, self._y)
        return 1.0 / math.hypot(1.0, slope_x * math.cos(yaw) + slope_y * math.sin(yaw))

    def _can_stand(self, x: float, y: float, yaw: float) -> bool:
        """Whether a pose is free, or at least freer than the present one; notes what blocks it."""
        if not self.world.contains(x, y):
            self._touched |= {Thing.WALL}
            return False
        depth, touched = self._contact(x, y, yaw)
        if depth <= 0.0 or depth < self._contact(self._x, self._y, self._yaw)[0]:
            return True
        self._touched |= touched
        return False

    def _contact(self, x: float, y: float, yaw: float, gap: float = 0.0) -> tuple[float, frozenset[Thing]]:
        """How deep [m] the robot would lie in walls and other things at a pose, and which it would touch."""
        fellows = [fellow.solid() for fellow in self.fellows]
        return self.world.contact(self._outline, x, y, yaw, self.spec.circumscribed_radius, gap, fellows)

    def place(self, pose: Pose) -> None:
        """Put the robot at the x, y and yaw of ``pose`` at once, at rest."""
        self._x, self._y, self._yaw = pose.x, pose.y, pose.yaw
        self._vx = self._vy = self._wz = self._steering = 0.0

    def settle(self) -> None:
        """Do nothing; without gravity there is nothing to settle."""

    def pose(self) -> Pose:
        """Ground truth of base_link in ``map``, stamped with the world's time."""
        return self.world.pose_at(self._x, self._y, self._yaw).stamped(self.world.time)

    def velocity(self) -> Twist:
        """Ground truth of the velocity, in base_link."""
        return Twist.planar(self._vx, self._vy, self._wz)

    def rolling_velocity(self) -> Twist:
        """Return the velocity: these wheels never slip."""
        return self.velocity()

    def odometry(self) -> Odometry:
        """Velocity for the core's ``Robot`` protocol."""
        return Odometry(self.velocity(), self.world.time)

    def motion_sample(self) -> MotionSample:
        """Return the sample that ``IncidentMonitor`` takes; all that was touched since the last sample counts.

        What stops a robot leaves a gap of up to a step's length; the contact lasts until the robot is farther away.
        """
        commanded, velocity = commanded_twist(self.spec, self._command), self.velocity()
        touched, near = self._touched, self._near()
        if near:  # what is not even near is not touched
            touched |= self._contact(self._x, self._y, self._yaw)[1]
        self._touched = touched & near
        return MotionSample(self.pose(), velocity, commanded, velocity, touched=touched)

    def _near(self) -> frozenset[Thing]:
        """What is within a step's length of the outline; ground that ends counts as a wall."""
        near = self._contact(self._x, self._y, self._yaw, STOPPING_GAP)[1]
        return near if self.world.contains(self._x, self._y, STOPPING_GAP) else near | {Thing.WALL}


def _approach(value: float, target: float, most: float) -> float:
    """Move ``value`` towards ``target`` by at most ``most``."""
    return value + max(-most, min(most, target - value))
