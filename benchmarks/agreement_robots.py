"""Robots for ``agreement.py``: one that follows at once, and others drawn at random that nobody has tuned for."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_costmap_nav.grid.footprint import Footprint

Outline = tuple[tuple[float, float], ...]

STEP = 0.01
"""Time [s] between two changes of velocity of a robot with inertia."""
USUAL_WIDTH, USUAL_RADIUS = 0.5, 0.56
"""Of the robot [m] that the worlds are made for: its width, and how far its corners are from its base."""
FULL_SPEED_AFTER = 4.0
"""Every robot gets to its full speed within so long [s]."""
SLACK = 1.001


@dataclass(frozen=True)
class SimulatedRobot:
    """A robot's outline [m], its limits [m/s, rad/s, m/s^2, rad/s^2], and how it is commanded.

    Attributes
    ----------
    outline : corners of the robot; fewer than three for a disc
    radius : float
        [m] Of a disc.
    max_vel_y : float
        0 = it does not drive sideways.
    period, delay : float
        Time [s] from command to command, and from a command to what it does.
    is_drawn : bool
        Whether plugins are given its limits, instead of their defaults.
    """

    outline: Outline = ()
    radius: float = 0.25
    max_vel_x: float = math.inf
    max_vel_y: float = 0.0
    max_vel_theta: float = math.inf
    acc_lim_x: float = math.inf
    acc_lim_theta: float = math.inf
    period: float = 0.05
    delay: float = 0.0
    is_drawn: bool = False

    @property
    def footprint(self) -> Footprint:
        """The outline, or that of the disc."""
        return Footprint(self.outline) if self.outline else Footprint.circle(self.radius)

    @property
    def scale(self) -> float:
        """How much wider than usual passages have to be for it."""
        if not self.is_drawn:
            return 1.0
        return max(width_of(self.footprint) / USUAL_WIDTH, 0.8 * self.footprint.circumscribed_radius / USUAL_RADIUS)

    def parameters(self, plugin_class: Any) -> dict[str, Any]:
        """Parameters of a plugin that state what this robot can do; all others keep their defaults."""
        fields = plugin_class.Parameters.model_fields
        if not self.is_drawn:
            return {}
        given: dict[str, Any] = {name: allowed(fields[name], getattr(self, name)) for name in LIMITS if name in fields}
        given |= {"decel_lim_x": self.acc_lim_x} if "decel_lim_x" in fields else {}
        given |= {"rotate_to_heading_vel": self.max_vel_theta} if "rotate_to_heading_vel" in fields else {}
        given |= {"control_period": self.period} if "control_period" in fields else {}
        if "min_vel_x" in fields:
            given["min_vel_x"] = max(fields["min_vel_x"].default, -self.max_vel_x)
        if "max_vel_y" in fields:
            given |= {"max_vel_y": self.max_vel_y, "acc_lim_y": self.acc_lim_x}
        if "acc_lim_y" in fields and "model_dt" in fields:  # MPPI of the costmap, where a step is a period
            given |= {"model_dt": self.period, "time_steps": max(round(2.8 / self.period), 9)}
            given |= {"motion_model": "omni"} if self.max_vel_y else {}
        return given


LIMITS = ("max_vel_x", "max_vel_theta", "acc_lim_x", "acc_lim_theta")


@dataclass
class Motion:
    """How a robot moves by its commands, and what of them was more than it can do."""

    robot: SimulatedRobot
    velocity: Twist = field(default_factory=Twist)
    excess: dict[str, int] = field(default_factory=lambda: {"speed": 0, "yaw rate": 0, "acceleration": 0})
    """How many commands were beyond a limit; of acceleration, farther from the last one than a period allows."""
    _time: float = 0.0
    _sent: deque[tuple[float, Twist]] = field(default_factory=deque)

    def drive(self, pose: Pose, command: Twist) -> FloatArray:
        """Poses (n, 3: x, y [m], yaw [rad]) until the next command, the last one there."""
        robot, here = self.robot, (pose.x, pose.y, pose.yaw)
        if not robot.is_drawn:
            self.velocity = command
            return arc_poses(here, command.vx, command.vy, command.wz, robot.period, robot.period)
        self._sent.append((self._time + robot.delay, command))
        steps = math.ceil(robot.period / STEP)
        step, poses = robot.period / steps, []
        for _ in range(steps):
            while len(self._sent) > 1 and self._sent[1][0] <= self._time:
                self._sent.popleft()
            begun, target = self._sent[0]
            self.velocity = self._changed(target if begun <= self._time else Twist(), step)
            self._time += step
            driven = self.velocity.vx, self.velocity.vy, self.velocity.wz
            here = tuple(arc_poses(here, *driven, step, step)[-1].tolist())
            poses.append(here)
        return np.array(poses)

    def _changed(self, target: Twist, step: float) -> Twist:
        """The velocity a step later."""
        robot, now = self.robot, self.velocity
        gain, turn_gain = robot.acc_lim_x * step, robot.acc_lim_theta * step
        ahead, left = target.vx - now.vx, target.vy - now.vy
        share = min(gain / max(math.hypot(ahead, left), 1e-12), 1.0)
        turn = max(-turn_gain, min(target.wz - now.wz, turn_gain))
        vx = max(-robot.max_vel_x, min(now.vx + share * ahead, robot.max_vel_x))
        vy = max(-robot.max_vel_y, min(now.vy + share * left, robot.max_vel_y))
        return Twist.planar(vx, vy, max(-robot.max_vel_theta, min(now.wz + turn, robot.max_vel_theta)))

    def judge(self, command: Twist) -> None:
        """Take note of a command that is beyond a limit."""
        robot, last = self.robot, self._sent[-1][1] if self._sent else Twist()
        self.excess["speed"] += (
            abs(command.vx) > SLACK * robot.max_vel_x or abs(command.vy) > SLACK * robot.max_vel_y + 1e-9
        )
        self.excess["yaw rate"] += abs(command.wz) > SLACK * robot.max_vel_theta
        period = SLACK * robot.period
        gain, turn_gain = math.hypot(command.vx - last.vx, command.vy - last.vy), abs(command.wz - last.wz)
        is_fast = gain > robot.acc_lim_x * period + 1e-6 or turn_gain > robot.acc_lim_theta * period + 1e-6
        self.excess["acceleration"] += is_fast


def allowed(parameter: Any, value: float) -> float:
    """A value, or the largest one that a parameter may have."""
    return min([value, *(one.le for one in parameter.metadata if hasattr(one, "le"))])


def drawn_robot(seed: int, *, is_disc: bool = False) -> SimulatedRobot:
    """A robot that is a disc, a rectangle, L-shaped or a trapezoid, slow or fast, sluggish or brisk."""
    rng = np.random.default_rng((seed, 112))

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    radius, outline = between(0.1, 0.8), drawn_outline(rng)
    speed, yaw_rate = between(0.15, 2.5), between(0.3, 3.0)
    acceleration = max(between(0.2, 3.0), speed / FULL_SPEED_AFTER)
    yaw_acceleration = max(between(0.3, 6.0), yaw_rate / FULL_SPEED_AFTER)
    is_omni, delay = rng.random() < 0.3, float(rng.uniform(0.0, 0.15))
    period = 1.0 / float(rng.integers(5, 31))
    is_round = is_disc or rng.random() < 0.25
    return SimulatedRobot(
        () if is_round else outline,
        radius,
        speed,
        speed if is_omni and not is_disc else 0.0,
        yaw_rate,
        acceleration,
        yaw_acceleration,
        period,
        delay,
        is_drawn=True,
    )


def drawn_outline(rng: np.random.Generator) -> Outline:
    """Up to 2.0 m x 0.9 m, x ahead; the centre of rotation lies in the middle, or anywhere between 10 and 90 %."""
    length = float(rng.uniform(0.3, 2.0))
    width = float(rng.uniform(0.2, min(0.9, length)))
    shape, share = rng.choice(["rectangle", "L", "trapezoid"]), float(rng.uniform(0.4, 0.8))
    behind = length * (float(rng.uniform(0.1, 0.9)) if rng.random() < 0.7 else 0.5)
    front, back, side = length - behind, -behind, 0.5 * width
    if shape == "trapezoid":
        return (front, share * side), (back, side), (back, -side), (front, -share * side)
    if shape == "L":  # a mast or a gripper on the right of the front
        corner = max(share * front, 0.05)
        return (corner, side), (back, side), (back, -side), (front, -side), (front, -0.2 * side), (corner, -0.2 * side)
    return (front, side), (back, side), (back, -side), (front, -side)


def width_of(footprint: Footprint) -> float:
    """Least distance [m] of two parallel lines that hold an outline between them."""
    angles = np.linspace(0.0, math.pi, 180, endpoint=False)
    across = footprint.vertices @ np.stack([np.cos(angles), np.sin(angles)])
    return float((across.max(axis=0) - across.min(axis=0)).min())
