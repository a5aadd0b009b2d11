"""Maps of cells and of triangles as messages; each message has exactly the fields of its type."""

import numpy as np
import pytest

from mbf_abstract.maps.view import FieldView, GridView, MeshView
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import completed, fields_of

CONTEXT = MessageContext()
MESH = MeshView(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.int32([[0, 1, 2]]), np.float32([0.0, 0.5, np.inf]))


def test_costs_of_cells_are_percent_and_unknown_is_minus_one():
    costs = np.float32([[0.0, 0.5, 1.0], [2.0, np.nan, 0.004]])
    message = maps.occupancy_grid(GridView(costs, (-1.0, 0.5, 2.0, 3.0)), "map", 1.0, CONTEXT)
    assert message["data"].tolist() == [0, 50, 100, 100, -1, 0]
    info = message["info"]
    assert (info["width"], info["height"], info["resolution"]) == (3, 2, 0.5)
    assert (info["origin"]["position"]["x"], info["origin"]["position"]["y"]) == (-1.0, 2.0)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("nav_msgs/OccupancyGrid", maps.occupancy_grid(GridView(np.zeros((2, 3)), (0, 3, 0, 2)), "map", 0.0, CONTEXT)),
        ("mesh_msgs/MeshGeometryStamped", maps.mesh_geometry(MESH, "id", "map", 0.0, CONTEXT)),
        ("mesh_msgs/MeshVertexCostsStamped", maps.mesh_costs(MESH, "id", "layer", "map", 0.0, CONTEXT)),
        ("visualization_msgs/MarkerArray", maps.mesh_markers(MESH, "map", 0.0, CONTEXT)),
        (
            "visualization_msgs/MarkerArray",
            maps.field_markers(FieldView(np.zeros((2, 3)), np.ones((2, 3))), "map", 0.0, CONTEXT),
        ),
    ],
)
def test_a_message_of_a_map_has_exactly_the_fields_of_its_type(kind, message):
    assert set(message) == {field.name for field in fields_of(kind)}
    for marker in message.get("markers", []):
        assert set(marker) == {field.name for field in fields_of("visualization_msgs/Marker")}
    completed(kind, message)


def test_a_triangle_has_the_colours_of_its_corners_from_free_to_forbidden():
    (marker,) = maps.mesh_markers(MESH, "map", 0.0, CONTEXT)["markers"]
    free, middle, forbidden = ((c["r"], c["g"], c["b"]) for c in marker["colors"])
    assert free == maps.FREE_COLOR and forbidden == maps.FORBIDDEN_COLOR
    assert middle == pytest.approx(tuple((a + b) / 2 for a, b in zip(free, forbidden, strict=True)))
    assert [(p["x"], p["y"]) for p in marker["points"]] == [(0, 0), (1, 0), (0, 1)]


def test_directions_are_lines_of_equal_length():
    view = FieldView(np.array([[1.0, 2.0, 0.0]]), np.float32([[0.0, 1.0, 0.0]]))
    start, end = maps.field_markers(view, "map", 0.0, CONTEXT)["markers"][0]["points"]
    assert (start, end) == ({"x": 1.0, "y": 2.0, "z": 0.0}, {"x": 1.0, "y": 2.0 + maps.ARROW_LENGTH, "z": 0.0})
