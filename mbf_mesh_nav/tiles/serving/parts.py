"""Plugins for one mesh, constructed on a part of a map of tiles."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

from mbf_abstract.maps.navigation_map import MapContext
from mbf_abstract.parameters import PluginParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.plugins import MeshContext, MeshPlugin
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap

P = TypeVar("P", bound=MeshPlugin)


def on_part(
    plugin_class: type[P], context: MapContext[TiledNavigationMap], parameters: PluginParameters, part: MeshMap
) -> P:
    """An instance whose map is a part of the tiles, with the rest of a context; raises what its constructor raises."""
    given: dict[str, Any] = {field.name: getattr(context, field.name) for field in fields(context)}
    return plugin_class(MeshContext(**{**given, "navigation_map": part, "maps": {}, "parameters": parameters}))
