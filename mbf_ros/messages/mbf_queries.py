"""The services of mbf_msgs that ask the map: requests to our questions, and answers to messages.

A multiplier of 0 is left out of account, as upstream. The costmaps are numbered as there: 1 the local, 2 the global
one; on a mesh both are the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages.geometry import InvalidValueError, MessageContext, path_of, pose_of, pose_stamped
from mbf_ros.messages.interfaces import Message, MessageError

LOCAL_COSTMAP, GLOBAL_COSTMAP = 1, 2
MAX_COST = 2**32 - 1
FACTORS = ("lethal_cost_mult", "inscrib_cost_mult", "unknown_cost_mult")


@dataclass(frozen=True)
class MapQuestion:
    """One service: its type, what asks the map and makes the answer, and the answer where that raises."""

    type: str
    ask: Callable[[AbstractNavigationServer, Message, MessageContext], Message]
    no_answer: Message


def point_question(request: Message, context: MessageContext) -> tuple[Pose, bool]:
    """Return the point of a CheckPoint_Request, and whether the local map is asked."""
    header = request["point"]["header"]
    orientation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    stamped = {"header": header, "pose": {"position": request["point"]["point"], "orientation": orientation}}
    return pose_of(stamped, context, "point"), _is_local(request)


def pose_question(request: Message, context: MessageContext) -> tuple[Pose | None, PlaceQuery]:
    """Return pose (None = where the robot is) and query of a CheckPose_Request."""
    return _pose(request, context), _place_query(request)


def path_question(request: Message, context: MessageContext) -> dict[str, Any]:
    """Return the arguments of ``MapQueries.check_path`` for a CheckPath_Request."""
    state = request["return_on"]
    if state not in tuple(CellState):
        raise MessageError(f"return_on: expected a state from 0 to {max(CellState)}, got {state}")
    return {
        "path": path_of(request["path"], context),
        "query": _place_query(request),
        "return_on": CellState(state) or None,
        "skip_poses": request["skip_poses"],
        "path_cells_only": request["path_cells_only"],
    }


def place_answer(answer: PlaceAnswer | PathAnswer | PoseAnswer) -> Message:
    """Return a CheckPoint_Response or a CheckPose_Response."""
    return {"state": int(answer.state), "cost": _cost(answer.cost)}


def path_answer(answer: PathAnswer) -> Message:
    """Return a CheckPath_Response; ``last_checked`` of a path without poses is 0."""
    return {**place_answer(answer), "last_checked": max(answer.last_checked, 0)}


def valid_pose_answer(answer: PoseAnswer, context: MessageContext) -> Message:
    """Return a FindValidPose_Response; the pose is in no frame where none was found."""
    return {**place_answer(answer), "pose": pose_stamped(answer.pose, context)}


def _is_local(request: Message) -> bool:
    if request["costmap"] not in (LOCAL_COSTMAP, GLOBAL_COSTMAP):
        raise MessageError(f"costmap: expected 1 (local) or 2 (global), got {request['costmap']}")
    return bool(request["costmap"] == LOCAL_COSTMAP)


def _pose(request: Message, context: MessageContext) -> Pose | None:
    return None if request["current_pose"] else pose_of(request["pose"], context)


def _place_query(request: Message) -> PlaceQuery:
    factors = {name: request.get(name) or 1.0 for name in FACTORS}
    if bad := [name for name, factor in factors.items() if not math.isfinite(factor)]:
        raise InvalidValueError(f"{bad[0]}: expected a finite number, got {factors[bad[0]]}")
    try:
        return PlaceQuery(
            request["safety_dist"], local=_is_local(request), use_padded_footprint=request["use_padded_fp"], **factors
        )
    except MessageError:
        raise
    except ValueError as error:
        raise InvalidValueError(str(error)) from error


def _cost(cost: float) -> int:
    """A cost as uint32: rounded, and cut where it does not fit."""
    return round(cost) if 0.0 <= cost < MAX_COST else MAX_COST if cost > 0.0 else 0


def _ask_point(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
    return place_answer(server.queries.check_point(*point_question(request, context)))


def _ask_pose(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
    return place_answer(server.queries.check_pose(*pose_question(request, context)))


def _ask_path(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
    return path_answer(server.queries.check_path(**path_question(request, context)))


def _ask_valid_pose(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
    pose, query = pose_question(request, context)
    answer = server.queries.find_valid_pose(pose, request["dist_tolerance"], request["angle_tolerance"], query)
    return valid_pose_answer(answer, context)


NO_ANSWER: Message = {"state": int(CellState.UNKNOWN), "cost": 0}
MAP_QUESTIONS = {
    "check_point_cost": MapQuestion("mbf_msgs/srv/CheckPoint", _ask_point, NO_ANSWER),
    "check_pose_cost": MapQuestion("mbf_msgs/srv/CheckPose", _ask_pose, NO_ANSWER),
    "check_path_cost": MapQuestion("mbf_msgs/srv/CheckPath", _ask_path, NO_ANSWER),
    "find_valid_pose": MapQuestion("mbf_msgs/srv/FindValidPose", _ask_valid_pose, NO_ANSWER),
}
"""By the names of the services of ``mbf_costmap_nav`` upstream."""
