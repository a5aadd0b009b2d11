"""Plugins for one mesh, constructed on a part of a map of tiles: along a path, or the window around the robot."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Generic, TypeVar

from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import Plugin
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.plugins import LocalMeshPlugin, MeshContext, MeshPlugin
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap

P = TypeVar("P", bound=MeshPlugin)
L = TypeVar("L", bound=LocalMeshPlugin)


def on_part(
    plugin_class: type[P], context: MapContext[TiledNavigationMap], parameters: PluginParameters, part: MeshMap
) -> P:
    """An instance whose map is a part of the tiles, with the rest of a context; raises what its constructor raises."""
    given: dict[str, Any] = {field.name: getattr(context, field.name) for field in fields(context)}
    return plugin_class(MeshContext(**{**given, "navigation_map": part, "maps": {}, "parameters": parameters}))


class OnWindow(Plugin, Generic[L]):
    """What a controller and a recovery for one mesh need to run on the window around the robot.

    Parameters
    ----------
    context : MapContext
        With a map of tiles that has a window.

    Raises
    ------
    ValueError
        The window is too small for it.
    """

    def __init__(self, plugin_class: type[L], context: MapContext[TiledNavigationMap]) -> None:
        super().__init__(context)
        self._class, self._context, self._map = plugin_class, context, context.navigation_map
        self._require_room()
        self._inner = self._made()
        self.modelled_compute_time = self._inner.modelled_compute_time

    def cancel(self) -> bool:
        """As the plugin for one mesh."""
        return self._inner.cancel()

    def _require_room(self) -> None:
        """Raise ValueError where the plugin looks beyond the window with its present parameters."""
        self._map.require_room(self._class.reach(self.parameters))

    def _made(self) -> L:
        """A new instance on the window of now."""
        return on_part(self._class, self._context, self.parameters, self._map.window_map)
