"""The state of a robot at one instant, as the simulator knows it: its motion, what it touches, and what is near it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from mbf_abstract.geometry import Pose, Twist


class Thing(Enum):
    """What the robot can touch that is not the ground; everything fixed is a wall."""

    WALL = "wall"
    DOOR = "door"
    PERSON = "person"
    ROBOT = "robot"


@dataclass(frozen=True)
class Other:
    """A thing near the robot that moves by itself.

    Attributes
    ----------
    name : str
        Its kind and its number among those of this kind, such as ``person 2``, or that of a robot that navigates.
    gap : float
        Between the two outlines as seen from above [m]; 0 where they overlap.
    speed : float
        [m/s]
    """

    name: str
    thing: Thing
    gap: float
    speed: float


@dataclass(frozen=True)
class MotionSample:
    """State of a robot at one instant.

    Attributes
    ----------
    pose, velocity : Pose, Twist
        Ground truth of base_link; velocity in the base frame.
    commanded : Twist
        Motion asked for.
    rolling : Twist
        Motion that the turning wheels would make without slip.
    body_on_ground : bool
        Whether the body touches the ground.
    touched : frozenset of Thing
        What any part touches that is not ground.
    power : float
        Mechanical power of the motors [W], losses counted positive.
    others : tuple of Other
        What moves by itself and is near.
    """

    pose: Pose
    velocity: Twist
    commanded: Twist
    rolling: Twist
    body_on_ground: bool = False
    touched: frozenset[Thing] = frozenset()
    power: float = 0.0
    others: tuple[Other, ...] = ()

    @property
    def slip_speed(self) -> float:
        """Speed [m/s] at which the robot moves other than its wheels roll: sliding forward, backward or sideways."""
        return math.hypot(self.rolling.vx - self.velocity.vx, self.velocity.vy)
