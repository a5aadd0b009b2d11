"""Views of our maps as messages: OccupancyGrid, mesh_msgs, and markers for viewers that know no mesh_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.view import FieldView, GridView, MeshView
from mbf_ros.messages.geometry import MessageContext, duration, points_message, pose, vector
from mbf_ros.messages.interfaces import Message

UNKNOWN_CELL = -1
LINE_LIST, TRIANGLE_LIST = 5, 11
FREE_COLOR, FORBIDDEN_COLOR = (0.55, 0.75, 0.55), (0.80, 0.25, 0.20)
ARROW_LENGTH = 0.25  # m


def occupancy_grid(view: GridView, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return costs of cells as a nav_msgs/OccupancyGrid: 0 free to 100 forbidden, -1 unknown."""
    height, width = view.costs.shape
    x_min, x_max, y_min, _ = view.extent
    known = ~np.isnan(view.costs)
    cells = np.full(view.costs.shape, UNKNOWN_CELL, np.int8)
    cells[known] = np.rint(np.clip(view.costs[known], 0.0, 1.0) * 100.0).astype(np.int8)
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


def mesh_geometry(view: MeshView, uuid: str, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return a mesh as a mesh_msgs/MeshGeometryStamped, without normals."""
    return {
        "header": context.header(frame_id, stamp),
        "uuid": uuid,
        "mesh_geometry": {
            "vertices": points_message(view.vertices),
            "vertex_normals": [],
            "faces": [{"vertex_indices": face} for face in view.faces.astype(np.uint32)],
        },
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
    colors = (1.0 - shares) * np.array(FREE_COLOR) + shares * np.array(FORBIDDEN_COLOR)
    corners = view.faces.reshape(-1)
    marker = _marker(TRIANGLE_LIST, "mesh", frame_id, stamp, context, (1.0, 1.0, 1.0))
    marker["points"] = points_message(view.vertices[corners])
    marker["colors"] = [_color(rgb) for rgb in colors[corners].tolist()]
    return {"markers": [marker]}


def field_markers(view: FieldView, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return the directions of a plan as a MarkerArray of short lines."""
    tips = view.points + ARROW_LENGTH * view.directions.astype(np.float64)
    ends: NDArray[Any] = np.stack([view.points, tips], axis=1).reshape(-1, 3)
    marker = _marker(LINE_LIST, "vector_field", frame_id, stamp, context, (0.02, 0.0, 0.0))
    marker["points"] = points_message(ends)
    return {"markers": [marker]}


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
