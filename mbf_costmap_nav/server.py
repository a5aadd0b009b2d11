"""The costmap server: the actions of Move Base Flex on 2D layered costmaps.

Two shared maps, made once and handed to all plugins: ``global_costmap`` (planners, refiners) and ``local_costmap``
(controllers); recoveries get both, and ``costmap: local | global`` at a plugin's declaration binds it to the other one.
Each map is updated at its own rate; before every control cycle the local one must be current.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import numpy as np

from mbf_abstract.config.configuration import Config, PluginDeclaration
from mbf_abstract.config.findings import ConfigError, Finding, describe_value
from mbf_abstract.config.registry import Adapter
from mbf_abstract.events import EventKind
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.maps.view import FloorMap, GridView
from mbf_abstract.parameters import ParameterError, ParameterModel, parameter
from mbf_abstract.plugins import PluginContext, PluginKind
from mbf_abstract.server.map_server import MapServer
from mbf_costmap_nav.files.map_description import MapError
from mbf_costmap_nav.files.map_io import load_map
from mbf_costmap_nav.grid.costmap import INSCRIBED, UNKNOWN
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.static_maps import StaticMaps
from mbf_costmap_nav.planning.nav_core import wrap_nav_core
from mbf_costmap_nav.plugins import CostmapContext

MAP_SUFFIXES = {".yaml", ".yml", ".pgm", ".png", ".bmp"}

BARE_MAP = """\
backend: costmap
planner_max_retries: 0
planner_patience: 60.0
planners:
  - {{name: astar, type: astar}}
  - {{name: dijkstra, type: dijkstra}}
  - {{name: theta_star, type: theta_star}}
astar: {{allow_unknown: {allow_unknown}}}
dijkstra: {{allow_unknown: {allow_unknown}}}
theta_star: {{allow_unknown: {allow_unknown}}}
global_costmap:
  robot_radius: 0.25
  track_unknown_space: {track_unknown}
  layers:
    - {{name: walls, type: static}}
    - {{name: inflation, type: inflation}}
  walls: {{map_file: {file}}}
  inflation: {{inflation_radius: 0.6, cost_scaling_factor: 5.0}}
local_costmap: {{rolling_window: true, width: 5.0, height: 5.0, resolution: 0.05, robot_radius: 0.25}}
"""


class CostmapPluginDeclaration(PluginDeclaration):
    """A plugin of the costmap server: it may be bound to the other map than its kind's own."""

    costmap: Literal["", "local", "global"] = parameter("", "The map this plugin works on; empty = its kind's own.")


