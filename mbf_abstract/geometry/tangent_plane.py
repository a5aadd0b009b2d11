"""Distances and headings in the plane the robot stands on: a goal need not know the height and slope of the ground."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arcs import in_robot_frame
from mbf_abstract.geometry.arithmetic import rotated_back
from mbf_abstract.geometry.pose import Pose

SAME_STOREY = 0.5
"""A goal at most so far [m] above or below the robot's tangent plane is on the robot's storey."""


def heading_error(pose: Pose, other: Pose) -> float:
    """Angle [rad] in (-pi, pi] the robot has to turn left, about its own z axis, to look where ``other`` looks."""
    ahead = rotated_back(pose.rotation, other.rotation[:, 0])
    return math.atan2(ahead[1], ahead[0])


def ground_distance(pose: Pose, goal: Pose, same_storey: float = SAME_STOREY) -> float:
    """Distance [m] to the goal in the robot's tangent plane.

    A goal given a little above or below the ground, and a robot frame above it, do not count; a goal more than
    ``same_storey`` [m] off the plane is on another storey, then the distance is Euclidean.
    """
    x, y, z = in_robot_frame(pose, np.asarray(goal.position))
    return math.hypot(x, y) if abs(z) <= same_storey else math.hypot(x, y, z)


def storey_gap(pose: Pose, place: NDArray[np.float64], same_storey: float = SAME_STOREY) -> float:
    """Height [m] of a place (3,) [m] above the robot's tangent plane, negative below it; 0 on the robot's storey."""
    z = float(in_robot_frame(pose, place)[2])
    return z if abs(z) > same_storey else 0.0


def at_height_of(pose: Pose, goal: Pose, same_storey: float = SAME_STOREY) -> Pose:
    """The pose, moved along its own z axis until the goal lies in its tangent plane; as it is on another storey."""
    z = float(in_robot_frame(pose, np.asarray(goal.position))[2])
    if abs(z) > same_storey:
        return pose
    ax, ay, az = (float(component) for component in pose.rotation[:, 2])
    px, py, pz = pose.position
    return replace(pose, position=(px + z * ax, py + z * ay, pz + z * az))
