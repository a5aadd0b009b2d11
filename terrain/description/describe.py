"""Describes a robot by its URDF; what the user states goes before what is found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.implausible import implausible_values
from mbf_abstract.geometry import FloatArray
from terrain.description.description import RobotDescription
from terrain.description.masses import mass_of, notes_on_masses, some_of
from terrain.description.mesh_files import find_file, missing_text
from terrain.description.motors import GRAVITY, with_note_on_motors
from terrain.description.outline import Corner, convex_outline, note_on_its_size, surrounds_base, with_few_corners
from terrain.description.parameters import UrdfRobot
from terrain.description.running_gear import RunningGear, note_on_its_side, sides_of, solids_of
from terrain.description.solids import Placed
from terrain.description.stability import Edges, Tipping, clear_angles, seen_from_the_side, tipping
from terrain.description.urdf import Urdf, link_frames, subtree
from terrain.description.urdf_reader import read_urdf
from terrain.description.wheel_search import find_running_gear

UP = np.array([0.0, 0.0, 1.0])
USUAL_SPEED = 1.0  # m/s, where the file states no speed of the wheels
USUAL_YAW_RATE = 1.5  # rad/s
USUAL_STEERING_ANGLE = 0.5  # rad
STEERED = 9  # angles at which a steered wheel is looked at
SCRUB = 0.35  # of (wheelbase / track)^2: what a skid-steered robot of a Husky's wheels loses (see RobotSpec)
DIGITS = 6


def describe(stated: UrdfRobot) -> RobotDescription:
    """Describe a robot.

    Raises
    ------
    ConfigError
        All that is wrong with its file, or contradicts it.
    """
    file = find_file(stated.urdf, Path())
    if file is None:
        raise ConfigError([Finding(stated.urdf, 1, "urdf", "a file", missing_text(stated.urdf, Path()))])
    urdf = read_urdf(file)
    frames = link_frames(urdf)
    gear = find_running_gear(urdf, stated.drive, stated.wheels, stated.wheel_radius)
    return with_note_on_motors(_Describer(urdf, stated, frames, gear, _base(gear)).description())


def _base(gear: RunningGear) -> FloatArray:
    """Where ``base_link`` is in the root link."""
    if not gear.wheels:
        return np.array([0.0, 0.0, gear.ground])
    x, y = (_mean([float(wheel.centre[k]) for wheel in gear.driven]) for k in (0, 1))
    return np.array([round(x, DIGITS), round(y, DIGITS), round(gear.ground, DIGITS)])


class _Describer:
    """Puts a description together; collects notes on the way."""

    def __init__(
        self, urdf: Urdf, stated: UrdfRobot, frames: Mapping[str, FloatArray], gear: RunningGear, base: FloatArray
    ) -> None:
        self.urdf, self.stated, self.frames, self.gear, self.base = urdf, stated, frames, gear, base
        self.notes = [*urdf.notes, *implausible_values(stated), *notes_on_masses(urdf, frames)]
        seen = [name for name, link in urdf.links.items() if link.only_seen]
        if seen:
            self.notes.append(f"{some_of(seen)}: no collision shape, so not part of footprint, height and clearance")

    def description(self) -> RobotDescription:
        stated, gear = self.stated, self.gear
        everything = self._in_base(solids_of(self.urdf, self.frames, self.urdf.links))
        body = self._in_base(gear.body_shapes(self.urdf, self.frames))
        height = max(solid.support(UP) for solid in everything)
        clearance = min((-solid.support(-UP) for solid in body), default=height)
        mass, centre = self._mass()
        radius = _mean([wheel.radius for wheel in gear.driven])
        wheelbase, track = self._wheelbase(), self._track()
        steering = self._steering_angle()
        speed = self._speed(radius)
        standing = gear.drive != "legged"
        if not standing and (aside := note_on_its_side(self.urdf, self.frames)):
            self.notes.append(aside)
        if clearance <= 0.0 and standing:
            self.notes.append("its body touches the ground between the wheels: no ground clearance")
        return RobotDescription(
            urdf=self.urdf,
            stated=stated,
            gear=gear,
            p_root_base=self.base,
            footprint=self._footprint([*everything, *self._in_base(self._steered(wheelbase, track, steering))]),
            height=_rounded(stated.height or height),
            ground_clearance=_rounded(stated.ground_clearance or max(clearance, 0.0)),
            mass=_rounded(mass),
            center_of_mass=centre,
            wheel_radius=_rounded(radius),
            wheelbase=_rounded(wheelbase),
            track=_rounded(track),
            max_speed=_rounded(speed),
            max_yaw_rate=_rounded(self._yaw_rate(speed, wheelbase, steering)),
            max_steering_angle=steering,
            motor_torque=_rounded(self._torque(mass, radius)),
            track_multiplier=_rounded(self._track_multiplier(wheelbase, track)),
            contacts=self._contacts(),
            tipping=self._tipping(centre) if standing else None,
            edges=self._edges(body) if standing else None,
            notes=tuple(self.notes),
        )

    def _in_base(self, solids: list[Placed]) -> list[Placed]:
        T_base_root = np.eye(4)
        T_base_root[:3, 3] = -self.base
        return [solid.within(T_base_root) for solid in solids]

    def _refuse(self, key: str, expected: str, got: str) -> ConfigError:
        return ConfigError([Finding(str(self.urdf.file), 1, key, expected, got)])

    def _mass(self) -> tuple[float, tuple[float, float, float]]:
        found = mass_of(self.urdf, self.frames, self.urdf.links)
        if found.mass <= 0.0 and self.stated.mass is None:
            raise self._refuse("mass", "masses in the links, or mass: in the scenario", "none")
        if found.mass <= 0.0 and self.stated.center_of_mass is None:
            raise self._refuse("center_of_mass", "masses in the links, or center_of_mass: in the scenario", "none")
        x, y, z = (_rounded(value) for value in (found.centre - self.base).tolist())
        if self.stated.center_of_mass is None and z <= 0.0:
            raise self._refuse("center_of_mass", "a centre of mass above the ground", f"{z:g} m")
        return self.stated.mass or found.mass, self.stated.center_of_mass or (x, y, z)

    def _footprint(self, solids: list[Placed]) -> list[Corner]:
        if self.stated.footprint != "auto":
            return list(self.stated.footprint)
        low, high = self.stated.footprint_heights
        # what lies on the ground begins below it by a rounding error
        parts = [solid.points_between(low - 1e-6 if low == 0.0 else low, high) for solid in solids]
        outline = convex_outline(np.concatenate(parts))
        if len(outline) < 3:
            got = "none" if not outline else f"{len(outline)} points"
            raise self._refuse("footprint_heights", f"collision shapes between {low:g} and {high:g} m", got)
        few = [(_rounded(x), _rounded(y)) for x, y in with_few_corners(outline, self.stated.footprint_corners)]
        self.notes += filter(None, [note_on_its_size(few)])
        if not surrounds_base(few):
            self.notes.append("base_link lies outside of its footprint, which a costmap refuses; state footprint")
        return few

    def _steered(self, wheelbase: float, track: float, steering: float) -> list[Placed]:
        """Shapes of steered wheels in the root link, at angles up to that of the inner wheel in the tightest curve."""
        joints = [wheel.steering for wheel in self.gear.steered]
        if not joints or steering == 0.0:
            return []
        links = {link for name in joints for link in subtree(self.urdf, self.urdf.joints[name].child)}
        inner = math.atan2(1.0, 1.0 / math.tan(steering) - self.gear.steered_aside(track) / wheelbase)
        angles = np.linspace(-inner, inner, STEERED).tolist()
        frames = [link_frames(self.urdf, dict.fromkeys(joints, angle)) for angle in angles]
        return [solid for one in frames for solid in solids_of(self.urdf, one, links)]

    def _wheelbase(self) -> float:
        xs = [float(wheel.centre[0]) for wheel in self.gear.wheels]
        found = max(xs) - min(xs) if xs else 0.0
        return self.stated.wheelbase or (found if found > 1e-3 else 0.0)

    def _track(self) -> float:
        lefts, rights = sides_of(self.gear.driven if self.gear.drive == "ackermann" else self.gear.wheels)
        found = _mean([float(w.centre[1]) for w in lefts]) - _mean([float(w.centre[1]) for w in rights])
        return self.stated.track or found

    def _speed(self, radius: float) -> float:
        if self.stated.max_speed is not None:
            return self.stated.max_speed
        limits = self._limits("velocity", [self.urdf.joints[wheel.joint].velocity for wheel in self.gear.driven])
        if limits and radius > 0.0:
            return min(limits) * radius
        cause = "the wheels have no velocity limit" if self.gear.wheels else "joints do not say how fast legs carry it"
        self.notes.append(f"max_speed: {USUAL_SPEED:g} m/s is assumed, because {cause}")
        return USUAL_SPEED

    def _limits(self, name: str, values: list[float | None]) -> list[float]:
        """Limits of the driven wheels that are above 0; many files write 0 where there is none."""
        if 0.0 in values:
            self.notes.append(f"{name}: a limit of 0 of a driven wheel counts as no limit")
        return [value for value in values if value]

    def _yaw_rate(self, speed: float, wheelbase: float, steering: float) -> float:
        if self.stated.max_yaw_rate is not None:
            return self.stated.max_yaw_rate
        if self.gear.drive == "ackermann":
            return speed * math.tan(steering) / wheelbase
        return USUAL_YAW_RATE

    def _steering_angle(self) -> float:
        if self.gear.drive != "ackermann":
            return 0.0
        if self._wheelbase() <= 0.0:
            raise self._refuse("drive", "axles apart from each other, for a car", "one axle")
        joints = [self.urdf.joints[wheel.steering] for wheel in self.gear.steered]
        limits = [min(abs(joint.lower), abs(joint.upper)) for joint in joints]
        wheel = min(limits)
        if math.isinf(wheel) or wheel == 0.0:
            self.notes.append(f"max_steering_angle: {USUAL_STEERING_ANGLE:g} rad is assumed, the joints have no limits")
            return self.stated.max_steering_angle or USUAL_STEERING_ANGLE
        # the inner wheel, which turns farthest, meets its limit first: cot(middle) = cot(inner) + track / (2 wheelbase)
        inner = 1.0 / math.tan(min(wheel, 1.4))
        found = math.atan(1.0 / (inner + self.gear.steered_aside(self._track()) / self._wheelbase()))
        return self.stated.max_steering_angle or _rounded(found)

    def _torque(self, mass: float, radius: float) -> float:
        if self.stated.motor_torque is not None or not self.gear.driven:
            return self.stated.motor_torque or 0.0
        efforts = self._limits("effort", [self.urdf.joints[wheel.joint].effort for wheel in self.gear.driven])
        if efforts:
            return min(efforts)
        found = mass * GRAVITY * radius / len(self.gear.driven)
        self.notes.append(f"motor_torque: {found:.3g} N m is assumed, with which its wheels can lift its weight")
        return found

    def _track_multiplier(self, wheelbase: float, track: float) -> float:
        if self.stated.track_multiplier is not None:
            return self.stated.track_multiplier
        skids = self.gear.drive in ("skid", "tracked") and track > 0.0
        return 1.0 + SCRUB * (wheelbase / track) ** 2 if skids else 1.0

    def _contacts(self) -> FloatArray:
        return np.array([(part.centre - self.base)[:2] for part in self.gear.standing]).reshape(-1, 2)

    def _tipping(self, centre: tuple[float, float, float]) -> Tipping | None:
        found = tipping(self._contacts(), centre)
        if found is None:
            self.notes.append("it stands on one line: it has to balance, and on which slopes it tips over is not known")
        elif found.least <= 0.0:
            self.notes.append("its centre of mass is not above its wheels and casters: it tips over on level ground")
        elif found.least <= (margin := self.stated.tip_over_margin):
            text = f"it tips over at {math.degrees(found.least):.0f} degrees, which is less than tip_over_margin"
            self.notes.append(f"{text}, {math.degrees(margin):.0f} degrees: no slope is planned for in that direction")
        return found

    def _edges(self, body: list[Placed]) -> Edges | None:
        places = sorted((float(part.centre[0] - self.base[0]), part.radius) for part in self.gear.standing)
        if not places or places[-1][0] - places[0][0] < 1e-3:
            return None
        return clear_angles([seen_from_the_side(solid.points()) for solid in body], places[-1], places[0])


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else 0.0


def _rounded(value: float) -> float:
    return round(value, DIGITS) + 0.0  # no -0
