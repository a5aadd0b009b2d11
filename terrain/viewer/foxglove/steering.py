"""What clients may do to a robot: goals and initial poses by topics, services, parameters.

Goals come as the app's 3D panel publishes them. Its tool clicks on the plane z = 0; a height of 0 is therefore none,
and the ground's is taken, else that of the storey that is nearest.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

from mbf_abstract.config.known_keys import key_hint
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.geometry import FARTHEST_COORDINATE, Pose
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from terrain.viewer.foxglove.protocol import ProtocolError

GOAL, POINT, INITIAL_POSE = "/move_base_simple/goal", "/clicked_point", "/initialpose"
INPUTS = {
    GOAL: "geometry_msgs/PoseStamped",
    POINT: "geometry_msgs/PointStamped",
    INITIAL_POSE: "geometry_msgs/PoseWithCovarianceStamped",
}
"""Topics that clients publish on, and the types of their messages, as JSON."""
CANCEL, PAUSE, RESUME = "/cancel", "/pause", "/resume"
SERVICES = {
    CANCEL: "The goals are canceled.",
    PAUSE: "The robot is held; its goals are kept.",
    RESUME: "The goals go on.",
}
"""Services that clients call, of type std_srvs/srv/Trigger, and what they answer."""
TRIGGER = "std_srvs/srv/Trigger"
REQUEST = {"type": "object"}
RESPONSE = {"type": "object", "properties": {"success": {"type": "boolean"}, "message": {"type": "string"}}}


def advertised_services() -> list[dict[str, Any]]:
    """The services, as they are advertised; older clients look for ``requestSchema`` and ``responseSchema``."""
    request, response = json.dumps(REQUEST), json.dumps(RESPONSE)
    schema = {"encoding": "json", "schemaEncoding": "jsonschema"}
    return [
        {
            "id": number,
            "name": name,
            "type": TRIGGER,
            "requestSchema": request,
            "responseSchema": response,
            "request": {**schema, "schemaName": f"{TRIGGER}_Request", "schema": request},
            "response": {**schema, "schemaName": f"{TRIGGER}_Response", "schema": response},
        }
        for number, name in enumerate(SERVICES, 1)
    ]


class Steering:
    """Does what clients ask for.

    Parameters
    ----------
    go_to : callable
        Takes a goal on the ground; its handle, if there is one, is nobody's.
    cancel : callable
        Ends all goals.
    hold : callable
        Pauses all goals (True), or lets them go on.
    set_initial_pose : callable
        Takes where somebody says that the robot is; raises ValueError where that is of no use.
    post : callable
        Calls a function where goals may be sent, at once or later, and never waits.
    """

    def __init__(
        self,
        server: AbstractNavigationServer,
        go_to: Callable[[Pose], object],
        cancel: Callable[[], object],
        hold: Callable[[bool], object],
        set_initial_pose: Callable[[Pose], None],
        post: Callable[[Callable[[], None]], None] = lambda call: call(),
    ) -> None:
        self.post = post
        self._server, self._go_to, self._cancel, self._hold = server, go_to, cancel, hold
        self._set_initial_pose = set_initial_pose

    def take(self, topic: str, message: Any) -> None:
        """Take a message of one of the ``INPUTS``; raises ProtocolError where it means nothing."""
        if topic == INITIAL_POSE:
            said = self._pose(_without_covariance(message))
            self.post(lambda: self._set_initial_pose(said))
            return
        goal = self._goal(message) if topic == GOAL else self._point(message)
        self.post(lambda: _ignore(self._go_to(goal())))

    def call(self, service: str) -> None:
        """Do what one of the ``SERVICES`` is for, once it is its turn."""
        if service == CANCEL:
            self.post(lambda: _ignore(self._cancel()))
        else:
            self.post(lambda: _ignore(self._hold(service == PAUSE)))

    def parameters(self, names: Collection[str]) -> dict[str, Any]:
        """Return the navigation's parameters of these names, of all without any; infinity is None."""
        found = self._server.runtime.parameters.model_dump(mode="json")
        return {name: _plain(value) for name, value in found.items() if name in names or not names}

    def set_parameters(self, changes: Mapping[str, Any]) -> None:
        """Change parameters; raises ValueError where one is not known, not legal or read only at the start."""
        unknown = next((name for name in changes if name not in NavigationParameters.model_fields), None)
        if unknown is not None:
            hint = key_hint(unknown, NavigationParameters.model_fields)
            raise ValueError(f"there is no parameter {unknown!r}; {hint}")
        self._server.set_parameters(**changes)

    def _goal(self, message: Any) -> Callable[[], Pose]:
        """A pose with a heading, on the ground."""
        pose = self._pose(message)
        return lambda: self._on_ground(pose.x, pose.y, pose.z, pose.yaw)

    def _pose(self, message: Any) -> Pose:
        self._check_frame(message)
        x, y, z = _numbers(message, "pose", "position", "xyz")
        qx, qy, qz, qw = _numbers(message, "pose", "orientation", "xyzw")
        if qx * qx + qy * qy + qz * qz + qw * qw < 1e-6:
            raise ProtocolError("the orientation is no quaternion: all of it is 0")
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
        return Pose.planar(x, y, yaw, z, frame_id=self._server.config.parameters.global_frame)

    def _point(self, message: Any) -> Callable[[], Pose]:
        """A place, to be reached with the heading in which the robot sees it now."""
        self._check_frame(message)
        x, y, z = _numbers(message, "point", "", "xyz")

        def goal() -> Pose:
            robot = self._server.runtime.robot.pose()
            return self._on_ground(x, y, z, math.atan2(y - robot.y, x - robot.x))

        return goal

    def _on_ground(self, x: float, y: float, z: float, yaw: float) -> Pose:
        heights = self._server.ground_heights(x, y)
        if z == 0.0 or not heights:
            return self._server.ground_pose(x, y, yaw)
        nearest = min(heights, key=lambda height: abs(height - z))
        return Pose.planar(x, y, yaw, nearest, frame_id=self._server.config.parameters.global_frame)

    def _check_frame(self, message: Any) -> None:
        header = message.get("header") if isinstance(message, dict) else None
        frame = header.get("frame_id") if isinstance(header, dict) else None
        known = self._server.config.parameters.global_frame
        if not isinstance(frame, str) or frame.lstrip("/") != known:
            raise ProtocolError(
                f"expected a pose in the frame {known!r}, got {frame!r:.80}: choose it as display frame"
            )


