"""How far a robot leans: what the control loop watches, and what a simulation measures."""

from __future__ import annotations

import math

from mbf_abstract.geometry import Pose


def tilt_of(pose: Pose) -> float:
    """Angle [rad] between the z axis of a pose and the vertical."""
    x, y, _, _ = pose.orientation
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
