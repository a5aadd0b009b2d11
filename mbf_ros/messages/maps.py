"""Views of our maps as messages: OccupancyGrid, its updates, mesh_msgs, and markers for viewers without mesh_msgs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.maps.view import FieldView, GridView, MeshView
from mbf_ros.messages.geometry import MessageContext, duration, pose, vector
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.records import colors, points, triangles

UNKNOWN_CELL, INSCRIBED_CELL, LETHAL_CELL = -1, 99, 100
COST_STEPS = 253
"""Cost 1 of a view in the units of a costmap, whose costs 1 to 252 are the cells 1 to 98, as in Nav2."""
LETHAL_COST, UNKNOWN_COST = 254, 255
LINE_LIST, TRIANGLE_LIST = 5, 11
FREE_COLOR, FORBIDDEN_COLOR = (0.55, 0.75, 0.55), (0.80, 0.25, 0.20)
ARROW_LENGTH = 0.25  # m


class CellWindow(NamedTuple):
    """A rectangle of cells: x0 <= column < x1, y0 <= row < y1."""

    x0: int
    y0: int
    x1: int
    y1: int


def occupancy_cells(costs: NDArray[np.float32]) -> NDArray[np.int8]:
    """Return costs (height, width) as cells of an OccupancyGrid, on the scale of Nav2's costmaps.

    0 is free, 99 where the robot's middle must not be (cost 1), 100 an obstacle (above 1), and -1 unknown (nan).
    """
    known = np.nan_to_num(costs, nan=0.0, posinf=2.0)
    cells: NDArray[np.int8] = np.clip(np.floor(97.0 * (COST_STEPS * known - 1.0) / 251.0) + 1.0, 1.0, 98.0).astype(
        np.int8
    )
    cells[known <= 0.0] = 0
    cells[known >= 1.0] = INSCRIBED_CELL
    cells[known > 1.0] = LETHAL_CELL
    cells[np.isnan(costs)] = UNKNOWN_CELL
    return cells


def costmap_costs(costs: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return costs (height, width) of a view as the costs of Nav2's costmaps.

    0 is free, 253 where the robot's middle must not be (cost 1), 254 an obstacle (above 1), and 255 unknown (nan).
    """
    known = np.nan_to_num(costs, nan=0.0, posinf=2.0)
    scaled: NDArray[np.uint8] = np.clip(np.rint(COST_STEPS * known), 1.0, COST_STEPS - 1.0).astype(np.uint8)
    scaled[known <= 0.0] = 0
    scaled[known >= 1.0] = COST_STEPS
    scaled[known > 1.0] = LETHAL_COST
    scaled[np.isnan(costs)] = UNKNOWN_COST
    return scaled


def changed_window(before: NDArray[np.int8], after: NDArray[np.int8]) -> CellWindow | None:
    """Return the smallest window (both (height, width)) that holds all cells that differ; None if none does."""
    different = before != after
    rows, columns = np.flatnonzero(different.any(axis=1)), np.flatnonzero(different.any(axis=0))
    if not len(rows):
        return None
    return CellWindow(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)


def occupancy_grid(
    cells: NDArray[np.int8],
    extent: tuple[float, float, float, float],
    frame_id: str,
    stamp: float,
    context: MessageContext,
) -> Message:
    """Return ``occupancy_cells`` (height, width) of a view with this extent as a nav_msgs/OccupancyGrid."""
    height, width = cells.shape
    x_min, x_max, y_min, _ = extent
    header = context.header(frame_id, stamp)
    return {
        "header": header,
        "info": {
            "map_load_time": header["stamp"],
            "resolution": (x_max - x_min) / width,
            "width": width,
            "height": height,
            "origin": pose(Pose((x_min, y_min, 0.0))),
        },
        "data": cells.reshape(-1),
    }


