"""Writes the URDF that Bullet loads: the robot as it is described, reduced to one body and its wheels.

The robot's own URDF is not loaded, because what PyBullet makes of it differs from its description: links without an
inertia weigh 1 kg, package:// is not known, the base is wherever the root link is. Here ``base_link`` is on the ground,
all that does not roll or steer is one link, wheels are cylinders about y that turn forward, and casters are balls
without friction. Moments of inertia are those of the file for the body, without its products, and of cylinders for the
wheels.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.description.description import RobotDescription
from terrain.description.masses import MassPoint, mass_of
from terrain.description.running_gear import Wheel
from terrain.description.solids import Box, Cylinder, Placed, Sphere
from terrain.description.urdf import link_frames, subtree

LEAST_SHARE = 0.005  # of the robot's mass, for a wheel: Bullet needs a mass for all that moves


def write_body(robot: RobotDescription, folder: Path, name: str) -> Path:
    """Write ``NAME.urdf`` and the hulls of its meshes into a folder; returns the file."""
    file = folder / f"{name}.urdf"
    file.write_text(_Body(robot, file).text(), "utf-8")
    return file


class _Body:
    def __init__(self, robot: RobotDescription, file: Path) -> None:
        self._robot, self._file = robot, file
        self._frames = link_frames(robot.urdf)
        self._meshes = 0
        gear = robot.gear
        self._rolling = {} if robot.drive in ("omni", "legged") else {wheel.joint: wheel for wheel in gear.wheels}
        found = mass_of(robot.urdf, self._frames, robot.urdf.links).mass
        self._scale = robot.mass / found if found > 0.0 else 0.0

    def text(self) -> str:
        name = quoteattr(self._robot.urdf.name)
        parts = [self._base(), *map(self._wheel, self._rolling.values()), *self._balls()]
        return "\n".join(['<?xml version="1.0"?>', f"<robot name={name}>", *parts, "</robot>\n"])

    def _mass(self, links: set[str], least: float = LEAST_SHARE) -> MassPoint:
        """Mass of some links in base_link, scaled to the stated mass of the whole."""
        found = mass_of(self._robot.urdf, self._frames, links)
        mass = max(self._scale * found.mass, least * self._robot.mass)
        return MassPoint(mass, found.centre - self._robot.p_root_base, self._scale * found.inertia)

    def _base(self) -> str:
        """Everything that does not roll, with the mass that is left; its centre lets the whole have the stated one."""
        robot = self._robot
        moving = {name for wheel in self._rolling.values() for name in self._links_of(wheel)}
        found = self._mass(robot.urdf.links.keys() - moving)
        apart = [(self._mass(set(wheel.links)).mass, self._centre(wheel)) for wheel in self._rolling.values()]
        hinges = [(self._mass(self._hinge(w)).mass, self._centre(w)) for w in self._rolling.values() if w.steering]
        balls = [(LEAST_SHARE * robot.mass, centre) for _, centre, _ in self._ball_places()]
        others = [*apart, *hinges, *balls]
        mass = max(robot.mass - math.fsum(part for part, _ in others), 0.1 * robot.mass)
        moment = robot.mass * np.array(robot.center_of_mass)
        for part, centre in others:
            moment = moment - part * centre
        shapes = self._shapes()
        inertia = np.diagonal(found.inertia).tolist()
        if min(inertia) <= 0.0:
            inertia = _box_inertia(mass, shapes)
        collisions = "".join(self._collision(shape) for shape in shapes)
        return f'  <link name="base_link">{_inertial(mass, moment / mass, inertia)}{collisions}</link>'

    def _shapes(self) -> list[Placed]:
        """Collision shapes in base_link that do not roll."""
        robot = self._robot
        T_base_root = np.eye(4)
        T_base_root[:3, 3] = -robot.p_root_base
        return [shape.within(T_base_root) for shape in robot.gear.body_shapes(robot.urdf, self._frames)]

    def _hinge(self, wheel: Wheel) -> set[str]:
        """Links that steer with a wheel and do not roll."""
        hinge = self._robot.urdf.joints[wheel.steering].child
        return set(subtree(self._robot.urdf, hinge)) - set(wheel.links)

    def _links_of(self, wheel: Wheel) -> set[str]:
        return set(wheel.links) | (self._hinge(wheel) if wheel.steering else set())

    def _centre(self, wheel: Wheel) -> FloatArray:
        return np.asarray(wheel.centre - self._robot.p_root_base)

    def _wheel(self, wheel: Wheel) -> str:
        """A wheel with its joint, and the hinge that steers it."""
        robot = self._robot
        name, mass, at = quoteattr(f"{wheel.joint}_wheel"), self._mass(set(wheel.links)).mass, self._centre(wheel)
        radius, width = wheel.radius, wheel.width
        across = mass * (3.0 * radius * radius + width * width) / 12.0
        inertial = _inertial(mass, np.zeros(3), [across, 0.5 * mass * radius * radius, across])
        shape = f'<cylinder radius="{radius:.9g}" length="{width:.9g}"/>'
        turned = '<origin rpy="1.5707963267948966 0 0"/>'
        if wheel.ball:
            shape, turned = f'<sphere radius="{radius:.9g}"/>', ""
        text = f"  <link name={name}>{inertial}<collision>{turned}<geometry>{shape}</geometry></collision></link>\n"
        parent, offset = '"base_link"', at
        if wheel.steering:
            joint = robot.urdf.joints[wheel.steering]
            place = self._frames[joint.child][:3, 3] - robot.p_root_base
            place = np.array([place[0], place[1], at[2]])
            parent, offset = quoteattr(f"{wheel.steering}_hinge"), at - place
            hinge = self._mass(self._hinge(wheel)).mass
            moments = [0.4 * hinge * radius * radius] * 3
            text += f"  <link name={parent}>{_inertial(hinge, np.zeros(3), moments)}</link>\n"
            limit = '<limit lower="-1.5" upper="1.5" effort="1000" velocity="100"/>'
            text += _joint(wheel.steering, "revolute", '"base_link"', parent, place, f'<axis xyz="0 0 1"/>{limit}')
        return text + _joint(wheel.joint, "continuous", parent, name, offset, '<axis xyz="0 1 0"/>')

    def _ball_places(self) -> list[tuple[str, FloatArray, float]]:
        """Name, centre in base_link and radius of what slides on the ground: casters, and wheels of an omni robot."""
        robot = self._robot
        sliding = robot.gear.standing if robot.drive == "omni" else robot.gear.supports
        return [
            (part.joint if isinstance(part, Wheel) else part.name, part.centre - robot.p_root_base, part.radius)
            for part in sliding
        ]

    def _balls(self) -> list[str]:
        texts = []
        for number, (part, centre, radius) in enumerate(self._ball_places()):
            name, mass = quoteattr(f"ball_{number}"), LEAST_SHARE * self._robot.mass
            moments = [0.4 * mass * radius * radius] * 3
            shape = f'<collision><geometry><sphere radius="{radius:.9g}"/></geometry></collision>'
            link = f"  <link name={name}>{_inertial(mass, np.zeros(3), moments)}{shape}</link>\n"
            texts.append(link + _joint(f"{part}_caster_mount", "fixed", '"base_link"', name, centre, ""))
        return texts

    def _collision(self, placed: Placed) -> str:
        solid = placed.solid
        if isinstance(solid, Box):
            shape = f'<box size="{_numbers(np.array(solid.size))}"/>'
        elif isinstance(solid, Cylinder):
            shape = f'<cylinder radius="{solid.radius:.9g}" length="{solid.length:.9g}"/>'
        elif isinstance(solid, Sphere):
            shape = f'<sphere radius="{solid.radius:.9g}"/>'
        else:
            mesh = self._file.with_name(f"{self._file.stem}_{self._meshes}.obj")
            self._meshes += 1
            with mesh.open("w", encoding="ascii") as file:
                np.savetxt(file, solid.vertices, fmt="v %.9g %.9g %.9g")
                np.savetxt(file, solid.faces + 1, fmt="f %d %d %d")
            shape = f"<mesh filename={quoteattr(mesh.name)}/>"
        rpy = _roll_pitch_yaw(placed.T_frame_solid)
        origin = f'<origin xyz="{_numbers(placed.T_frame_solid[:3, 3])}" rpy="{_numbers(np.array(rpy))}"/>'
        return f"\n    <collision>{origin}<geometry>{shape}</geometry></collision>"


def _joint(name: str, kind: str, parent: str, child: str, at: FloatArray, inside: str) -> str:
    return (
        f'  <joint name={quoteattr(name)} type="{kind}"><parent link={parent}/><child link={child}/>'
        f'<origin xyz="{_numbers(at)}"/>{inside}</joint>\n'
    )


def _inertial(mass: float, centre: FloatArray, moments: list[float]) -> str:
    ixx, iyy, izz = moments
    inertia = f'<inertia ixx="{ixx:.9g}" iyy="{iyy:.9g}" izz="{izz:.9g}" ixy="0" ixz="0" iyz="0"/>'
    return f'<inertial><origin xyz="{_numbers(centre)}"/><mass value="{mass:.9g}"/>{inertia}</inertial>'


def _box_inertia(mass: float, shapes: list[Placed]) -> list[float]:
    """Moments of a box as large as all shapes, for a body without any."""
    points = np.concatenate([shape.points() for shape in shapes])
    x, y, z = np.ptp(points, axis=0).tolist()
    return [mass * (y * y + z * z) / 12.0, mass * (x * x + z * z) / 12.0, mass * (x * x + y * y) / 12.0]


def _roll_pitch_yaw(T: FloatArray) -> tuple[float, float, float]:
    """Fixed-axis angles [rad] of a transform, the inverse of ``transform_of``."""
    pitch = math.asin(max(-1.0, min(1.0, -float(T[2, 0]))))
    if abs(float(T[2, 0])) > 1.0 - 1e-12:  # roll and yaw turn about the same axis
        return 0.0, pitch, math.atan2(-float(T[0, 1]), float(T[1, 1]))
    return math.atan2(float(T[2, 1]), float(T[2, 2])), pitch, math.atan2(float(T[1, 0]), float(T[0, 0]))


def _numbers(values: FloatArray) -> str:
    return " ".join(f"{value + 0.0:.9g}" for value in values.tolist())
