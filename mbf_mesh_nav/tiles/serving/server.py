"""The server on a map of tiles.

The configuration has one section, ``tiled_map``; its layers sense and come on top of those the tiles were built with.
Plugin types are looked for with the prefix ``mesh.``, the planner is ``tiles.hierarchical``. Controllers and recoveries
for meshes drive on a window around the robot, refiners for meshes see the part around their path, planners for one mesh
are refused.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, cast

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.config.configuration import Config, PluginSpec
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.maps.view import GridView
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.plugins import PluginContext, PluginKind
from mbf_abstract.server.map_server import MapServer
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.robot_outline import OutlineParameters, changes_of_radius
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.plugins import MeshController, MeshPlugin, MeshRecovery, MeshRefiner
from mbf_mesh_nav.tiles.index import is_tile_folder, read_index
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.path_refiner import PathRefiner
from mbf_mesh_nav.tiles.serving.windows.window_controller import WindowController
from mbf_mesh_nav.tiles.serving.windows.window_recovery import WindowRecovery
from mbf_mesh_nav.tiles.serving.windows.window_settings import WindowSettings, window_settings
from mbf_mesh_nav.tiles.tiled_map import DEFAULT_MEMORY, TiledMap

BARE_TILES = """\
backend: tiles
global_frame: {frame}
planner_max_retries: 0
planner_patience: 100.0
planners:
  - {{name: hierarchical, type: tiles.hierarchical}}
refiners:
  - {{name: string_pulling, type: string_pulling}}
plan_refiner: string_pulling
tiled_map:
  folder: {folder}
