"""What a plugin of a server with a map is made with, and what it keeps of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.plugins import Plugin, PluginContext

M = TypeVar("M", bound=NavigationMap)


@dataclass(frozen=True)
class MapContext(PluginContext, Generic[M]):
    """What a plugin of a server with a map is constructed with.

    Attributes
    ----------
    navigation_map : NavigationMap
        The map the plugin is bound to.
    maps : mapping of name to NavigationMap
        All maps of a server that has several, e.g. ``local`` and ``global``.
    transforms : TransformBuffer
        The frames of the maps; a map may be in another one than goals, paths and robot poses.
    scans : mapping of str to RangeScan
        The newest scan of each sensor, in the frame it came in; it changes with every scan. Empty on servers without
        sensors.
    """

    navigation_map: M
    maps: Mapping[str, M] = field(default_factory=dict, kw_only=True)
    transforms: TransformBuffer = field(default_factory=TransformBuffer, kw_only=True)
    scans: Mapping[str, RangeScan] = field(default_factory=dict, kw_only=True)


class MapPlugin(Plugin):
    """Keeps the maps of the context; mixed into the plugin interfaces.

    Raises
    ------
    ValueError
        The map is not of ``map_type``.
    """

    map_type: ClassVar[type | None] = None
    """The map it needs; a server whose map is another one refuses it. None = any map."""

    def __init__(self, context: MapContext[Any]) -> None:
        if misfit := needs_another_map(type(self), type(context.navigation_map)):
            raise ValueError(misfit)
        super().__init__(context)
        self.navigation_map: NavigationMap = context.navigation_map
        self.maps: Mapping[str, NavigationMap] = context.maps
        self.transforms = context.transforms
        self.scans = context.scans

    def on_map(self, pose: Pose, navigation_map: NavigationMap | None = None) -> Pose:
        """Express a pose in the frame of a map, the plugin's own if none is given; raises TransformError."""
        return self.transforms.transform_pose(pose, (navigation_map or self.navigation_map).frame_id)


def needs_another_map(plugin_class: object, map_type: type | None) -> str:
    """Why a plugin class cannot be used on a map; empty if it can, or if one of them does not say what it is."""
    needed = getattr(plugin_class, "map_type", None)
    if needed is None or map_type is None or issubclass(map_type, needed):
        return ""
    name = getattr(plugin_class, "__qualname__", plugin_class)
    return (
        f"class {name} needs a {needed.__name__} ({needed.__module__}), the map of the server is a {map_type.__name__}"
    )