def costmap(view: GridView, layer: str, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return a view of the layer of this name as a nav2_msgs/Costmap."""
    costs = costmap_costs(view.costs)
    height, width = costs.shape
    x_min, x_max, y_min, _ = view.extent
    header = context.header(frame_id, stamp)
    metadata = {
        "map_load_time": header["stamp"],
        "update_time": header["stamp"],
        "layer": layer,
        "resolution": (x_max - x_min) / width,
        "size_x": width,
        "size_y": height,
        "origin": pose(Pose((x_min, y_min, 0.0))),
    }
    return {"header": header, "metadata": metadata, "data": costs.reshape(-1)}


def occupancy_grid_update(
    cells: NDArray[np.int8], window: CellWindow, frame_id: str, stamp: float, context: MessageContext
) -> Message:
    """Return the cells of a window as a map_msgs/OccupancyGridUpdate of the grid ``cells`` (height, width)."""
    return {
        "header": context.header(frame_id, stamp),
        "x": window.x0,
        "y": window.y0,
        "width": window.x1 - window.x0,
        "height": window.y1 - window.y0,
        "data": np.ascontiguousarray(cells[window.y0 : window.y1, window.x0 : window.x1]).reshape(-1),
    }


def polygon(corners: FloatArray, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return corners (n, 3) [m] as a geometry_msgs/PolygonStamped."""
    return {"header": context.header(frame_id, stamp), "polygon": {"points": points(corners, "float32")}}


def mesh_geometry(view: MeshView, uuid: str, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return a mesh as a mesh_msgs/MeshGeometryStamped, without normals."""
    return {
        "header": context.header(frame_id, stamp),
        "uuid": uuid,
        "mesh_geometry": {"vertices": points(view.vertices), "vertex_normals": [], "faces": triangles(view.faces)},
    }


def mesh_costs(view: MeshView, uuid: str, layer: str, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return costs of vertices as a mesh_msgs/MeshVertexCostsStamped; infinity is forbidden."""
    return {
        "header": context.header(frame_id, stamp),
        "uuid": uuid,
        "type": layer,
        "mesh_vertex_costs": {"costs": view.costs.astype(np.float32)},
    }


def mesh_markers(view: MeshView, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return a mesh as a visualization_msgs/MarkerArray: triangles coloured by cost, from free to forbidden."""
    shares = np.clip(np.nan_to_num(view.costs, nan=1.0, posinf=1.0), 0.0, 1.0)[:, None]
    rgb = (1.0 - shares) * np.array(FREE_COLOR) + shares * np.array(FORBIDDEN_COLOR)
    rgba = np.column_stack([rgb, np.ones(len(rgb))])
    corners = view.faces.reshape(-1)
    marker = _marker(TRIANGLE_LIST, "mesh", frame_id, stamp, context, (1.0, 1.0, 1.0))
    marker["points"] = points(view.vertices[corners])
    marker["colors"] = colors(rgba[corners])
    return {"markers": [marker]}


def field_markers(view: FieldView, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return the directions of a plan as a MarkerArray of short lines."""
    tips = view.points + ARROW_LENGTH * view.directions.astype(np.float64)
    ends: NDArray[Any] = np.stack([view.points, tips], axis=1).reshape(-1, 3)
    marker = _marker(LINE_LIST, "vector_field", frame_id, stamp, context, (0.02, 0.0, 0.0))
    marker["points"] = points(ends)
    return {"markers": [marker]}


def vector_field(view: FieldView, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return the directions of a plan as a mesh_msgs/VectorFieldStamped: unit vectors where they begin."""
    return {
        "header": context.header(frame_id, stamp),
        "vector_field": {"positions": points(view.points), "vectors": points(view.directions.astype(np.float64))},
    }


def _color(rgb: Any) -> Message:
    return {"r": rgb[0], "g": rgb[1], "b": rgb[2], "a": 1.0}


def _marker(
    kind: int, name: str, frame_id: str, stamp: float, context: MessageContext, scale: tuple[float, float, float]
) -> Message:
    return {
        "header": context.header(frame_id, stamp),
        "ns": name,
        "id": 0,
        "type": kind,
        "action": 0,
        "pose": pose(Pose((0.0, 0.0, 0.0))),
        "scale": vector(scale),
        "color": _color((0.2, 0.4, 0.9)),
        "lifetime": duration(0.0),
        "frame_locked": False,
        "points": [],
        "colors": [],
        "texture_resource": "",
        "texture": {"header": context.header("", 0.0), "format": "", "data": np.zeros(0, np.uint8)},
        "uv_coordinates": [],
        "text": "",
        "mesh_resource": "",
        "mesh_file": {"filename": "", "data": np.zeros(0, np.uint8)},
        "mesh_use_embedded_materials": False,
    }
