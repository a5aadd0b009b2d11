"""Poses, paths, velocities and transforms as messages of geometry_msgs, nav_msgs and tf2_msgs.

Frames lose a leading slash, which ROS 1 clients send; an empty frame is the global one. ROS time counts from 1970, our
clocks from their start: a ``MessageContext`` takes one to the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Path, Pose, Quaternion, Twist, Vector3
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_ros.messages.interfaces import Message, MessageError

NANOSECONDS = 1_000_000_000
NO_COVARIANCE = np.zeros(36)
SAID_POSITION, SAID_YAW = 0.5, math.radians(15.0)
"""Standard deviations [m, rad] of where somebody says that a robot is; those of the tools of RViz."""


class InvalidValueError(MessageError):
    """A message of the right type whose numbers mean nothing, such as a pose with NaN or a quaternion of zeros."""


@dataclass(frozen=True)
class MessageContext:
    """How stamps and frames of messages relate to ours.

    Attributes
    ----------
    global_frame : str
        Frame that is meant where a message names none.
    epoch : float
        ROS time [s] at which our clock showed 0.
    """

    global_frame: str = "map"
    epoch: float = 0.0

    def stamp(self, time: Mapping[str, int]) -> float:
        """Return our time [s] of a ROS time; 0 stays 0, which means that the sender gave none."""
        if time["sec"] == 0 and time["nanosec"] == 0:
            return 0.0
        return (time["sec"] - self.epoch) + time["nanosec"] / NANOSECONDS

    def time(self, stamp: float) -> Message:
        """Return the ROS time of our time [s], which counts as 0 where it is not finite."""
        return duration(stamp + self.epoch)

    def frame(self, frame_id: str) -> str:
        """Return our name of a frame."""
        return frame_id.lstrip("/") or self.global_frame

    def header(self, frame_id: str, stamp: float) -> Message:
        """Return a std_msgs/Header."""
        return {"stamp": self.time(stamp), "frame_id": frame_id}


def duration(seconds: float) -> Message:
    """Return a builtin_interfaces/Duration, of 0 where the number [s] is not finite or has no place in one."""
    known = seconds if abs(seconds) < 2**31 - 1 else 0.0
    whole = math.floor(known)
    nanoseconds = round((known - whole) * NANOSECONDS)
    return {"sec": whole + nanoseconds // NANOSECONDS, "nanosec": nanoseconds % NANOSECONDS}


def seconds_of(message: Mapping[str, int]) -> float:
    """Return a builtin_interfaces/Duration in seconds."""
    return message["sec"] + message["nanosec"] / NANOSECONDS


# ------------------------------------------------------------------------------------------------ poses and paths
def vector(values: Sequence[float]) -> Message:
    """Return a Vector3 or a Point."""
    return {"x": float(values[0]), "y": float(values[1]), "z": float(values[2])}


def quaternion(values: Sequence[float]) -> Message:
    """Return a Quaternion of x, y, z, w."""
    return {**vector(values), "w": float(values[3])}


def vector_of(message: Mapping[str, float]) -> Vector3:
    """Return the numbers of a Vector3 or a Point."""
    return (message["x"], message["y"], message["z"])


def quaternion_of(message: Mapping[str, float]) -> Quaternion:
    """Return the numbers of a Quaternion: x, y, z, w."""
    return (message["x"], message["y"], message["z"], message["w"])


def pose(value: Pose) -> Message:
    """Return a geometry_msgs/Pose."""
    return {"position": vector(value.position), "orientation": quaternion(value.orientation)}


def pose_stamped(value: Pose | None, context: MessageContext) -> Message:
    """Return a geometry_msgs/PoseStamped; where there is no pose, one at 0 in no frame."""
    if value is None:
        return {"header": {"stamp": duration(0.0), "frame_id": ""}, "pose": pose(Pose((0.0, 0.0, 0.0)))}
    return {"header": context.header(value.frame_id, value.stamp), "pose": pose(value)}


def pose_of(message: Mapping[str, Any], context: MessageContext, where: str = "pose") -> Pose:
    """Return the pose of a PoseStamped.

    Raises
    ------
    InvalidValueError
        A number is not finite, or the quaternion is no rotation.
    """
    header, body = message["header"], message["pose"]
    place = vector_of(body["position"]), quaternion_of(body["orientation"])
    if not any(place[1]):
        raise InvalidValueError(f"{where}: the quaternion (0, 0, 0, 0) is not a rotation; without a turn w is 1")
    try:
        return Pose(*place, context.frame(header["frame_id"]), context.stamp(header["stamp"]))
    except ValueError as error:
        raise InvalidValueError(f"{where}: {error}") from error


def initial_pose_of(message: Mapping[str, Any], context: MessageContext) -> Pose:
    """Return the pose of a PoseWithCovarianceStamped; raises InvalidValueError as ``pose_of``."""
    return pose_of({"header": message["header"], "pose": message["pose"]["pose"]}, context, "initial pose")


def initial_pose_message(value: Pose, stamp: float, context: MessageContext) -> Message:
    """Return a PoseWithCovarianceStamped of what somebody has said at ``stamp`` [s]."""
    covariance = np.diag([SAID_POSITION**2, SAID_POSITION**2, 0.0, 0.0, 0.0, SAID_YAW**2]).ravel()
    return {"header": context.header(value.frame_id, stamp), "pose": {"pose": pose(value), "covariance": covariance}}


def path_message(value: Path | None, context: MessageContext) -> Message:
    """Return a nav_msgs/Path; without poses where there is no path."""
    if value is None:
        return {"header": context.header(context.global_frame, 0.0), "poses": []}
    header = context.header(value.frame_id, value.stamp)
    assert value.orientations is not None
    poses = [
        {"header": header, "pose": {"position": vector(position), "orientation": quaternion(orientation)}}
        for position, orientation in zip(value.positions.tolist(), value.orientations.tolist(), strict=True)
    ]
    return {"header": header, "poses": poses}


def path_of(message: Mapping[str, Any], context: MessageContext) -> Path:
    """Return a path; its frame is that of its header, or that of its poses where the header names none.

    Raises
    ------
    InvalidValueError
        The poses are in several frames, or one of them is none, see ``pose_of``.
    """
    named = message["header"]["frame_id"]
    header = context if not named else MessageContext(context.frame(named), context.epoch)
    poses = [pose_of(one, header, f"poses[{i}]") for i, one in enumerate(message["poses"])]
    try:
        path = Path.from_poses(poses, context.stamp(message["header"]["stamp"]))
    except ValueError as error:
        raise InvalidValueError(str(error)) from error
    if poses and named and path.frame_id != header.global_frame:
        raise InvalidValueError(f"the path is in {header.global_frame!r}, but its poses are in {path.frame_id!r}")
    return path if poses else Path(path.positions, path.orientations, header.global_frame, path.stamp)


# ------------------------------------------------------------------------------------------ velocities and transforms
def twist(value: Twist) -> Message:
    """Return a geometry_msgs/Twist."""
    return {"linear": vector(value.linear), "angular": vector(value.angular)}


def twist_of(message: Mapping[str, Any]) -> Twist:
    """Return a velocity; raises InvalidValueError where a number is not finite."""
    try:
        return Twist(vector_of(message["linear"]), vector_of(message["angular"]))
    except ValueError as error:
        raise InvalidValueError(f"twist: {error}") from error


def odometry_message(value: Odometry, T_odom_base: Transform, context: MessageContext) -> Message:
    """Return a nav_msgs/Odometry: the pose in the odometry's frame and the velocity in the robot's."""
    body = {"position": vector(T_odom_base.translation), "orientation": quaternion(T_odom_base.rotation)}
    return {
        "header": context.header(T_odom_base.parent, value.stamp),
        "child_frame_id": T_odom_base.child,
        "pose": {"pose": body, "covariance": NO_COVARIANCE},
        "twist": {"twist": twist(value.velocity), "covariance": NO_COVARIANCE},
    }


def odometry_of(message: Mapping[str, Any], context: MessageContext, received: float) -> Odometry:
    """Return the velocity of a nav_msgs/Odometry; one without a stamp is as old as its arrival ``received`` [s]."""
    return Odometry(twist_of(message["twist"]["twist"]), context.stamp(message["header"]["stamp"]) or received)


def transforms_message(transforms: Iterable[Transform], context: MessageContext) -> Message:
    """Return a tf2_msgs/TFMessage."""
    stamped = [
        {
            "header": context.header(one.parent, one.stamp),
            "child_frame_id": one.child,
            "transform": {"translation": vector(one.translation), "rotation": quaternion(one.rotation)},
        }
        for one in transforms
    ]
    return {"transforms": stamped}


def transforms_of(
    message: Mapping[str, Any], context: MessageContext, received: float, static: bool = False
) -> list[Transform]:
    """Return the transforms of a TFMessage; those without a stamp are as old as their arrival ``received`` [s].

    Raises
    ------
    InvalidValueError
        One of them is none: not finite, no rotation, or without a name of a frame.
    """
    found = []
    for one in message["transforms"]:
        body, header = one["transform"], one["header"]
        frames = header["frame_id"].lstrip("/"), one["child_frame_id"].lstrip("/")
        place = vector_of(body["translation"]), quaternion_of(body["rotation"])
        try:
            found.append(Transform(*place, *frames, context.stamp(header["stamp"]) or received, static))
        except TransformError as error:
            raise InvalidValueError(str(error)) from error
    return found
