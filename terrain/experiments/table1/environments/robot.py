"""The robot model of Table I, used for all robots: 0.7 x 0.5 m, differential, 0.6 m/s, 1 rad/s, 0.5 m/s2."""

from __future__ import annotations

from terrain.physics.robot_models import Drive, RobotSpec, rectangle

HALF_LENGTH, HALF_WIDTH = 0.35, 0.25  # m

CARRIER = RobotSpec(
    name="carrier",
    drive=Drive.DIFFERENTIAL,
    footprint=rectangle(-HALF_LENGTH, HALF_LENGTH, HALF_WIDTH),
    height=0.4,
    mass=60.0,
    wheel_radius=0.1,
    track=0.44,
    wheelbase=0.0,
    left_wheels=("left",),
    right_wheels=("right",),
    max_speed=0.6,
    max_yaw_rate=1.0,
    max_acceleration=0.5,
    max_yaw_acceleration=2.0,
    motor_torque=10.0,
    lidar_position=(0.0, 0.0, 0.3),
)
"""No body file belongs to it: it is driven by ``KinematicRobot`` only."""
