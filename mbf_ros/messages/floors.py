"""Maps of floors: nav_msgs/OccupancyGrid and map_msgs/OccupancyGridUpdate as maps of ours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.view import GREATEST_RESOLUTION, LEAST_RESOLUTION, FloorMap, FloorWindow
from mbf_ros.messages.geometry import InvalidValueError, MessageContext, pose_of
from mbf_ros.messages.interfaces import Message


def floor_of(message: Message, context: MessageContext) -> FloorMap:
    """Return the map of an OccupancyGrid; of its origin the height and all turns but the yaw are left out.

    Raises
    ------
    InvalidValueError
        It has not as many cells as its size says or none, or a resolution or an origin that means nothing.
    """
    header, info = message["header"], message["info"]
    resolution = float(f"{info['resolution']:.7g}")  # float32: 0.05 comes as 0.05000000074505806
    if not LEAST_RESOLUTION <= resolution <= GREATEST_RESOLUTION:
        limits = f"{LEAST_RESOLUTION:g} to {GREATEST_RESOLUTION:g} m"
        raise InvalidValueError(f"info.resolution: expected {limits}, got {resolution:g}")
    origin = pose_of({"header": header, "pose": info["origin"]}, context, "info.origin")
    occupancy = _occupancy(message["data"], info["width"], info["height"])
    return FloorMap(occupancy, resolution, origin.x, origin.y, origin.yaw, origin.frame_id)


def floor_window_of(message: Message, context: MessageContext) -> FloorWindow:
    """Return the change of an OccupancyGridUpdate; raises InvalidValueError where its size is not that of its data."""
    occupancy = _occupancy(message["data"], message["width"], message["height"])
    return FloorWindow(occupancy, message["x"], message["y"], context.frame(message["header"]["frame_id"]))


def _occupancy(data: Any, width: int, height: int) -> NDArray[np.uint8]:
    """Cells (height, width): -1 is unknown, and what is below that or above 100 occupied, as Nav2 takes them."""
    cells = np.asarray(data, dtype=np.int8)
    if not cells.size or width * height != cells.size:
        raise InvalidValueError(f"data: expected {width} x {height} cells, at least one, got {cells.size}")
    return cells.view(np.uint8).reshape(height, width)