class CostmapNavigationServer(MapServer):
    """Navigation on a global and a local costmap."""

    backend: ClassVar[str] = "costmap"
    map_type = LayeredCostmap
    plugin_declaration: ClassVar[type[PluginDeclaration]] = CostmapPluginDeclaration
    plugin_adapters: ClassVar[Sequence[Adapter]] = (wrap_nav_core,)
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {
        "global_costmap": CostmapParameters,
        "local_costmap": CostmapParameters,
    }
    map_names: ClassVar[Sequence[str]] = ("local", "global")
    car_controllers: ClassVar[Sequence[str]] = (
        "costmap.regulated_pure_pursuit",
        "costmap.mppi with motion_model: ackermann",
    )

    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap

    def load_map(self, config: Config) -> None:
        """Build the maps, and note where they have different outlines of the robot."""
        super().load_map(config)
        of_plans, of_motions = (one.unpadded_footprint for one in (self.global_costmap, self.local_costmap))
        drives = any(spec.kind is PluginKind.CONTROLLER for spec in config.plugins)
        if drives and not np.array_equal(of_plans.vertices, of_motions.vertices):
            self.runtime.events.emit(EventKind.MAP, self.local_view, message=_two_outlines(of_plans, of_motions))

    def serve_maps(self, config: Config) -> Iterator[ServedMap[Any]]:
        """Build the global costmap, then the local one."""
        static_maps = StaticMaps(self.runtime.transforms)
        for key in ("global_costmap", "local_costmap"):
            served = self._serve(config, key, static_maps)
            setattr(self, key, served.map)
            yield served

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add both maps and the one this plugin is bound to."""
        own = "global" if kind in (PluginKind.PLANNER, PluginKind.REFINER) else "local"
        bound = self.global_costmap if (options.get("costmap") or own) == "global" else self.local_costmap
        frame = self.runtime.parameters.global_frame
        if own == "global" and bound.frame_id != frame:
            raise ValueError(f"plans are made in the frame {frame!r}, but its costmap is in {bound.frame_id!r}")
        return CostmapContext(
            **vars(base),
            navigation_map=bound,
            maps={"local": self.local_costmap, "global": self.global_costmap},
            transforms=self.runtime.transforms,
            scans=self.scans,
        )

    ground_is_level = True

    map_view_type = GridView

    @property
    def map_views(self) -> tuple[str, ...]:
        """Both maps."""
        return ("global_costmap", self.local_view)

    local_view = "local_costmap"

    def map_view(self, name: str = "") -> GridView:
        """The costs of a map, of the global one without a name; 1 for what the robot's middle must not touch."""
        costmap = (self.local_costmap if name == self.local_view else self.global_costmap).snapshot()
        costs = np.divide(costmap.cells, np.float32(INSCRIBED), dtype=np.float32)
        costs[costmap.cells == UNKNOWN] = np.nan
        geometry = costmap.geometry
        return GridView(costs, (geometry.origin_x, geometry.upper_x, geometry.origin_y, geometry.upper_y))

    def layer_costs(self, view: str, x: float, y: float) -> Mapping[str, float]:
        """The cost of a cell as each layer has left it; that of the last layer is the map's."""
        costmap = self.local_costmap if view == self.local_view else self.global_costmap
        costs = costmap.costs_after_layers(x, y)
        return {name: math.nan if cost == UNKNOWN else cost / INSCRIBED for name, cost in costs.items()}

    def footprint_changes(self, footprint: str | Sequence[Sequence[float]] | float) -> Mapping[str, Any]:
        """An outline, or the radius of a round robot."""
        if isinstance(footprint, bool) or footprint is None:
            came = describe_value(footprint)
            raise ParameterError(f"footprint: expected corners [[x, y], ...] or a radius in m, got {came}")
        if isinstance(footprint, Real):
            return {"footprint": None, "robot_radius": float(footprint)}
        return {"footprint": footprint}

    @classmethod
    def config_for_map(cls, file: Path, unknown_is_free: bool = True) -> str | None:
        """Take every image format this package reads, and map_server's YAML."""
        if file.suffix.lower() not in MAP_SUFFIXES:
            return None
        keys = {"allow_unknown": json.dumps(unknown_is_free), "track_unknown": json.dumps(not unknown_is_free)}
        return BARE_MAP.format(file=json.dumps(str(file)), **keys)

    @classmethod
    def read_floor(cls, file: Path) -> FloorMap | None:
        """Read every image format this package reads, and map_server's YAML; resample a map with a yaw."""
        if file.suffix.lower() not in MAP_SUFFIXES:
            return None
        try:
            content = load_map(file).axis_aligned()
        except MapError as error:
            expected, _, got = error.reason.removeprefix("expected ").rpartition(", got ")
            found = error.findings or [Finding(str(error.file), 1, "", expected or "a map", got)]
            raise ConfigError(found) from error
        return FloorMap(content.occupancy, content.resolution, *content.origin[:2])

    def _serve(self, config: Config, key: str, static_maps: StaticMaps) -> ServedMap[LayeredCostmap]:
        section = config.sections[key]
        parameters = cast(CostmapParameters, section.parameters)
        layer_classes: dict[str, Any] = {layer.type_name: layer.layer_class for layer in section.layers}
        try:
            costmap = build_layered_costmap(
                parameters,
                {layer.name: cast(Any, layer.parameters) for layer in section.layers},
                load_layer=layer_classes.__getitem__,
                base_folder=config.path.parent,
                transforms=self.runtime.transforms,
                static_maps=static_maps,
            )
        except LayerListError as error:
            raise LayerListError(f"{config.path}: {key}: {error}") from error
        frequency, tolerance = parameters.update_frequency, parameters.transform_tolerance
        return ServedMap(costmap, self.runtime, key, parameters, frequency, tolerance)


def _two_outlines(of_plans: Footprint, of_motions: Footprint) -> str:
    """What is suspicious about an outline on the global map and another one on the local map."""
    here, there = of_motions.circumscribed_radius, of_plans.circumscribed_radius
    return (
        f"local_costmap: the robot's outline, {here:.3g} m to its farthest corner, is another one on global_costmap, "
        f"{there:.3g} m: what fits on one map may be refused on the other; give both the same robot_radius or footprint"
    )
