"""Maps of cells and of triangles as messages; each message has exactly the fields of its type."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mbf_abstract.maps.view import FieldView, GridView, MeshView
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import completed, fields_of

CONTEXT = MessageContext()
MESH = MeshView(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.int32([[0, 1, 2]]), np.float32([0.0, 0.5, np.inf]))


def cell_of_nav2(cost):
    """Cell of an OccupancyGrid for a cost of costmap_2d, as Nav2's costmap publisher has it."""
    if cost == 255:
        return -1
    special = {0: 0, 253: 99, 254: 100}
    return special.get(cost, 1 + 97 * (cost - 1) // 251)


def test_cells_are_those_of_nav2_for_every_cost():
    costs = np.arange(256, dtype=np.uint8)
    view = np.divide(costs, np.float32(253), dtype=np.float32)
    view[255] = np.nan
    assert maps.occupancy_cells(view[None])[0].tolist() == [cell_of_nav2(int(cost)) for cost in costs]


def test_what_is_forbidden_without_a_limit_is_an_obstacle_and_a_slight_cost_is_not_free():
    assert maps.occupancy_cells(np.float32([[np.inf, 1e-4, -1.0]])).tolist() == [[100, 1, 0]]


def test_costs_are_those_of_the_costmap_that_is_viewed_for_every_cost():
    costs = np.arange(256, dtype=np.uint8)
    view = np.divide(costs, np.float32(253), dtype=np.float32)
    view[255] = np.nan
    assert maps.costmap_costs(view[None])[0].tolist() == costs.tolist()
    assert maps.costmap_costs(np.float32([[np.inf, 1e-4, -1.0, 0.9999]])).tolist() == [[254, 1, 0, 252]]


def test_a_costmap_lies_where_its_view_does():
    view = GridView(np.float32([[0.0, 0.5, 1.0], [2.0, np.nan, 0.004]]), (-1.0, 0.5, 2.0, 3.0))
    message = maps.costmap(view, "global_costmap", "map", 1.0, CONTEXT)
    assert message["data"].tolist() == [0, 126, 253, 254, 255, 1]
    metadata = message["metadata"]
    assert (metadata["size_x"], metadata["size_y"], metadata["resolution"]) == (3, 2, 0.5)
    assert (metadata["origin"]["position"]["x"], metadata["origin"]["position"]["y"]) == (-1.0, 2.0)
    assert set(message) == {field.name for field in fields_of("nav2_msgs/msg/Costmap")}
    assert set(metadata) == {field.name for field in fields_of("nav2_msgs/msg/CostmapMetaData")}


def test_a_grid_lies_where_its_view_does():
    costs = np.float32([[0.0, 0.5, 1.0], [2.0, np.nan, 0.004]])
    message = maps.occupancy_grid(maps.occupancy_cells(costs), (-1.0, 0.5, 2.0, 3.0), "map", 1.0, CONTEXT)
    assert message["data"].tolist() == [0, 49, 99, 100, -1, 1]
    info = message["info"]
    assert (info["width"], info["height"], info["resolution"]) == (3, 2, 0.5)
    assert (info["origin"]["position"]["x"], info["origin"]["position"]["y"]) == (-1.0, 2.0)


CELLS = arrays(np.int8, (4, 6), elements=st.integers(-1, 2))


@given(CELLS, CELLS)
def test_an_update_of_the_changed_window_makes_one_grid_of_the_other(before, after):
    window = maps.changed_window(before, after)
    if window is None:
        assert (before == after).all()
        return
    update = maps.occupancy_grid_update(after, window, "map", 0.0, CONTEXT)
    shown, (x, y, width, height) = before.copy(), (update[name] for name in ("x", "y", "width", "height"))
    shown[y : y + height, x : x + width] = update["data"].reshape(height, width)
    assert (shown == after).all()
    border = (after != before)[window.y0 : window.y1, window.x0 : window.x1]
    assert border[0].any() and border[-1].any() and border[:, 0].any() and border[:, -1].any()


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("nav_msgs/OccupancyGrid", maps.occupancy_grid(np.zeros((2, 3), np.int8), (0, 3, 0, 2), "map", 0.0, CONTEXT)),
        (
            "map_msgs/OccupancyGridUpdate",
            maps.occupancy_grid_update(np.zeros((2, 3), np.int8), maps.CellWindow(0, 0, 3, 1), "map", 0.0, CONTEXT),
        ),
        ("geometry_msgs/PolygonStamped", maps.polygon(np.zeros((3, 3)), "map", 0.0, CONTEXT)),
        ("mesh_msgs/MeshGeometryStamped", maps.mesh_geometry(MESH, "id", "map", 0.0, CONTEXT)),
        ("mesh_msgs/MeshVertexCostsStamped", maps.mesh_costs(MESH, "id", "layer", "map", 0.0, CONTEXT)),
        ("visualization_msgs/MarkerArray", maps.mesh_markers(MESH, "map", 0.0, CONTEXT)),
        (
            "visualization_msgs/MarkerArray",
            maps.field_markers(FieldView(np.zeros((2, 3)), np.ones((2, 3))), "map", 0.0, CONTEXT),
        ),
        (
            "mesh_msgs/VectorFieldStamped",
            maps.vector_field(FieldView(np.zeros((2, 3)), np.ones((2, 3))), "map", 0.0, CONTEXT),
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


def test_directions_begin_where_they_hold():
    view = FieldView(np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 5.0]]), np.float32([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    field = maps.vector_field(view, "map", 0.0, CONTEXT)["vector_field"]
    assert list(field["positions"]) == [{"x": 1.0, "y": 2.0, "z": 0.0}, {"x": 3.0, "y": 4.0, "z": 5.0}]
    assert list(field["vectors"]) == [{"x": 0.0, "y": 1.0, "z": 0.0}, {"x": 1.0, "y": 0.0, "z": 0.0}]


def test_directions_are_lines_of_equal_length():
    view = FieldView(np.array([[1.0, 2.0, 0.0]]), np.float32([[0.0, 1.0, 0.0]]))
    start, end = maps.field_markers(view, "map", 0.0, CONTEXT)["markers"][0]["points"]
    assert (start, end) == ({"x": 1.0, "y": 2.0, "z": 0.0}, {"x": 1.0, "y": 2.0 + maps.ARROW_LENGTH, "z": 0.0})
