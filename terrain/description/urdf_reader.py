"""Reads a URDF: all mistakes at once, each with its line.

Of the format (http://wiki.ros.org/urdf/XML) it reads what navigation needs; visuals, materials, sensors and
transmissions are skipped, xacro must have been expanded. ``mimic`` and ``safety_controller`` are ignored.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding, suggest
from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm
from terrain.description.mesh_files import read_hull
from terrain.description.solids import Box, Cylinder, Placed, Solid, Sphere, unit
from terrain.description.urdf import Inertial, Joint, Link, Urdf, subtree, transform_of
from terrain.description.xml_source import Element, read_xml, refuse_xacro

JOINT_TYPES = ("fixed", "revolute", "continuous", "prismatic", "planar", "floating")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
LARGEST = 1e6  # m, kg, ...: a greater number is a mistake


def read_urdf(file: Path) -> Urdf:
    """Read a URDF file.

    Raises
    ------
    ConfigError
        All that is wrong with it.
    """
    root = read_xml(file)
    if root.tag != "robot":
        raise ConfigError([Finding(str(file), root.line, "", "the element <robot>", f"<{root.tag}>")])
    refuse_xacro(root, file)
    reader = _Reader(file)
    links = {link.name: link for link in map(reader.link, reader.named(root, "link"))}
    joints = {joint.name: joint for joint in map(reader.joint, reader.named(root, "joint"))}
    base = reader.base_of(root, links, joints)
    if reader.findings:
        raise ConfigError(reader.findings)
    urdf = Urdf(file, root.attributes.get("name", file.stem), links, joints, base)
    _judge_origins(urdf)
    return urdf


def _judge_origins(urdf: Urdf) -> None:
    """An origin that cannot be read is a mistake if a mass or a shape hangs on it, else a note."""
    serious = []
    for joint in urdf.joints.values():
        if joint.origin_problem is None:
            continue
        below = [urdf.links[name] for name in subtree(urdf, joint.child)]
        if any(link.shapes or link.inertial for link in below):
            serious.append(joint.origin_problem)
        else:
            urdf.notes.append(f"{joint.name}: its origin cannot be read and counts as zero; nothing solid hangs on it")
    if serious:
        raise ConfigError(serious)


class _Reader:
    """Turns elements into values, and collects what is wrong with them."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.findings: list[Finding] = []

    def refuse(self, element: Element, key: str, expected: str, got: str, hint: str = "") -> None:
        self.findings.append(Finding(str(self.file), element.line, key, expected, got, hint))

    def named(self, root: Element, tag: str) -> list[Element]:
        """Elements of a kind that have a name of their own."""
        kept: dict[str, Element] = {}
        for element in root.all(tag):
            name = element.attributes.get("name", "")
            if not name or name in kept:
                got = f"{name!r} twice" if name else "none"
                self.refuse(element, tag, "a name of its own", got)
            else:
                kept[name] = element
        return list(kept.values())

    def link(self, element: Element) -> Link:
        name = element.attributes["name"]
        key = f"link {name}"
        shapes = [self._shape(child, key) for child in element.all("collision")]
        inertial = element.first("inertial")
        read = None if inertial is None else self._inertial(inertial, key)
        only_seen = not shapes and element.first("visual") is not None
        return Link(name, element.line, read, tuple(shape for shape in shapes if shape is not None), only_seen)

    def joint(self, element: Element) -> Joint:
        name, kind = element.attributes["name"], element.attributes.get("type", "")
        key = f"joint {name}"
        if kind not in JOINT_TYPES:
            hint = suggest(kind, JOINT_TYPES)
            self.refuse(element, f"{key}: type", f"one of {', '.join(JOINT_TYPES)}", repr(kind), hint)
        ends = [self._end(element, tag, key) for tag in ("parent", "child")]
        limit = element.first("limit")
        if limit is None and kind in ("revolute", "prismatic"):
            self.refuse(element, f"{key}: limit", "an element <limit>", "none")
        known = {} if limit is None else {name: self._limit(limit, name, key) for name in limit.attributes}
        lower, upper = known.get("lower"), known.get("upper")
        if kind in ("revolute", "prismatic"):
            lower, upper = lower or 0.0, upper or 0.0
        if limit is not None and lower is not None and upper is not None and lower > upper:
            self.refuse(limit, f"{key}: limit", "lower <= upper", f"lower {lower:g}, upper {upper:g}")
        before = len(self.findings)
        transform = self._origin(element, key)
        origin_problems = self.findings[before:]
        del self.findings[before:]
        return Joint(
            name=name,
            kind=kind,
            parent=ends[0],
            child=ends[1],
            T_parent_joint=transform,
            axis=self._axis(element, key),
            lower=-math.inf if lower is None else lower,
            upper=math.inf if upper is None else upper,
            effort=known.get("effort"),
            velocity=known.get("velocity"),
            line=element.line,
            origin_problem=next(iter(origin_problems), None),
        )

    def base_of(self, root: Element, links: dict[str, Link], joints: dict[str, Joint]) -> str:
        """The link that hangs on no joint; all others must hang on one each, and none on itself."""
        parents: dict[str, str] = {}
        for joint in joints.values():
            place = Element("joint", {}, joint.line)
            for end in (joint.parent, joint.child):
                if end and end not in links:
                    self.refuse(place, f"joint {joint.name}", "a link of this file", repr(end), suggest(end, links))
            if joint.child in parents:
                self.refuse(place, f"joint {joint.name}: child", "a link that no other joint moves", repr(joint.child))
            parents[joint.child] = joint.parent
        bases = [name for name in links if name not in parents]
        if not links:
            self.refuse(root, "", "at least one <link>", "none")
        elif len(bases) != 1:
            got = ", ".join(map(repr, bases)) or "a cycle of joints"
            self.refuse(root, "", "one link that is not the child of a joint", got)
        elif not self.findings:
            hanging = subtree(Urdf(self.file, "", links, joints, bases[0]), bases[0])
            for name in links.keys() - set(hanging):
                self.refuse(root, f"link {name}", f"a chain of joints to {bases[0]!r}", "a cycle of joints")
        return bases[0] if bases else ""

    def _end(self, element: Element, tag: str, key: str) -> str:
        found = element.first(tag)
        name = "" if found is None else found.attributes.get("link", "")
        if not name:
            self.refuse(found or element, f"{key}: {tag}", 'link="..."', "none")
        return name

    def _limit(self, limit: Element, name: str, key: str) -> float | None:
        value = self.numbers(limit, name, 1, key)
        if value is not None and value[0] < 0.0 and name in ("effort", "velocity"):
            self.refuse(limit, f"{key}: {name}", "a number >= 0", f"{value[0]:g}")
        return None if value is None else value[0]

    def _axis(self, element: Element, key: str) -> FloatArray:
        found = element.first("axis")
        read = None if found is None else self.numbers(found, "xyz", 3, f"{key}: axis")
        axis = np.array([1.0, 0.0, 0.0]) if read is None else np.array(read)
        if found is not None and float(norm(axis)) < 1e-6:
            self.refuse(found, f"{key}: axis", "a direction", "0 0 0")
        return unit(axis)

    def _origin(self, element: Element, key: str) -> FloatArray:
        """The transform of an element's <origin>; none is the identity."""
        found = element.first("origin")
        if found is None:
            return np.eye(4)
        xyz, rpy = (self.numbers(found, name, 3, f"{key}: origin") for name in ("xyz", "rpy"))
        return transform_of(xyz or (0.0, 0.0, 0.0), rpy or (0.0, 0.0, 0.0))

    def _inertial(self, element: Element, key: str) -> Inertial:
        mass, inertia = element.first("mass"), element.first("inertia")
        read = None if mass is None else self.numbers(mass, "value", 1, f"{key}: mass")
        if mass is None:
            self.refuse(element, f"{key}: inertial", "an element <mass>", "none")
        if read is not None and mass is not None and read[0] < 0.0:
            self.refuse(mass, f"{key}: mass", "a number >= 0 kg", f"{read[0]:g}")
        named = {} if inertia is None else inertia.attributes
        values = [self.numbers(inertia, name, 1, key) if inertia and name in named else None for name in MOMENTS]
        ixx, iyy, izz, ixy, ixz, iyz = (0.0 if value is None else value[0] for value in values)
        if inertia is not None and min(ixx, iyy, izz) < 0.0:
            self.refuse(inertia, f"{key}: inertia", "moments ixx, iyy, izz >= 0 kg m²", f"{min(ixx, iyy, izz):g}")
        transform = self._origin(element, f"{key}: inertial")
        return Inertial(0.0 if read is None else read[0], transform, (ixx, iyy, izz, ixy, ixz, iyz), element.line)

    def _shape(self, element: Element, key: str) -> Placed | None:
        geometry = element.first("geometry")
        children = [] if geometry is None else geometry.children
        if len(children) != 1 or children[0].tag not in ("box", "cylinder", "sphere", "mesh"):
            got = ", ".join(f"<{child.tag}>" for child in children) or "none"
            self.refuse(geometry or element, f"{key}: geometry", "one box, cylinder, sphere or mesh", got)
            return None
        solid = self._solid(children[0], f"{key}: {children[0].tag}")
        transform = self._origin(element, f"{key}: collision")
        return None if solid is None else Placed(solid, transform)

    def _solid(self, element: Element, key: str) -> Solid | None:
        if element.tag == "mesh":
            return self._mesh(element, key)
        names = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}[element.tag]
        values = [self.numbers(element, name, 3 if name == "size" else 1, key, least=0.0) for name in names]
        if any(value is None for value in values):
            return None
        flat = [number for value in values if value is not None for number in value]
        if element.tag == "box":
            return Box((flat[0], flat[1], flat[2]))
        return Cylinder(*flat) if element.tag == "cylinder" else Sphere(*flat)

    def _mesh(self, element: Element, key: str) -> Solid | None:
        scale = self.numbers(element, "scale", 3, key) if "scale" in element.attributes else (1.0, 1.0, 1.0)
        if scale is None:
            return None
        hull = read_hull(element.attributes.get("filename", ""), self.file, np.array(scale))
        if isinstance(hull, tuple):
            self.refuse(element, key, *hull)
            return None
        return hull

    def numbers(
        self, element: Element, name: str, count: int, key: str, least: float | None = None
    ) -> tuple[float, ...] | None:
        """Numbers of an attribute; None if it is missing or wrong, which for an origin means zero."""
        text, wanted = element.attributes.get(name), "a finite number" if count == 1 else f"{count} finite numbers"
        if text is None:
            if name not in ("rpy", "xyz"):
                self.refuse(element, f"{key}: {name}", wanted, "nothing")
            return None
        try:
            values = tuple(map(float, text.split()))
        except ValueError:
            values = ()
        sound = len(values) == count and all(abs(value) <= LARGEST for value in values)  # also refuses nan
        if not sound or (least is not None and min(values) <= least):
            bound = f" above {least:g}" if least is not None else ""
            bound += f" and not beyond {LARGEST:g}" if any(LARGEST < abs(value) < math.inf for value in values) else ""
            self.refuse(element, f"{key}: {name}", f"{wanted}{bound}", repr(text[:60]))
            return None
        return values
