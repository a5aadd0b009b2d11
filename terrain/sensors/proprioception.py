"""Proprioceptive sensors: tilt (IMU), wheel odometry that drifts, and a localisation that can jump."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Pose, Quaternion, Twist, Vector3, quaternion_from_yaw, quaternion_multiply
from terrain.physics.incidents import roll_pitch
from terrain.physics.protocols import SimulatedRobot
from terrain.sensors.sensor import Sensor

RATE = 50.0  # Hz
TILT_NOISE, TURNING_NOISE = 0.005, 0.01  # rad and rad/s; standard deviations of an IMU
WRONG_TILT = 0.35  # rad; what a defective IMU adds to roll
WRONG_SPEED_FACTOR = -1.0  # a defective encoder counts backwards
WRONG_PLACE = (2.0, -1.5, 0.8)  # m, m, rad; how far a localisation gone wrong is off


@dataclass(frozen=True)
class Tilt:
    """Attitude from an IMU: ``roll``, ``pitch`` [rad], ``angular_velocity`` (3,) [rad/s] and ``stamp`` [s]."""

    roll: float
    pitch: float
    angular_velocity: Vector3
    stamp: float


class Imu(Sensor[Tilt]):
    """Roll, pitch and turning rates with white noise; no heading."""

    def __init__(self, robot: SimulatedRobot, rng: np.random.Generator, rate: float = RATE) -> None:
        super().__init__(robot, rate, rng)

    def _sense(self, stamp: float) -> Tilt:
        roll, pitch = roll_pitch(self.robot.pose())
        noise = self.rng.normal(size=5).tolist()
        x, y, z = self.robot.velocity().angular
        turning = (x + TURNING_NOISE * noise[2], y + TURNING_NOISE * noise[3], z + TURNING_NOISE * noise[4])
        return Tilt(roll + TILT_NOISE * noise[0], pitch + TILT_NOISE * noise[1], turning, stamp)

    def _falsify(self, measurement: Tilt) -> Tilt:
        return replace(measurement, roll=measurement.roll + WRONG_TILT)


@dataclass(frozen=True)
class WheelOdometryReading:
    """Pose in the frame ``odom`` (the start is its origin, level) and velocity in base_link."""

    pose: Pose
    odometry: Odometry


class WheelOdometry(Sensor[WheelOdometryReading]):
    """Dead reckoning from wheel speeds. Slipping wheels and errors of the wheels' size make it drift.

    Parameters
    ----------
    scale_error, yaw_scale_error : float
        Standard deviations of the fixed relative errors of distance and turning, drawn once.
    noise : float
        Standard deviation of the relative error of each single reading.
    """

    def __init__(
        self,
        robot: SimulatedRobot,
        rng: np.random.Generator,
        scale_error: float = 0.01,
        yaw_scale_error: float = 0.02,
        noise: float = 0.02,
    ) -> None:
        super().__init__(robot, RATE, rng)
        self.noise = noise
        self._scale = 1.0 + scale_error * float(rng.normal())
        self._yaw_scale = 1.0 + yaw_scale_error * float(rng.normal())
        self._x = self._y = self._yaw = 0.0
        self._last_stamp: float | None = None

    def _sense(self, stamp: float) -> WheelOdometryReading:
        rolling = self.robot.rolling_velocity()
        noise = self.rng.normal(size=2).tolist()
        speed = rolling.vx * self._scale * (1.0 + self.noise * noise[0])
        yaw_rate = rolling.wz * self._yaw_scale * (1.0 + self.noise * noise[1])
        return self._advanced(Twist.planar(speed, 0.0, yaw_rate), stamp)

    def _advanced(self, velocity: Twist, stamp: float) -> WheelOdometryReading:
        passed = 0.0 if self._last_stamp is None else stamp - self._last_stamp
        self._last_stamp = stamp
        middle = self._yaw + 0.5 * velocity.wz * passed
        self._x += velocity.vx * math.cos(middle) * passed
        self._y += velocity.vx * math.sin(middle) * passed
        self._yaw += velocity.wz * passed
        pose = Pose.planar(self._x, self._y, self._yaw, frame_id="odom", stamp=stamp)
        return WheelOdometryReading(pose, Odometry(velocity, stamp))

    def _falsify(self, measurement: WheelOdometryReading) -> WheelOdometryReading:
        vx, wz = measurement.odometry.velocity.vx, measurement.odometry.velocity.wz
        twist = Twist.planar(WRONG_SPEED_FACTOR * vx, 0.0, WRONG_SPEED_FACTOR * wz)
        return replace(measurement, odometry=replace(measurement.odometry, velocity=twist))


@dataclass(frozen=True)
class PoseNoise:
    """Standard deviations of x and y, and of z [m]; of the heading, and of roll and pitch [rad]."""

    position: float = 0.0
    height: float = 0.0
    yaw: float = 0.0
    tilt: float = 0.0


NO_NOISE = PoseNoise()


class Localization(Sensor[Pose]):
    """The pose of base_link in map as a localisation would give it: ground truth, noise, and an offset that can jump.

    It can be given a pose (``seat``). From then on it follows the robot's motion from there, and stays as
    wrong as that pose was: it does not find back by itself.

    Attributes
    ----------
    offset : (3,) float
        dx, dy [m] and yaw [rad] added to the truth; a scenario sets it to let map -> odom jump (REP-105).
    """

    def __init__(self, robot: SimulatedRobot, rng: np.random.Generator, noise: PoseNoise = NO_NOISE) -> None:
        super().__init__(robot, RATE, rng)
        self.noise = noise
        self.offset: Vector3 = (0.0, 0.0, 0.0)
        self._asked: Pose | None = None
        self._seat: tuple[Pose, Pose] | None = None  # where the robot was, and where it was said to be

    def seat(self, pose: Pose) -> None:
        """Take x, y and heading of a pose for those of the robot at the next measurement. On any thread."""
        self._asked = pose

    def _sense(self, stamp: float) -> Pose:
        noise, drawn = self.noise, self.rng.normal(size=6).tolist()
        dx, dy, dyaw = self.offset
        shift = (dx + noise.position * drawn[0], dy + noise.position * drawn[1])
        pose = _shifted(self._seated(self.robot.pose()), *shift, dyaw + noise.yaw * drawn[2], stamp)
        raised = (pose.x, pose.y, pose.z + noise.height * drawn[3])
        return replace(pose, position=raised, orientation=self._tilted(pose.orientation, drawn[4], drawn[5]))

    def _seated(self, truth: Pose) -> Pose:
        """Where the robot would be, had it moved as it did from where it was said to be; before offset and noise."""
        asked, self._asked = self._asked, None
        if asked is not None:
            dx, dy, dyaw = self.offset  # is added again
            self._seat = truth, Pose.planar(asked.x - dx, asked.y - dy, asked.yaw - dyaw)
        if self._seat is None:
            return truth
        was, said = self._seat
        turn = said.yaw - was.yaw
        cos, sin = math.cos(turn), math.sin(turn)
        dx, dy = truth.x - was.x, truth.y - was.y
        place = (said.x + cos * dx - sin * dy, said.y + sin * dx + cos * dy, truth.z)
        orientation = quaternion_multiply(quaternion_from_yaw(turn), truth.orientation)
        return replace(truth, position=place, orientation=orientation)

    def _tilted(self, orientation: Quaternion, roll: float, pitch: float) -> Quaternion:
        """Turn an orientation about its own x and y axis by so many standard deviations."""
        if self.noise.tilt == 0.0:
            return orientation
        half = 0.5 * self.noise.tilt
        about_x = (math.sin(half * roll), 0.0, 0.0, math.cos(half * roll))
        about_y = (0.0, math.sin(half * pitch), 0.0, math.cos(half * pitch))
        return quaternion_multiply(orientation, quaternion_multiply(about_x, about_y))

    def _falsify(self, measurement: Pose) -> Pose:
        return _shifted(measurement, *WRONG_PLACE, measurement.stamp)


def _shifted(pose: Pose, dx: float, dy: float, dyaw: float, stamp: float) -> Pose:
    orientation: Quaternion = pose.orientation
    if dyaw != 0.0:
        orientation = quaternion_multiply(quaternion_from_yaw(dyaw), orientation)
    return Pose((pose.x + dx, pose.y + dy, pose.z), orientation, pose.frame_id, stamp)
