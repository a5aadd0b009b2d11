"""Masses of a robot: their sum and centre, and whether the moments of inertia can be those of a body at all."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm, rotated
from terrain.description.running_gear import solids_of
from terrain.description.urdf import Inertial, Urdf

LISTED = 3  # names in a note
TOLERANCE = 1e-3  # of a moment, as a share of their sum: files are rounded


@dataclass(frozen=True, eq=False)
class MassPoint:
    """Mass [kg] of some links, its centre (3,) [m], and its inertia (3, 3) [kg m2] about that centre."""

    mass: float
    centre: FloatArray
    inertia: FloatArray


def mass_of(urdf: Urdf, frames: Mapping[str, FloatArray], links: Collection[str]) -> MassPoint:
    """Sum up the masses of some links, in the root link (parallel axis theorem)."""
    parts = [
        (inertial, T_root_link @ inertial.T_link_mass)
        for name, T_root_link in frames.items()
        if name in links and (inertial := urdf.links[name].inertial) is not None
    ]
    total = math.fsum(inertial.mass for inertial, _ in parts)
    if total <= 0.0:
        return MassPoint(0.0, np.zeros(3), np.zeros((3, 3)))
    centre = np.zeros(3)
    for inertial, frame in parts:
        centre = centre + (inertial.mass / total) * frame[:3, 3]
    inertia = np.zeros((3, 3))
    for inertial, frame in parts:
        rotation = frame[:3, :3]
        offset = frame[:3, 3] - centre
        square = float(norm(offset)) ** 2
        inertia = inertia + rotated(rotation, rotated(rotation, inertia_matrix(inertial)).T)  # R I R^T
        inertia = inertia + inertial.mass * (square * np.eye(3) - offset[:, None] * offset[None, :])
    return MassPoint(total, centre, inertia)


def inertia_matrix(inertial: Inertial) -> FloatArray:
    """(3, 3) float64 [kg m2]."""
    ixx, iyy, izz, ixy, ixz, iyz = inertial.moments
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def is_possible_inertia(inertial: Inertial) -> bool:
    """Whether any distribution of mass has these moments.

    That is so if the matrix of second moments, half the trace times the identity less the inertia, has no negative
    eigenvalue (Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3(1), 2018), which is so if no principal
    minor is negative.
    """
    ixx, iyy, izz, ixy, ixz, iyz = inertial.moments
    half = 0.5 * (ixx + iyy + izz)
    if half < 0.0:
        return False
    slack = TOLERANCE * half
    a, b, c = half - ixx + slack, half - iyy + slack, half - izz + slack
    minors = (a, b, c, a * b - ixy * ixy, a * c - ixz * ixz, b * c - iyz * iyz)
    determinant = a * (b * c - iyz * iyz) - ixy * (ixy * c + iyz * ixz) - ixz * (ixy * iyz + b * ixz)
    return min(*minors, determinant) >= 0.0


def gyration_radius(inertial: Inertial) -> float:
    """Root mean square distance [m] of the mass from its centre."""
    half = 0.5 * sum(inertial.moments[:3])
    return math.sqrt(max(0.0, half) / inertial.mass) if inertial.mass > 0.0 else 0.0


def notes_on_masses(urdf: Urdf, frames: Mapping[str, FloatArray]) -> list[str]:
    """What is odd about the masses, though the file can be used; one line for each kind."""
    odd: dict[str, list[str]] = {}
    for name, link in urdf.links.items():
        if link.inertial is None or link.inertial.mass == 0.0:
            if link.shapes:
                odd.setdefault("a shape without a mass, which counts as weightless", []).append(name)
            continue
        size = sum(float(norm(np.ptp(solid.points(), axis=0))) for solid in solids_of(urdf, frames, [name]))
        radius = gyration_radius(link.inertial)
        where = f"{name} (line {link.inertial.line})"
        if not is_possible_inertia(link.inertial):
            odd.setdefault("moments of inertia that no body has", []).append(where)
        elif size > 0.0 and radius > size:
            text = "the inertia of a much larger body than its shape (is its unit kg m²?)"
            odd.setdefault(text, []).append(f"{where[:-1]}: {2.0 * radius:.2g} m, its shape {size:.2g} m)")
        elif radius == 0.0:
            odd.setdefault("no inertia, so it counts as a point", []).append(where)
    return [f"{some_of(names)}: {text}" for text, names in odd.items()]


def some_of(names: list[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")
