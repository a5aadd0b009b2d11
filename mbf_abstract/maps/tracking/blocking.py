"""What blocks a path: objects that stand on it, or will come onto it in the next seconds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FloatArray, Path
from mbf_abstract.maps.tracking.contact import SAME_STOREY
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

STEP = 0.2
"""Time [s] between two looks at where a moving object will be."""
CHORD = 0.3
"""Over so much of a path [m] the way that it leads is looked at."""
ALONG = 0.7
"""From this cosine on between the path and its way somebody goes along the path."""


@dataclass(frozen=True)
class Blockage:
    """One object on a path.

    Attributes
    ----------
    by : TrackedObject
        Its ``motion`` says what to do: wait for what moves, yield to what waits, plan around what is parked.
    pose : int
        Index of the first pose of the path at which the robot would touch it.
    distance : float
        Length [m] of the path up to there.
    along : float
        Cosine of the angle between the path there and the way the object was seen to come last: 1 = it goes where the
        robot goes, -1 = it comes along the path; 0 also where it was never seen to move.
    ahead : float
        How far [m] its middle is ahead of the first pose, the way that the path leads there; negative = the robot is
        getting past it.
    """

    by: TrackedObject
    pose: int
    distance: float
    along: float = 0.0
    ahead: float = 0.0


def blockages(
    box: RobotBox, path: Path, objects: Iterable[TrackedObject], within_time: float, same_storey: float = SAME_STOREY
) -> tuple[Blockage, ...]:
    """Objects that block a path, in the order of their places along it.

    Who comes from behind the first pose, the way that the path leads, follows the robot, and is not in its way.

    Parameters
    ----------
    path : Path
        In the frame of the objects.
    within_time : float
        How far ahead [s] the places of moving objects count; 0 = only where they are now.
    same_storey : float
        Poses farther above or below an object [m] are on another storey.
    """
    poses = path.planar_poses
    heights = path.positions[:, 2]
    found = []
    for known in objects:
        if _follows(known, poses):
            continue
        ahead = within_time if known.motion is Motion.MOVING else 0.0
        times = np.linspace(0.0, ahead, math.ceil(ahead / STEP) + 1)
        places = np.column_stack(known.position_in(times))
        on_each = np.broadcast_to(places, (len(poses), *places.shape))
        gaps = box.gaps(poses, on_each, np.full(len(times), known.radius))
        touches = (gaps < 0.0).any(axis=1) & (np.abs(heights - known.z) < same_storey)
        if touches.any():
            pose = int(np.argmax(touches))
            distance = path.length - float(path.remaining_lengths[pose])
            found.append(Blockage(known, pose, distance, _along(known, poses, pose), _ahead(known, poses)))
    return tuple(sorted(found, key=lambda blockage: (blockage.pose, blockage.by.number)))


def _ahead(known: TrackedObject, poses: FloatArray) -> float:
    """How far [m] an object is ahead of the first of the poses (n, 3), the way that they lead; negative = behind."""
    far = np.hypot(poses[:, 0] - poses[0, 0], poses[:, 1] - poses[0, 1]) >= CHORD
    dx, dy = (poses[int(np.argmax(far)) if far.any() else -1, :2] - poses[0, :2]).tolist()
    length = math.hypot(dx, dy)
    x, y = known.x - float(poses[0, 0]), known.y - float(poses[0, 1])
    return (dx * x + dy * y) / length if length > 0.0 else math.hypot(x, y)


def _follows(known: TrackedObject, poses: FloatArray) -> bool:
    """Whether an object moves, is behind the first of the poses (n, 3), and goes where the path goes there."""
    moves = known.motion is Motion.MOVING and len(poses) > 0
    return moves and _ahead(known, poses) < 0.0 and _along(known, poses, 0) >= ALONG


def _along(known: TrackedObject, poses: FloatArray, pose: int) -> float:
    """Cosine between the course of an object and the path at one of its ``poses`` (n, 3)."""
    dx, dy = (poses[min(pose + 1, len(poses) - 1), :2] - poses[max(pose - 1, 0), :2]).tolist()
    x, y = known.course
    length = math.hypot(dx, dy) * math.hypot(x, y)
    return (dx * x + dy * y) / length if length > 0.0 else 0.0
