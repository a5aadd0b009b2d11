"""Messages of maps that have changed, for those who listen: costmaps as OccupancyGrid, a mesh as mesh_msgs and markers.

Nothing is made of a map to which nobody listens.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.view import GridView, MeshView
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2.queries import map_frame
from mbf_ros.robot_inputs import Quality

MESH_ID = "mbf"
WHOLE_PERIOD = 10.0
"""Time [s] after which a grid is sent as a whole again, for listeners that came unnoticed."""


class Output(NamedTuple):
    """A topic that is published.

    Attributes
    ----------
    topic, type : str
        A topic that begins with ``~/`` belongs to the node, one without a slash to its namespace.
    depth : int
        How many messages wait for a slow listener.
    always : bool
        Whether messages are made although nobody listens, for those who come later.
    shared : bool
        Whether others publish it, too.
    outdates : str
        Topic whose earlier messages mean nothing after one of this; empty if there is none.
    """

    topic: str
    type: str
    quality: Quality = Quality.MANY
    depth: int = 10
    always: bool = False
    shared: bool = False
    outdates: str = ""


class Audience(NamedTuple):
    """Who listens to a topic: how many, and how often somebody has begun to."""

    listeners: int
    joined: int


class MapMessages(ABC):
    """Messages of one map.

    Parameters
    ----------
    name : str
        Of a view of the server.
    context : callable
        How stamps and frames relate to ours, now.
    audience : callable
        Who listens to a topic.
    """

    outputs: tuple[Output, ...]

    def __init__(
        self,
        server: AbstractNavigationServer,
        name: str,
        context: Callable[[], MessageContext],
        audience: Callable[[str], Audience],
    ) -> None:
        self._server, self._name, self._context, self._audience = server, name, context, audience
        self._frame_id = map_frame(server, name)

    @abstractmethod
    def changes(self, now: float) -> Iterator[tuple[str, Message]]:
        """Yield topics and messages of what has changed, or is new to a listener, stamped with ``now`` [s]."""


class GridMessages(MapMessages):
    """A costmap: as a whole to new listeners and where it has moved, else the window that has changed.

    Updates replace the whole only while every listener of the grid may listen to them, too.
    """

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._updates = Output(f"{self._name}/costmap_updates", "map_msgs/OccupancyGridUpdate")
        self._grid = Output(
            f"{self._name}/costmap", "nav_msgs/OccupancyGrid", Quality.LATCHED, depth=1, outdates=self._updates.topic
        )
        self.outputs = (self._grid, self._updates)
        self._cells: NDArray[np.int8] | None = None
        self._known: tuple[object, ...] = ()  # place, and who has got the whole of it
        self._whole_at = 0.0

    def changes(self, now: float) -> Iterator[tuple[str, Message]]:
        """See ``MapMessages``."""
        grid, updates = self._audience(self._grid.topic), self._audience(self._updates.topic)
        view = self._server.map_view(self._name) if grid.listeners else None
        if not isinstance(view, GridView):
            self._cells = None  # the next listener begins anew
            return
        cells = maps.occupancy_cells(view.costs)
        known = (view.extent, cells.shape, grid.joined, updates.joined)
        before, self._cells = self._cells, cells
        window = maps.changed_window(before, cells) if before is not None and self._known == known else None
        overdue = window is not None and now - self._whole_at >= WHOLE_PERIOD
        if before is None or self._known != known or overdue or (window and updates.listeners < grid.listeners):
            self._known, self._whole_at = known, now
            yield self._grid.topic, maps.occupancy_grid(cells, view.extent, self._frame_id, now, self._context())
        elif window is not None:
            message = maps.occupancy_grid_update(cells, window, self._frame_id, now, self._context())
            yield self._updates.topic, message


class MeshMessages(MapMessages):
    """A mesh and the costs of its vertices; for viewers without mesh_msgs as triangles coloured by cost."""

    geometry = Output("~/mesh", "mesh_msgs/MeshGeometryStamped", Quality.LATCHED, depth=1)
    costs = Output("~/vertex_costs", "mesh_msgs/MeshVertexCostsStamped", Quality.LATCHED, depth=1)
    markers = Output("~/mesh_markers", "visualization_msgs/MarkerArray", Quality.LATCHED, depth=1)
    outputs = (geometry, costs, markers)

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._joined: dict[str, int] = {}
        self._sent: dict[str, MeshView] = {}

    def changes(self, now: float) -> Iterator[tuple[str, Message]]:
        """See ``MapMessages``."""
        audiences = {one: self._audience(one.topic) for one in self.outputs}
        wanted = [one for one, audience in audiences.items() if audience.listeners]
        view = self._server.map_view(self._name) if wanted else None
        self._sent = {one.topic: self._sent[one.topic] for one in wanted if one.topic in self._sent}
        if not isinstance(view, MeshView):
            return
        for one in wanted:
            joined, sent = audiences[one].joined, self._sent.get(one.topic)
            is_sent = sent is not None and _is_same(view, sent, with_costs=one is not self.geometry)
            if not is_sent or self._joined.get(one.topic) != joined:
                self._joined[one.topic], self._sent[one.topic] = joined, view
                yield one.topic, self._message(one, view, now)

    def _message(self, output: Output, view: MeshView, now: float) -> Message:
        if output is self.geometry:
            return maps.mesh_geometry(view, MESH_ID, self._frame_id, now, self._context())
        if output is self.costs:
            return maps.mesh_costs(view, MESH_ID, self._name, self._frame_id, now, self._context())
        return maps.mesh_markers(view, self._frame_id, now, self._context())


def _is_same(view: MeshView, sent: MeshView, with_costs: bool) -> bool:
    """Whether two views are of the same mesh, and if so wanted of the same costs."""
    pairs: list[tuple[NDArray[Any], NDArray[Any]]] = [(view.vertices, sent.vertices), (view.faces, sent.faces)]
    pairs += [(view.costs, sent.costs)] if with_costs else []
    return all(one is other or np.array_equal(one, other) for one, other in pairs)


def map_messages(
    server: AbstractNavigationServer, context: Callable[[], MessageContext], audience: Callable[[str], Audience]
) -> list[MapMessages]:
    """Return the messages of all costmaps of a server; of a mesh those of the layer that planners see."""
    if server.map_view_type is MeshView:
        return [MeshMessages(server, name, context, audience) for name in server.map_views[:1]]
    return [GridMessages(server, name, context, audience) for name in server.map_views]
