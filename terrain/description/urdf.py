"""What a URDF describes: links with masses and collision shapes, joints with axes and limits, and where the links are.

``urdf_reader.read_urdf`` makes it from a file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mbf_abstract.config.findings import Finding
from mbf_abstract.geometry import FloatArray
from terrain.description.solids import Placed


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass [kg], where its centre is, and its moments ixx, iyy, izz, ixy, ixz, iyz [kg m2] about that centre."""

    mass: float
    T_link_mass: FloatArray
    moments: tuple[float, float, float, float, float, float]
    line: int


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid part, with its collision shapes in its own frame; ``only_seen`` if it has visuals and no such shape."""

    name: str
    line: int
    inertial: Inertial | None
    shapes: tuple[Placed, ...]
    only_seen: bool = False


@dataclass(frozen=True, eq=False)
class Joint:
    """What connects two links; the axis (3,) is in the joint's frame, of length 1.

    ``lower`` and ``upper`` [rad or m] are infinite, ``effort`` [N m or N] and ``velocity`` [rad/s or m/s] None where
    the file gives none.
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: FloatArray
    axis: FloatArray
    lower: float
    upper: float
    effort: float | None
    velocity: float | None
    line: int
    origin_problem: Finding | None = None


@dataclass(frozen=True, eq=False)
class Urdf:
    """A robot as its file describes it.

    Attributes
    ----------
    links, joints : dict
        By name, in the order of the file.
    root : str
        The link that is no joint's child.
    notes : list of str
        What was left out or assumed.
    """

    file: Path
    name: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    root: str
    notes: list[str] = field(default_factory=list)


def subtree(urdf: Urdf, link: str) -> list[str]:
    """The link and all links below it."""
    found = [link]
    for name in found:
        found += [joint.child for joint in urdf.joints.values() if joint.parent == name]
    return found


def transform_of(xyz: Sequence[float], rpy: Sequence[float]) -> FloatArray:
    """(4, 4) float64 of an origin: fixed-axis roll, pitch, yaw [rad], that is Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, rpy), map(math.sin, rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def link_frames(urdf: Urdf, turned: Mapping[str, float] | None = None) -> dict[str, FloatArray]:
    """Where every link is in the root link, (4, 4), with all joints at zero or at their limit nearest to it.

    But for joints that are ``turned`` [rad], whatever their limits.
    """
    frames = {urdf.root: np.eye(4)}
    for parent in subtree(urdf, urdf.root):
        for joint in urdf.joints.values():
            if joint.parent == parent:
                position = min(max(0.0, joint.lower), joint.upper) if joint.kind != "fixed" else 0.0
                T_joint_child = _moved(joint, (turned or {}).get(joint.name, position))
                T_parent_joint = joint.T_parent_joint
                frames[joint.child] = frames[parent] @ (T_parent_joint @ T_joint_child)
    return frames


def _moved(joint: Joint, position: float) -> FloatArray:
    """Transform (4, 4) of a joint at a position [rad or m] (Rodrigues' formula)."""
    T_joint_child = np.eye(4)
    if position == 0.0 or joint.kind not in ("revolute", "continuous", "prismatic"):
        return T_joint_child
    if joint.kind == "prismatic":
        T_joint_child[:3, 3] = position * joint.axis
        return T_joint_child
    x, y, z = joint.axis.tolist()
    c, s = math.cos(position), math.sin(position)
    v = 1.0 - c
    T_joint_child[:3, :3] = [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
        [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
        [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
    ]
    return T_joint_child