def _without_covariance(message: Any) -> Any:
    """A PoseWithCovarianceStamped as a PoseStamped, if it is one."""
    body = message.get("pose") if isinstance(message, dict) else None
    return {**message, "pose": body.get("pose")} if isinstance(body, dict) else message


def _numbers(message: Any, part: str, inner: str, names: str) -> list[float]:
    """Numbers within ``FARTHEST_COORDINATE`` of a part of a message, by name; raises ProtocolError without them."""
    found = message.get(part)
    if inner:
        found = found.get(inner) if isinstance(found, dict) else None
    values: list[Any] = [found.get(name) for name in names] if isinstance(found, dict) else []
    if not values or any(isinstance(one, bool) or not isinstance(one, int | float) for one in values):
        raise ProtocolError(f"{'.'.join(filter(None, (part, inner)))}: expected the numbers {', '.join(names)}")
    try:
        numbers = [float(one) for one in values]
    except OverflowError:
        numbers = [math.inf]
    if not all(map(math.isfinite, numbers)):
        raise ProtocolError(f"{part}: a number is not finite")
    if max(map(abs, numbers)) > FARTHEST_COORDINATE:
        raise ProtocolError(f"{part}: a number is beyond {FARTHEST_COORDINATE:g}")
    return numbers


def _plain(value: Any) -> Any:
    """A value as the protocol can carry it."""
    try:
        json.dumps(value, allow_nan=False)
    except ValueError:
        return None
    return value


def _ignore(answer: object) -> None:
    """Do nothing with what a call returns."""