"""


ON_TILES: Mapping[type[MeshPlugin], Any] = {
    MeshController: WindowController,
    MeshRecovery: WindowRecovery,
    MeshRefiner: PathRefiner,
}
"""What gives plugins for one mesh the part of the tiles that they need."""


class TiledMapParameters(OutlineParameters):
    """Parameters of the ``tiled_map`` block."""

    folder: str = parameter(..., "Folder of the tiles, as `mbf map tile` writes it.", dynamic=False)
    profile: str = parameter("", "Cost profile of the map; empty = its first one.", dynamic=False)
    memory: float = parameter(
        DEFAULT_MEMORY, "What loaded tiles, searches and tables may take.", unit="bytes", gt=0.0, dynamic=False
    )
    inscribed_radius: float = parameter(
        0.0, "Radius of the robot's inner circle; 0 = that of the map's layers.", unit="m", ge=0.0
    )
    max_turning_slope: float = parameter(
        MeshMap.max_turning_slope,
        "Steeper ground is not turned on in a recovery.",
        unit="rad",
        gt=0.0,
        le=1.5,
        dynamic=False,
    )
    window: float = parameter(
        40.0,
        "Side of the part around the robot that sensors mark and controllers for meshes drive on.",
        unit="m",
        gt=0.0,
        le=1e4,
        dynamic=False,
    )
    layers: tuple[MeshLayerEntry, ...] = parameter(
        (),
        "Layers that sensors fill and those that read them, in any order; they may read the layers of the tiles.",
        dynamic=False,
    )
    default_layer: str = parameter(
        "", "The layer that counts beside that of the profile, the worse of both; empty = the last one.", dynamic=False
    )
    update_frequency: float = parameter(
        10.0, "How often the server updates the map.", unit="Hz", gt=0.0, le=1000.0, dynamic=False
    )


class TileServer(MapServer):
    """Navigation on a map larger than memory."""

    backend: ClassVar[str] = "tiles"
    plugin_prefix: ClassVar[str] = "mesh"
    map_type = TiledNavigationMap
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {"tiled_map": TiledMapParameters}

    @property
    def tiled_map(self) -> TiledNavigationMap:
        """The map."""
        tiled_map: TiledNavigationMap = self.served["tiled_map"].map
        return tiled_map

    @classmethod
    def plugin_misfit(cls, plugin_class: type) -> str:
        """Plugins for one mesh that look at a part of it can be used, too."""
        if issubclass(plugin_class, tuple(ON_TILES)):
            return ""
        if issubclass(plugin_class, MeshPlugin):
            return f"class {plugin_class.__qualname__} needs the whole mesh in memory, which a map of tiles is not"
        return super().plugin_misfit(plugin_class)

    def serve_maps(self, config: Config) -> Iterator[ServedMap[Any]]:
        """Open the folder."""
        parameters = cast(TiledMapParameters, config.sections["tiled_map"].parameters)
        folder = configured_file(config.path.parent, parameters.folder)
        try:
            tiled = TiledMap(folder, parameters.profile, parameters.memory)
        except KeyError as error:
            raise MeshError(str(folder), [str(error.args[0])]) from error
        if (frame := config.parameters.global_frame) != tiled.index.frame_id:
            text = f"is in the frame '{tiled.index.frame_id}', the global_frame of the configuration is '{frame}'"
            raise MeshError(str(folder), [text])
        window = self._window(config, parameters, tiled)
        tiled_map = TiledNavigationMap(tiled, parameters.inscribed_radius, parameters.max_turning_slope, window)
        tiled_map.footprint = parameters.footprint
        yield ServedMap(tiled_map, self.runtime, "tiled_map", parameters, parameters.update_frequency)

    def _window(self, config: Config, parameters: TiledMapParameters, tiled: TiledMap) -> WindowSettings:
        layers = config.sections["tiled_map"].layers
        speed = self.runtime.gate.limits.max_vel_x
        driven = speed / parameters.update_frequency if math.isfinite(speed) else 0.0
        classes: dict[str, Any] = {layer.type_name: layer.layer_class for layer in layers}
        try:
            return window_settings(
                tiled,
                parameters.window,
                parameters.layers,
                {layer.name: cast(Any, layer.parameters) for layer in layers},
                parameters.default_layer,
                parameters.inscribed_radius,
                classes.__getitem__,
                driven,
            )
        except LayerListError as error:
            raise LayerListError(f"{config.path}: tiled_map: {error}") from error

    def footprint_changes(self, footprint: str | Sequence[Sequence[float]] | float) -> Mapping[str, Any]:
        """The radius of the disc that stands for the robot; the map's layers keep theirs."""
        return changes_of_radius(footprint)

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add the map."""
        transforms = self.runtime.transforms
        return MapContext(**vars(base), navigation_map=self.tiled_map, transforms=transforms, scans=self.scans)

    def _construct(self, spec: PluginSpec) -> LoadedPlugin[Any]:
        for base, on_tiles in ON_TILES.items():
            if issubclass(spec.plugin_class, base):
                wrapped: Any = partial(on_tiles, spec.plugin_class)
                loaded = super()._construct(replace(spec, plugin_class=wrapped))
                loaded.spec = spec
                return loaded
        return super()._construct(spec)

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Heights of all surfaces at a place, the lowest free one first; see ``ground.ground_heights``."""
        return self.tiled_map.ground_heights(x, y)

    map_view_type = GridView

    @property
    def map_views(self) -> tuple[str, ...]:
        """Names of the layers, the one of the cost profile first."""
        tiled = self.tiled_map.tiled
        shown = tiled.profile_layer
        return tuple(sorted(tiled.index.layers, key=lambda name: name != shown))

    def map_view(self, name: str = "") -> GridView:
        """The costs of a layer from above, of the cost profile's layer with what sensors see without a name."""
        return self.tiled_map.view(name or self.map_views[0])

    @classmethod
    def config_for_map(cls, file: Path, unknown_is_free: bool = True) -> str | None:
        """Take folders of tiles."""
        if not is_tile_folder(file):
            return None
        frame = read_index(file).frame_id
        return BARE_TILES.format(folder=json.dumps(str(file)), frame=json.dumps(frame))
