"""A wheeled robot in a PyBullet world: commands act on wheels through motors with limits; physics moves the robot.

It implements the core's ``Robot`` protocol (``send_command``, ``odometry``) and gives ground truth (``pose``,
``velocity``). Commands are only stored by ``send_command`` and reach the motors at the next step, so the velocity gate
may call from any thread. As on a real robot, the motors stop when no command arrives: ``command_timeout``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import AckermannCommand, Command, Pose, Twist, Vector3, rotation_matrix
from mbf_abstract.geometry.arithmetic import cross_product, rotated, rotated_back
from mbf_abstract.native_output import quiet_native_output
from terrain.physics.drive import STEERING_SPEED, bicycle_angle, commanded_twist, twist_from_wheels, wheel_targets
from terrain.physics.motion_sample import MotionSample, Thing
from terrain.physics.robot_models import Drive, RobotSpec
from terrain.physics.world import ROBOT, BulletWorld

STANDSTILL = Twist()
STEERING_TORQUE = 40.0  # N m
TOUCHING_DISTANCE = 1e-3  # m; Bullet reports contacts up to 2 cm apart
BODY_LINK = -1
SETTLING_TIME = 1.0  # s


class WheeledRobot:
    """One robot of a model of ``terrain.physics.robot_models``.

    Parameters
    ----------
    pose : Pose
        Of base_link on the ground; the robot is dropped from a little above (see ``settle``).
    command_timeout : float
        Motors stop this long [s of the world] after the last command; ``math.inf`` keeps driving.
    friction : float
        Coefficient of the wheels on ground of coefficient 1.
    mass_factor : float
        How many times as heavy as its model the robot is, in every part.
    """

    def __init__(
        self,
        world: BulletWorld,
        spec: RobotSpec,
        pose: Pose,
        command_timeout: float = 0.5,
        friction: float = 1.0,
        mass_factor: float = 1.0,
    ) -> None:
        self.world = world
        self.spec = spec
        self.friction = friction
        self.command_timeout = command_timeout
        self._bullet: Any = world.bullet
        self._command: Command = STANDSTILL
        self._command_stamp = world.time
        self._applied: Command | None = None
        self._last_state: tuple[int, Pose, Twist] | None = None
        drop = max(0.05, 1.5 * spec.wheel_radius) * pose.rotation[:, 2]
        with quiet_native_output():
            self.body: int = self._bullet.loadURDF(
                str(spec.urdf),
                basePosition=(np.array(pose.position) + drop).tolist(),
                baseOrientation=pose.orientation,
                flags=0 if spec.file is None else self._bullet.URDF_USE_INERTIA_FROM_FILE,
            )
        self._joints = self._read_joints()
        self._driven = [self._joints[name] for name in (*spec.left_wheels, *spec.right_wheels)]
        self._p_base_com = np.array(self._bullet.getDynamicsInfo(self.body, BODY_LINK)[3], dtype=float)
        self._set_up_contacts(friction)
        self._weigh(mass_factor)
        world.set_group(self.body, ROBOT)
        world.before_step(self._drive_motors)

    def _read_joints(self) -> dict[str, int]:
        """Joint indices by name."""
        count = self._bullet.getNumJoints(self.body)
        infos = [self._bullet.getJointInfo(self.body, i) for i in range(count)]
        return {info[1].decode(): info[0] for info in infos}

    def _set_up_contacts(self, friction: float) -> None:
        """Give wheels grip, casters none, and let joints that are neither driven nor steered roll freely."""
        for name, joint in self._joints.items():
            if name.endswith("caster_mount"):
                self._bullet.changeDynamics(self.body, joint, lateralFriction=0.01)
                continue
            self._bullet.changeDynamics(
                self.body, joint, lateralFriction=friction, anisotropicFriction=list(self.spec.wheel_friction)
            )
            if joint not in self._driven:  # Bullet puts a braking motor on every joint
                self._bullet.setJointMotorControl2(self.body, joint, self._bullet.VELOCITY_CONTROL, force=0)

    def _weigh(self, factor: float) -> None:
        """Make every part ``factor`` times as heavy, and as hard to turn."""
        if factor == 1.0:
            return
        for link in (BODY_LINK, *self._joints.values()):
            mass, _, inertia = self._bullet.getDynamicsInfo(self.body, link)[:3]
            scaled = [factor * moment for moment in inertia]
            self._bullet.changeDynamics(self.body, link, mass=factor * mass, localInertiaDiagonal=scaled)

    def send_command(self, command: Command) -> None:
        """Hold a command until the next one or the time-out.

        Raises
        ------
        TypeError
            An ``AckermannCommand`` for a robot that cannot steer.
        """
        if isinstance(command, AckermannCommand) and self.spec.drive is not Drive.ACKERMANN:
            raise TypeError(f"{self.spec.name} cannot steer: expected a Twist, got an AckermannCommand")
        self._command, self._command_stamp = command, self.world.time

    def settle(self, seconds: float = SETTLING_TIME) -> None:
        """Let the robot fall onto its wheels, then let this instant be time 0."""
        for _ in range(round(seconds / self.world.time_step)):
            self.world.step()
        self.world.restart_clock()
        self._command_stamp, self._last_state = 0.0, None

    def _drive_motors(self) -> None:
        """Set new targets of the motors before a step; Bullet keeps them until the next change."""
        if self.world.time - self._command_stamp > self.command_timeout:
            self._command = STANDSTILL
        if self._command is self._applied:
            return
        self._applied = self._command
        targets = wheel_targets(self.spec, self._command)
        lefts, rights = len(self.spec.left_wheels), len(self.spec.right_wheels)
        self._bullet.setJointMotorControlArray(
            self.body,
            self._driven,
            self._bullet.VELOCITY_CONTROL,
            targetVelocities=[targets.left] * lefts + [targets.right] * rights,
            forces=[self.spec.motor_torque] * (lefts + rights),
        )
        for name, angle in zip(self.spec.steering, (targets.steering_left, targets.steering_right), strict=False):
            self._bullet.setJointMotorControl2(
                self.body,
                self._joints[name],
                self._bullet.POSITION_CONTROL,
                targetPosition=angle,
                force=STEERING_TORQUE,
                maxVelocity=STEERING_SPEED,
            )

    def _state(self) -> tuple[Pose, Twist]:
        """Pose and velocity of base_link; Bullet gives those of the centre of mass, which lies higher."""
        step = self.world.step_count
        if self._last_state is not None and self._last_state[0] == step:
            return self._last_state[1], self._last_state[2]
        p_map_com, orientation = self._bullet.getBasePositionAndOrientation(self.body)
        v_map_com, omega_map = self._bullet.getBaseVelocity(self.body)
        R_map_base = rotation_matrix(orientation)
        offset_map = rotated(R_map_base, self._p_base_com)
        v_map_base = np.array(v_map_com) - cross_product(omega_map, offset_map)
        pose = Pose(_vector(np.array(p_map_com) - offset_map), orientation, "map", self.world.time)
        twist = Twist(_vector(rotated_back(R_map_base, v_map_base)), _vector(rotated_back(R_map_base, omega_map)))
        self._last_state = (step, pose, twist)
        return pose, twist

    def pose(self) -> Pose:
        """Ground truth of base_link in ``map``, stamped with the world's time."""
        return self._state()[0]

    def velocity(self) -> Twist:
        """Ground truth of the velocity of base_link, in base_link."""
        return self._state()[1]

    def odometry(self) -> Odometry:
        """Velocity for the core's ``Robot`` protocol: ground truth; ``terrain.sensors.lidar`` has one that drifts."""
        return Odometry(self.velocity(), self.world.time)

    def place(self, pose: Pose) -> None:
        """Put base_link at ``pose`` at once, at rest."""
        p_map_com = np.array(pose.position) + rotated(pose.rotation, self._p_base_com)
        self._bullet.resetBasePositionAndOrientation(self.body, p_map_com.tolist(), pose.orientation)
        self._bullet.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0])
        self._last_state = None

    def wheel_state(self) -> tuple[float, float, float, float]:
        """Mean speeds [rad/s] of left and right wheels, bicycle steering angle [rad], power of the motors [W]."""
        states = self._bullet.getJointStates(self.body, self._driven)
        speeds = [state[1] for state in states]
        lefts = len(self.spec.left_wheels)
        power = sum(abs(state[1] * state[3]) for state in states)
        return float(np.mean(speeds[:lefts])), float(np.mean(speeds[lefts:])), self._steering_angle(), power

    def _steering_angle(self) -> float:
        if not self.spec.steering:
            return 0.0
        joints = [self._joints[name] for name in self.spec.steering]
        states = self._bullet.getJointStates(self.body, joints)
        angle = bicycle_angle([state[0] for state in states])
        return -angle if self.spec.steers_behind else angle

    def rolling_velocity(self) -> Twist:
        """Motion of the base if the wheels did not slip."""
        left, right, steering, _ = self.wheel_state()
        return self._rolling(left, right, steering)

    def _rolling(self, left: float, right: float, steering: float) -> Twist:
        """Motion of the base that belongs to a state of the wheels."""
        return twist_from_wheels(self.spec, left, right, steering)

    def motion_sample(self) -> MotionSample:
        """Return the sample that ``IncidentMonitor`` takes."""
        pose, velocity = self._state()
        left, right, steering, power = self.wheel_state()
        rolling = self._rolling(left, right, steering)
        on_ground, touched = self._contacts()
        commanded = commanded_twist(self.spec, self._command)
        return MotionSample(pose, velocity, commanded, rolling, on_ground, touched, power)

    def _contacts(self) -> tuple[bool, frozenset[Thing]]:
        """Whether the body lies on the ground, and what any part touches that is not ground."""
        on_ground, touched = False, set[Thing]()
        for contact in self._bullet.getContactPoints(bodyA=self.body):
            other, link, distance = contact[2], contact[3], contact[8]
            if distance > TOUCHING_DISTANCE or other == self.body:
                continue
            if other in self.world.ground_bodies:
                on_ground |= link == BODY_LINK
            else:
                touched.add(self.world.things.get(other, Thing.WALL))
        return on_ground, frozenset(touched)


def _vector(values: np.ndarray[Any, Any]) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z
