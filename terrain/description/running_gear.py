"""What a robot stands and rolls on: its wheels, its supports, and which drive they make.

``wheel_search.find_running_gear`` finds it in a URDF.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.description.parameters import DriveName
from terrain.description.solids import Placed
from terrain.description.urdf import Urdf, subtree

BENDING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class Wheel:
    """A wheel; positions in the frame of the root link.

    Attributes
    ----------
    steering : str
        Joint that steers it, else empty.
    centre, axis : (3,) float64
        Middle of the wheel [m]; unit vector of its axis, to the left for a straight wheel.
    radius, width : float
        [m]
    ball : bool
        Whether it is a sphere.
    links : tuple of str
        That turn with it.
    """

    joint: str
    steering: str
    centre: FloatArray
    axis: FloatArray
    radius: float
    width: float
    is_caster: bool
    ball: bool
    links: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Support:
    """Something without a motor that touches the ground: centre [m] in the root link, radius, its collision shapes."""

    name: str
    centre: FloatArray
    radius: float
    shapes: tuple[Placed, ...]


@dataclass(frozen=True, eq=False)
class RunningGear:
    """What a robot stands on.

    Attributes
    ----------
    drive : str
        ``differential``, ``skid``, ``ackermann``, ``omni``, ``tracked`` or ``legged``.
    reason : str
        Why this drive.
    wheels : tuple of Wheel
        Without casters, from front left to rear right.
    ground : float
        Height [m] of the ground in the root link.
    """

    drive: DriveName
    reason: str
    wheels: tuple[Wheel, ...]
    supports: tuple[Support, ...]
    ground: float

    @property
    def standing(self) -> tuple[Wheel | Support, ...]:
        """All that touches the ground."""
        return (*self.wheels, *self.supports)

    def body_shapes(self, urdf: Urdf, frames: Mapping[str, FloatArray]) -> list[Placed]:
        """Collision shapes in the root link of all that neither rolls nor slides on the ground."""
        turning = {name for wheel in self.wheels for name in wheel.links}
        sliding = {shape for support in self.supports for shape in support.shapes}
        return [
            shape.within(frames[name])
            for name, link in urdf.links.items()
            if name not in turning
            for shape in link.shapes
            if shape not in sliding
        ]

    @property
    def driven(self) -> tuple[Wheel, ...]:
        """Wheels with a motor: those that are not steered; all of a robot whose wheels are all steered."""
        straight = tuple(wheel for wheel in self.wheels if not wheel.steering)
        return straight or self.wheels

    @property
    def steered(self) -> tuple[Wheel, ...]:
        """One wheel for each steering joint, from front left to rear right."""
        return tuple({wheel.steering: wheel for wheel in self.wheels if wheel.steering}.values())

    def steered_aside(self, track: float) -> float:
        """How far [m] the steered wheels of a car lie from its middle: 0 for a single one."""
        return 0.5 * track if len(self.steered) > 1 else 0.0


def solids_of(urdf: Urdf, frames: Mapping[str, FloatArray], links: Collection[str]) -> list[Placed]:
    """Collision shapes of some links in the root link."""
    return [shape.within(frames[name]) for name in urdf.links if name in links for shape in urdf.links[name].shapes]


def sides_of(wheels: Collection[Wheel]) -> tuple[list[Wheel], list[Wheel]]:
    """Wheels on the left and on the right of the middle of all of them."""
    if not wheels:
        return [], []
    ys = [float(wheel.centre[1]) for wheel in wheels]
    middle = 0.5 * (min(ys) + max(ys))
    apart = [wheel for wheel in wheels if abs(float(wheel.centre[1]) - middle) > 0.1 * wheel.radius]
    lefts = [wheel for wheel in apart if float(wheel.centre[1]) > middle]
    return lefts, [wheel for wheel in apart if float(wheel.centre[1]) < middle]


def note_on_its_side(urdf: Urdf, frames: Mapping[str, FloatArray]) -> str:
    """Say along which axis the legs of a robot hang if it is not -z, else ""; files of computer graphics have y up.

    Legs stand around the body, so the mean of their ends lies below it. Where it lies farther to one side than below,
    the robot lies on that side.

    Parameters
    ----------
    frames : mapping of str to (4, 4) float64
        Links in the root link, all joints at 0.
    """
    parents = {joint.parent for joint in urdf.joints.values()}
    bent = {name for joint in urdf.joints.values() if joint.kind in BENDING for name in subtree(urdf, joint.child)}
    ends = [frames[name][:3, 3] for name in urdf.links if name in bent - parents]
    if not ends:
        return ""
    x, y, z = np.mean(ends, axis=0).tolist()
    axis, aside = ("x", x) if abs(x) > abs(y) else ("y", y)
    if abs(aside) <= max(-z, 0.05):
        return ""
    side, up = ("-", "") if aside < 0.0 else ("+", "-")
    lengths = f"{abs(aside):.2f} m along {side}{axis} of '{urdf.root}' and {max(-z, 0.0):.2f} m below it"
    return f"its legs end {lengths}: it lies on its side. Expected z up (REP 103); in this file {up}{axis} is up"
