"""A robot that moves any way in the plane, in Bullet: a force at its centre of mass stands for its wheels.

Rollers of mecanum and omni wheels cannot be modelled by contacts of cylinders. So the wheels are balls without
friction, and a planar force and a torque bring the body to the commanded velocity, limited by the friction that the
wheels would have. It acts only while a wheel touches the ground. Slipping is not modelled.
"""

from __future__ import annotations

import math

from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.arithmetic import rotated, rotated_back
from terrain.physics.bullet import GRAVITY
from terrain.physics.drive import commanded_twist
from terrain.physics.robots import BODY_LINK, STANDSTILL, TOUCHING_DISTANCE, WheeledRobot

RESPONSE = 0.05  # s; time in which the speed comes to a third of its distance from the command


class OmniRobot(WheeledRobot):
    """A ``WheeledRobot`` of a holonomic model."""

    _power = 0.0

    def _drive_motors(self) -> None:
        if self.world.time - self._command_stamp > self.command_timeout:
            self._command = STANDSTILL
        self._power = 0.0
        if not self._stands():
            return
        pose, velocity = self._state()
        wanted = commanded_twist(self.spec, self._command)
        gx, gy, _ = rotated_back(pose.rotation, [0.0, 0.0, -GRAVITY]).tolist()
        ax, ay = (wanted.vx - velocity.vx) / RESPONSE - gx, (wanted.vy - velocity.vy) / RESPONSE - gy
        grip = self.friction * GRAVITY
        share = min(1.0, grip / max(math.hypot(ax, ay), 1e-9))
        fx, fy = share * ax * self.spec.mass, share * ay * self.spec.mass
        p_map_com, _ = self._bullet.getBasePositionAndOrientation(self.body)
        force = rotated(pose.rotation, [fx, fy, 0.0]).tolist()
        self._bullet.applyExternalForce(self.body, BODY_LINK, force, p_map_com, self._bullet.WORLD_FRAME)
        moment = self._bullet.getDynamicsInfo(self.body, BODY_LINK)[2][2]
        turning = (wanted.wz - velocity.wz) / RESPONSE
        most = grip * self.spec.mass * self.spec.circumscribed_radius
        torque = max(-most, min(most, moment * turning))
        about = rotated(pose.rotation, [0.0, 0.0, torque]).tolist()
        self._bullet.applyExternalTorque(self.body, BODY_LINK, about, self._bullet.WORLD_FRAME)
        self._power = abs(fx * velocity.vx) + abs(fy * velocity.vy) + abs(torque * velocity.wz)

    def _stands(self) -> bool:
        """Whether a wheel touches anything."""
        contacts = self._bullet.getContactPoints(bodyA=self.body)
        return any(contact[3] != BODY_LINK and contact[8] <= TOUCHING_DISTANCE for contact in contacts)

    def wheel_state(self) -> tuple[float, float, float, float]:
        """Return no wheel speeds, no steering angle, and the power [W] of the force."""
        return 0.0, 0.0, 0.0, self._power

    def _rolling(self, left: float, right: float, steering: float) -> Twist:
        velocity = self.velocity()
        return Twist((velocity.vx, velocity.vy, 0.0), (0.0, 0.0, velocity.wz))
