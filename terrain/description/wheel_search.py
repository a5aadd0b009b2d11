"""Finds what a robot stands and rolls on: wheels, steering joints, casters, and which drive they make.

A wheel is what an endless joint with a level axis turns, round about that axis, and on the ground. It is steered if an
upright joint with limits stands between it and the body, and a caster if that joint turns freely and the wheel
trails behind it. What else touches the ground (a fixed ball) is a support without a motor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding, suggest
from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import rotated
from terrain.description.parameters import DriveName
from terrain.description.running_gear import RunningGear, Support, Wheel, sides_of, solids_of
from terrain.description.solids import Placed, Sphere
from terrain.description.urdf import Joint, Urdf, link_frames, subtree

UP = np.array([0.0, 0.0, 1.0])
LEVEL = 0.17  # sine of the greatest angle between a wheel's axis and the ground: 10 degrees
ROUND = 0.15  # greatest difference of a wheel's diameters, as a share
ON_GROUND = 0.25  # a wheel's lowest point lies at most this share of its radius above the ground
TRAIL = 0.25  # a caster's wheel lies farther than this share of its radius from its upright axis
ENDLESS = 4.0 * math.pi  # rad; a revolute joint with a greater range turns a wheel
SIDEWAYS = 0.97  # cosine of the greatest angle between the axis of a straight wheel and y: 14 degrees
ROLLERS = ("mecanum", "omni", "holonomic")  # in the name of a wheel that also rolls sideways
MANY_JOINTS = 8  # that bend, of a robot on legs, at least


def find_running_gear(
    urdf: Urdf, drive: DriveName | None, named: tuple[str, ...], radius: float | None = None
) -> RunningGear:
    """Find wheels and drive of a robot.

    Parameters
    ----------
    drive : str or None
        The drive where the user states it.
    named : tuple of str
        Joints of the driven and steered wheels where the user names them, else empty.
    radius : float or None
        Radius [m] of the wheels where the user states it; the ground is then this far below their axles.

    Raises
    ------
    ConfigError
        No wheels or no shapes are found, or a named joint is no wheel.
    """
    frames = link_frames(urdf)
    everything = solids_of(urdf, frames, urdf.links)
    if not everything:
        text = "collision shapes, from which footprint and wheels are found"
        raise ConfigError([Finding(str(urdf.file), 1, "", text, "none")])
    lowest = -max(solid.support(-UP) for solid in everything)
    if drive == "legged":
        return RunningGear("legged", "as stated", (), (), lowest)
    rolling = [wheel for joint in urdf.joints.values() if (wheel := _wheel(urdf, frames, joint, named)) is not None]
    if named:
        _refuse_unknown(urdf, named, rolling)
        rolling = [wheel for wheel in rolling if wheel.joint in named or wheel.is_caster]
    bottoms = [float(wheel.centre[2]) - wheel.radius for wheel in rolling]
    ground = min(bottoms, default=lowest)
    near = [w for w, bottom in zip(rolling, bottoms, strict=True) if w.joint in named or _touches(w, bottom - ground)]
    wheels = sorted((wheel for wheel in near if not wheel.is_caster), key=_from_front_left)
    casters = tuple(_caster(urdf, wheel) for wheel in near if wheel.is_caster)
    supports = casters + _fixed_supports(urdf, frames, wheels, casters, ground)
    if radius is not None and wheels:  # what touches the ground is found from the shapes all the same
        wheels = [replace(wheel, radius=radius) for wheel in wheels]
        ground = min(float(wheel.centre[2]) - radius for wheel in wheels)
    if drive is None:
        drive, reason = _guess(urdf, wheels)
    else:
        reason = "as stated"
    if drive != "omni":
        _refuse_sideways(urdf, wheels)
    gear = RunningGear(drive, reason, tuple(wheels), supports, ground)
    if drive not in ("omni", "legged") and not all(sides_of(gear.driven)):
        got = ", ".join(f"{wheel.joint} at y = {float(wheel.centre[1]):.2f} m" for wheel in gear.driven) or "none"
        raise ConfigError([Finding(str(urdf.file), 1, "drive", "driven wheels on the left and on the right", got)])
    if drive == "ackermann":
        _refuse_other_cars(urdf, gear)
    return gear


def _refuse_other_cars(urdf: Urdf, gear: RunningGear) -> None:
    """Raise ConfigError unless one wheel is steered, or two beside each other."""
    places = ", ".join(f"{w.steering} at x = {float(w.centre[0]):.2f} m" for w in gear.steered) or "none"
    xs = [float(wheel.centre[0]) for wheel in gear.steered]
    if len(xs) not in (1, 2) or max(xs) - min(xs) > gear.steered[0].radius:
        expected = "one steered wheel, or two beside each other, for a car"
        raise ConfigError([Finding(str(urdf.file), 1, "drive", expected, places)])


def _caster(urdf: Urdf, wheel: Wheel) -> Support:
    shapes = tuple(shape for name in wheel.links for shape in urdf.links[name].shapes)
    return Support(wheel.joint, wheel.centre, wheel.radius, shapes)


def _touches(wheel: Wheel, gap: float) -> bool:
    return gap <= ON_GROUND * wheel.radius


def _from_front_left(wheel: Wheel) -> tuple[float, float]:
    x, y, _ = wheel.centre.tolist()
    return (-round(x, 3), -round(y, 3))


def _refuse_unknown(urdf: Urdf, named: tuple[str, ...], rolling: list[Wheel]) -> None:
    found = {wheel.joint for wheel in rolling}
    wrong = [name for name in named if name not in found]
    expected = f"a joint that turns a wheel ({', '.join(sorted(found)) or 'none was found'})"
    if wrong:
        raise ConfigError(
            [Finding(str(urdf.file), 1, "wheels", expected, repr(name), suggest(name, urdf.joints)) for name in wrong]
        )


def _wheel(urdf: Urdf, frames: Mapping[str, FloatArray], joint: Joint, named: tuple[str, ...]) -> Wheel | None:
    """The wheel that a joint turns; None if it turns none."""
    endless = joint.kind == "continuous" or (joint.kind == "revolute" and joint.upper - joint.lower > ENDLESS)
    if not endless and joint.name not in named:
        return None
    frame = frames[joint.child]
    axis = rotated(frame[:3, :3], joint.axis)
    links = tuple(subtree(urdf, joint.child))
    shapes = solids_of(urdf, frames, links)
    if abs(float(axis[2])) > LEVEL or not shapes:
        return None
    axis = axis if axis[1] > 0.0 or (axis[1] == 0.0 and axis[0] > 0.0) else -axis
    ahead = np.array([axis[1], -axis[0], 0.0]) / math.hypot(axis[0], axis[1])
    heights, lengths, widths = ((_least(shapes, d), _most(shapes, d)) for d in (UP, ahead, axis))
    height, length = heights[1] - heights[0], lengths[1] - lengths[0]
    if abs(height - length) > ROUND * max(height, length):
        return None
    origin = frame[:3, 3]
    middle = 0.5 * (widths[0] + widths[1]) - float(np.sum(origin * axis))
    steering, free = _upright_joint(urdf, frames, joint)
    centre = origin + middle * axis
    radius = float(origin[2]) - heights[0]
    trail = 0.0 if steering is None else _distance_from_axis(frames[steering.child], centre)
    is_caster = free and trail > TRAIL * radius
    steered_by = "" if steering is None or is_caster else steering.name
    ball = len(shapes) == 1 and isinstance(shapes[0].solid, Sphere)
    return Wheel(joint.name, steered_by, centre, axis, radius, widths[1] - widths[0], is_caster, ball, links)


def _least(shapes: list[Placed], direction: FloatArray) -> float:
    return -max(shape.support(-direction) for shape in shapes)


def _most(shapes: list[Placed], direction: FloatArray) -> float:
    return max(shape.support(direction) for shape in shapes)


def _upright_joint(urdf: Urdf, frames: Mapping[str, FloatArray], wheel: Joint) -> tuple[Joint | None, bool]:
    """The upright joint between a wheel and the body, and whether it turns without limits."""
    movers = {joint.child: joint for joint in urdf.joints.values()}
    link = wheel.parent
    while link in movers:
        joint = movers[link]
        if joint.kind in ("revolute", "continuous"):
            if abs(float(rotated(frames[joint.child][:3, :3], joint.axis)[2])) > 1.0 - LEVEL:
                return joint, joint.kind == "continuous" and math.isinf(joint.upper - joint.lower)
        link = joint.parent
    return None, False


def _distance_from_axis(frame: FloatArray, centre: FloatArray) -> float:
    return math.hypot(float(centre[0] - frame[0, 3]), float(centre[1] - frame[1, 3]))


def _fixed_supports(
    urdf: Urdf, frames: Mapping[str, FloatArray], wheels: list[Wheel], casters: tuple[Support, ...], ground: float
) -> tuple[Support, ...]:
    """Shapes on the ground that no wheel turns: each is a support below its middle."""
    if not wheels:
        return ()
    turning = {name for wheel in wheels for name in wheel.links}
    taken = {shape for caster in casters for shape in caster.shapes}
    radius = max(wheel.radius for wheel in wheels)
    found = []
    for name, link in urdf.links.items():
        for shape in () if name in turning else link.shapes:
            if shape in taken:
                continue
            placed = shape.within(frames[name])
            half = 0.5 * placed.extent(UP)
            if -placed.support(-UP) - ground <= min(ON_GROUND * half, 0.1 * radius):
                centre = np.array([*placed.T_frame_solid[:2, 3], placed.support(UP) - half])
                found.append(Support(name, centre, half, (shape,)))
    return tuple(found)


def _guess(urdf: Urdf, wheels: list[Wheel]) -> tuple[DriveName, str]:
    """The drive that wheels make, and the reason; raises ConfigError where there is none."""
    steered = [wheel for wheel in wheels if wheel.steering]
    straight = [wheel for wheel in wheels if not wheel.steering]
    if not wheels:
        bending = [joint for joint in urdf.joints.values() if joint.kind in ("revolute", "continuous")]
        if len(bending) >= MANY_JOINTS:
            return "legged", f"no wheels, {len(bending)} joints that bend"
        expected = (
            "wheels: continuous joints with a level axis and a round collision shape; else wheels: or drive: legged"
        )
        raise ConfigError([Finding(str(urdf.file), 1, "drive", expected, "none")])
    if steered and not straight:
        return "omni", f"all {len(steered)} wheels are steered"
    if steered:
        return "ackermann", f"{len(steered)} of {len(wheels)} wheels are steered"
    rolling = [wheel.joint for wheel in wheels if _has_rollers(wheel)]
    if rolling:
        return "omni", f"{rolling[0]} has rollers by its name"
    if any(abs(float(np.sum(wheel.axis * wheels[0].axis))) < SIDEWAYS for wheel in wheels):
        return "omni", f"{len(wheels)} wheels whose axes are not parallel"
    lefts, rights = sides_of(straight)
    kind: DriveName = "differential" if len(lefts) == len(rights) == 1 else "skid"
    return kind, f"{len(lefts)} wheels on the left, {len(rights)} on the right, none steered"


def _refuse_sideways(urdf: Urdf, wheels: list[Wheel]) -> None:
    """Raise ConfigError for wheels that do not roll ahead."""
    wrong = [wheel for wheel in wheels if not wheel.steering and abs(float(wheel.axis[1])) < SIDEWAYS]
    expected = "an axis along y of the root link, whose x points ahead (REP 103); or drive: omni"
    if wrong:
        raise ConfigError(
            [
                Finding(str(urdf.file), urdf.joints[wheel.joint].line, f"joint {wheel.joint}: axis", expected, got)
                for wheel in wrong
                for got in [" ".join(f"{part + 0.0:.2g}" for part in np.round(wheel.axis, 3).tolist())]
            ]
        )


def _has_rollers(wheel: Wheel) -> bool:
    names = " ".join((wheel.joint, *wheel.links)).lower()
    return any(word in names for word in ROLLERS)
