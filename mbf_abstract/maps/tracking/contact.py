"""Whether the robot can still stop before it touches something that moves.

The rule is passive motion safety (Macek, Vasquez, Fraichard, Siegwart 2009): a motion is safe if the robot can stand
before any contact. Contacts that happen while it stands are not its fault. So a command is followed for a reaction
time, then the robot brakes (``braking.py``); objects keep their velocities until it stands, or turn now. A turn is
noticed after ``turning_time``; until then the object may be wherever it gets at its pace, the greatest speed of late.
While somebody who moves is nearer than the margin, or touches it, the robot stands.

Who waits may set off, and may have done so at a speed that does not show yet. Where the robot could not stand before
they touch it, it passes them at ``passing_speed``. It does not stop for them, as most stay where they are. Whom it has
lost sight of while they touched it, see ``lost_contacts.py``.

Who comes from behind, hardly faster than the robot drives away, follows it: to brake would bring about the contact that
it is to avoid. So their velocity counts for the ``turning_time`` only, until which they notice what the robot does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.maps.tracking.braking import Decelerations, motions_to_standstill
from mbf_abstract.maps.tracking.contact_parameters import ContactParameters
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

SHARES = (1.0, 0.75, 0.5, 0.25)
"""Shares of a command that are tried, in this order, before the robot stops."""
AWAY = 0.7
"""A robot drives away from somebody where the cosine between its way and that from them to it is at least this."""
FOLLOWING = 0.1
"""Who follows is no faster [m/s] than the robot drives away, but for this: estimates of velocities are not exact."""
SAME_STOREY = 1.0
"""Objects whose ground is farther above or below the robot [m] are on another storey, on a map that knows heights."""


def moving_on_storey(
    objects: Iterable[TrackedObject], z: float, same_storey: float = SAME_STOREY
) -> list[TrackedObject]:
    """Those of the objects that move, less than ``same_storey`` [m] above or below a robot at height ``z`` [m]."""
    return [known for known in objects if known.motion is Motion.MOVING and abs(known.z - z) < same_storey]


def waiting_on_storey(
    objects: Iterable[TrackedObject], z: float, same_storey: float = SAME_STOREY
) -> list[TrackedObject]:
    """Those of the objects that wait and may set off, on the storey of a robot at height ``z`` [m]."""
    waiting = (known for known in objects if known.motion is Motion.WAITING and known.pace > 0.0)
    return [known for known in waiting if abs(known.z - z) < same_storey]


def in_the_way(known: TrackedObject) -> str:
    """Text on an object before which the robot slows down or waits."""
    if known.motion is Motion.WAITING:
        return f"object {known.number} waits beside the way, at ({known.x:.2f}, {known.y:.2f})"
    return f"object {known.number} moves in the way, at ({known.x:.2f}, {known.y:.2f})"


def out_of_sight(known: TrackedObject) -> str:
    """Text on an object that touched the robot, or nearly, when it was last seen."""
    return (
        f"object {known.number} came as near as a contact and is out of sight, last at ({known.x:.2f}, {known.y:.2f})"
    )


def safe_share(
    box: RobotBox,
    pose: Pose,
    velocity: Twist,
    command: Twist,
    objects: Sequence[TrackedObject],
    limits: ContactParameters,
    same_storey: float = SAME_STOREY,
) -> tuple[float, TrackedObject | None]:
    """Largest share of a command with which the robot can stand before any contact, and what it would touch.

    Parameters
    ----------
    pose : Pose
        Of the robot, in the frame of the objects.
    velocity : Twist
        Measured.
    command : Twist
        What it is about to follow.
    objects : sequence of TrackedObject
        Those that move or wait on the robot's storey count; all are of the same moment.
    same_storey : float
        What is farther above or below [m] is on another storey.

    Returns
    -------
    share : float
        One of ``SHARES``, 0, or that of the ``passing_speed``.
    touched : TrackedObject or None
        What the robot would touch first with the whole command; None where the share is 1.
    """
    if command.is_stopped(1e-9, 1e-9):
        return 1.0, None
    moving = moving_on_storey(objects, pose.z, same_storey)
    share, touched = _share_before(moving, box, pose, velocity, command, limits)
    waiting = waiting_on_storey(objects, pose.z, same_storey)
    if not waiting or share * command.speed <= limits.passing_speed:
        return share, touched
    shares = [one for one in SHARES if limits.passing_speed / command.speed < one <= share]
    for share in [*shares, limits.passing_speed / command.speed]:
        found = _first_reached(box, pose, velocity, command, share, waiting, limits)
        if found is None:
            break
        touched = touched or found
    return share, touched


def _share_before(
    moving: Sequence[TrackedObject],
    box: RobotBox,
    pose: Pose,
    velocity: Twist,
    command: Twist,
    limits: ContactParameters,
) -> tuple[float, TrackedObject | None]:
    """Largest share with which the robot can stand before any contact with those who move, and what it would touch."""
    if not moving:
        return 1.0, None
    touched = None
    apart = _gaps_now(box, pose, moving) > limits.contact_margin
    for share in SHARES:
        left = apart & [is_left_behind(known, pose, velocity, command, share) for known in moving]
        found = _first_contact(box, pose, velocity, command, share, moving, left, limits)
        if found is None:
            return share, touched
        touched = touched or found
    return 0.0, touched


def _gaps_now(box: RobotBox, pose: Pose, objects: Sequence[TrackedObject]) -> FloatArray:
    """Gaps (n,) [m] between the robot and objects."""
    places = np.array([[(known.x, known.y) for known in objects]])
    radii = np.array([known.radius for known in objects])
    return np.asarray(box.gaps(np.array([(pose.x, pose.y, pose.yaw)]), places, radii)[0])


def is_left_behind(known: TrackedObject, pose: Pose, velocity: Twist, command: Twist, share: float = 1.0) -> bool:
    """Whether a robot that follows a share of a command drives away from an object, which is hardly faster.

    Parameters
    ----------
    pose, velocity, command
        As in ``safe_share``.
    """
    x, y = pose.x - known.x, pose.y - known.y
    distance = math.hypot(x, y)
    if distance == 0.0:
        return False
    asked, now = (_speed_along(twist, pose.yaw, x / distance, y / distance) for twist in (command, velocity))
    if asked <= 0.0 or asked < AWAY * command.speed:
        return False
    return (known.vx * x + known.vy * y) / distance <= min(share * asked, now) + FOLLOWING


def _speed_along(twist: Twist, yaw: float, x: float, y: float) -> float:
    """Component [m/s] of a robot's motion at a heading [rad] along a unit vector."""
    c, s = math.cos(yaw), math.sin(yaw)
    return (c * twist.vx - s * twist.vy) * x + (s * twist.vx + c * twist.vy) * y


