"""The maps of a server as topics: costmaps as OccupancyGrid, a mesh as mesh_msgs and as markers."""

from __future__ import annotations

from collections.abc import Iterator

from mbf_abstract.maps.view import GridView, MapView
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.navigation import NODE
from mbf_ros.rosbridge.topics import TopicTable

MESH_ID = "mbf"
MESH_TOPICS = {
    f"{NODE}/mesh": "mesh_msgs/MeshGeometryStamped",
    f"{NODE}/vertex_costs": "mesh_msgs/MeshVertexCostsStamped",
    f"{NODE}/mesh_markers": "visualization_msgs/MarkerArray",
}


class MapTopics:
    """Makes messages of maps that have changed, or that a new subscriber has not got; of no others.

    Costmaps are named as in Nav2, ``/global_costmap/costmap``; of a mesh the layer is shown that planners see.
    """

    def __init__(self, server: AbstractNavigationServer, topics: TopicTable, context: MessageContext) -> None:
        self._server, self._topics, self._context = server, topics, context
        self._sent: dict[str, tuple[int, bytes]] = {}
        self._views = {name: _topics_of(name, server.map_view(name)) for name in server.map_views}
        if any(types is MESH_TOPICS for types in self._views.values()):
            self._views = {server.map_views[0]: MESH_TOPICS}
        for types in self._views.values():
            for topic, kind in types.items():
                topics.add_output(topic, kind)

    def changed(self, now: float) -> Iterator[tuple[str, Message]]:
        """Yield topics and their messages, stamped with ``now`` [s]."""
        for name, types in self._views.items():
            wanted = [topic for topic in types if self._topics.is_wanted(topic)]
            view = self._server.map_view(name) if wanted else None
            if view is None:
                continue
            content = _content(view)
            for topic in wanted:
                state = (self._topics.newcomers(topic), content)
                if self._sent.get(topic) != state:
                    self._sent[topic] = state
                    yield topic, self._message(topic, name, view, now)

    def _message(self, topic: str, name: str, view: MapView, now: float) -> Message:
        frame_id, context = self._server.runtime.robot.global_frame, self._context
        if isinstance(view, GridView):
            return maps.occupancy_grid(view, frame_id, now, context)
        kind = MESH_TOPICS[topic]
        if kind.endswith("MeshGeometryStamped"):
            return maps.mesh_geometry(view, MESH_ID, frame_id, now, context)
        if kind.endswith("MeshVertexCostsStamped"):
            return maps.mesh_costs(view, MESH_ID, name, frame_id, now, context)
        return maps.mesh_markers(view, frame_id, now, context)


def _topics_of(name: str, view: MapView | None) -> dict[str, str]:
    if view is None:
        return {}
    return {f"/{name}/costmap": "nav_msgs/OccupancyGrid"} if isinstance(view, GridView) else MESH_TOPICS


def _content(view: MapView) -> bytes:
    """What a view shows, to see whether it has changed; a local map may move without a change of its costs."""
    return view.costs.tobytes() + (repr(view.extent).encode() if isinstance(view, GridView) else b"")
