"""Services of nav2_msgs that ask, clear or hand out the map."""

from __future__ import annotations

import numpy as np

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Path
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.view import GridView
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import MessageContext, path_of
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.messages.mbf_queries import MapQuestion

INSCRIBED_COST, LETHAL_COST = maps.COST_STEPS, maps.LETHAL_COST
LIMITS = {
    INSCRIBED_COST: CellState.INSCRIBED,
    LETHAL_COST: CellState.LETHAL,
    maps.UNKNOWN_COST: CellState.LETHAL,
}
"""From which state on a place is forbidden, by ``max_cost``."""
NOT_VALID: Message = {"is_valid": False, "invalid_pose_indices": []}
"""The answer where there is none."""


def is_path_valid(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
    """Return whether the robot fits at each pose that lies before it, and the indices of those where it does not.

    As in Nav2 an empty path is not valid, poses that lie behind the robot do not count, and unknown ground does only
    with ``consider_unknown_as_obstacle``; what is lethal beside it counts always. The robot's outline decides: with a
    ``max_cost`` of 253 it must not cover an inscribed cell either, and a lower one raises MessageError.
    """
    limit = LIMITS.get(request.get("max_cost", LETHAL_COST))
    if limit is None:
        raise MessageError(f"max_cost {request['max_cost']} is not supported here; leave it at {LETHAL_COST}")
    path = path_of(request["path"], context)
    if len(path) == 0:
        return NOT_VALID
    unknown = bool(request.get("consider_unknown_as_obstacle", False))
    first = _nearest(server, path)
    places = server.queries.check_poses(path[first:])
    invalid = [first + i for i, place in enumerate(places) if place.is_blocked(limit, unknown=unknown)]
    return {"is_valid": not invalid, "invalid_pose_indices": np.array(invalid, np.int32)}


def _nearest(server: AbstractNavigationServer, path: Path) -> int:
    """Index of the pose nearest to the robot; 0 where it is not known."""
    try:
        robot = server.runtime.transforms.transform_pose(server.runtime.robot.pose(), path.frame_id)
    except (RobotStateError, TransformError):
        return 0
    return int(np.argmin(norm(path.positions - np.array(robot.position))))


def _clearing(local: bool, inside: bool | None = None) -> MapQuestion:
    """Service that clears one of the two maps: all of it, or only what is inside or outside of a square."""

    def clear(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
        if inside is None:
            server.queries.clear_map(local)
        else:
            server.queries.clear_area(request["reset_distance"], local, inside=inside)
        return {}

    name = {None: "ClearEntireCostmap", True: "ClearCostmapAroundRobot", False: "ClearCostmapExceptRegion"}[inside]
    return MapQuestion(f"nav2_msgs/srv/{name}", clear, {})


def map_frame(server: AbstractNavigationServer, name: str) -> str:
    """Return the frame of one of the ``map_views`` of a server."""
    served = server.served.get(name) if isinstance(server, MapServer) else None
    return served.map.frame_id if served else server.runtime.robot.global_frame


def _handing_out(name: str) -> MapQuestion:
    """Service that returns one of the two costmaps; where a server has only one of cells, that one."""

    def get(server: AbstractNavigationServer, request: Message, context: MessageContext) -> Message:
        shown = name if name in server.map_views else next(iter(server.map_views), "")
        view = server.map_view(shown)
        if not isinstance(view, GridView) or not view.costs.size:
            raise MessageError("this map has no cells; the costs of a mesh are on ~/vertex_costs")
        now = server.runtime.clock.now()
        return {"map": maps.costmap(view, shown, map_frame(server, shown), now, context)}

    return MapQuestion("nav2_msgs/srv/GetCostmap", get, {})


NAV2_QUESTIONS = {
    "global_costmap/get_costmap": _handing_out("global_costmap"),
    "local_costmap/get_costmap": _handing_out("local_costmap"),
    "is_path_valid": MapQuestion("nav2_msgs/srv/IsPathValid", is_path_valid, NOT_VALID),
    "global_costmap/clear_entirely_global_costmap": _clearing(local=False),
    "local_costmap/clear_entirely_local_costmap": _clearing(local=True),
    "global_costmap/clear_around_global_costmap": _clearing(local=False, inside=True),
    "local_costmap/clear_around_local_costmap": _clearing(local=True, inside=True),
    "global_costmap/clear_except_global_costmap": _clearing(local=False, inside=False),
    "local_costmap/clear_except_local_costmap": _clearing(local=True, inside=False),
}
"""By the names of the services."""