def _first_contact(
    box: RobotBox,
    pose: Pose,
    velocity: Twist,
    command: Twist,
    share: float,
    objects: Sequence[TrackedObject],
    left: NDArray[np.bool_],
    limits: ContactParameters,
) -> TrackedObject | None:
    """What the robot would touch before it stands, on the first of its motions on which it touches something.

    Those that are ``left`` (n,) behind keep their speeds for the turning time only, whichever way they go.
    """
    middles = np.array([(known.x, known.y) for known in objects])
    velocities = np.array([(known.vx, known.vy) for known in objects])
    speeds = np.array([known.speed for known in objects])
    paces = np.where(left, speeds, np.maximum([known.pace for known in objects], speeds))
    radii = np.array([known.radius for known in objects]) + np.where(left, 0.0, limits.contact_margin)
    braking = Decelerations(limits.decel_lim_x, limits.decel_lim_theta, limits.reaction_time)
    for times, poses in motions_to_standstill(pose, velocity, command, share, braking):
        places = middles[None] + times[:, None, None] * velocities[None]
        contact = (box.gaps(poses, places, radii) < 0.0) & ~left
        if limits.turning_time > 0.0:
            ways = np.minimum(times, limits.turning_time)[:, None] * paces
            contact |= box.gaps(poses, np.broadcast_to(middles, places.shape), radii + ways) < 0.0
        if contact.any():
            return objects[int(np.argmax(contact[int(np.argmax(contact.any(axis=1)))]))]
    return None


def _first_reached(
    box: RobotBox,
    pose: Pose,
    velocity: Twist,
    command: Twist,
    share: float,
    waiting: Sequence[TrackedObject],
    limits: ContactParameters,
) -> TrackedObject | None:
    """Who might come within the margin before the robot stands if they set off now, at their pace in any direction.

    With the margin the disc over their longer side holds what they sweep if they first turn on the spot, as their
    measured outline would not (decision 0124).
    """
    middles = np.array([(known.x, known.y) for known in waiting])
    radii = np.array([known.radius for known in waiting]) + limits.contact_margin
    paces = np.array([known.pace for known in waiting])
    braking = Decelerations(limits.decel_lim_x, limits.decel_lim_theta, limits.reaction_time)
    for times, poses in motions_to_standstill(pose, velocity, command, share, braking):
        places = np.broadcast_to(middles, (len(times), *middles.shape))
        reached = box.gaps(poses, places, radii + times[:, None] * paces) < 0.0
        if reached.any():
            return waiting[int(np.argmax(reached[int(np.argmax(reached.any(axis=1)))]))]
    return None
