"""The costmap server: the actions of Move Base Flex on 2D layered costmaps.

Two shared maps, made once and handed to all plugins: ``global_costmap`` (planners, refiners) and ``local_costmap``
(controllers); recoveries get both, and ``costmap: local | global`` at a plugin's declaration binds it to the other one.
Each map is updated at its own rate; before every control cycle the local one must be current.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import numpy as np

from mbf_abstract.config.configuration import Config, PluginDeclaration
from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.registry import Adapter
from mbf_abstract.maps.queries import MapQueries
from mbf_abstract.maps.scan_intake import ScanIntake
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import FloorMap, GridView
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.plugins import PluginContext, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.server.plugin_host import ServerError
from mbf_costmap_nav.files.map_description import MapError
from mbf_costmap_nav.files.map_io import load_map_file
from mbf_costmap_nav.grid.costmap import INSCRIBED, UNKNOWN
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.queries import CostmapQueries
from mbf_costmap_nav.map.served_costmap import ServedCostmap
from mbf_costmap_nav.planning.nav_core import wrap_nav_core
from mbf_costmap_nav.plugins import CostmapContext

Which = Literal["local", "global"]
"""One of the two maps, as a plugin's declaration names it."""

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


class CostmapNavigationServer(AbstractNavigationServer):
    """Navigation on a global and a local costmap."""

    backend: ClassVar[str] = "costmap"
    plugin_declaration: ClassVar[type[PluginDeclaration]] = CostmapPluginDeclaration
    plugin_adapters: ClassVar[Sequence[Adapter]] = (wrap_nav_core,)
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {
        "global_costmap": CostmapParameters,
        "local_costmap": CostmapParameters,
    }

    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap

    def load_map(self, config: Config) -> None:
        """Build both costmaps and start updating them."""
        self._global = self._serve(config, "global_costmap")
        self._local = self._serve(config, "local_costmap")
        self.global_costmap, self.local_costmap = self._global.costmap, self._local.costmap
        both = (self._global, self._local)
        self._scans = ScanIntake(self.runtime, {one.name: one.scan_target for one in both})
        for one in both:
            one.report_configuration_warnings()

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
        )

    @property
    def queries(self) -> MapQueries:
        """The map-independent questions on the costmaps."""
        return CostmapQueries(
            self.global_costmap,
            self.local_costmap,
            self.runtime.robot,
            self.runtime.transforms,
            self.runtime.clock,
            using=lambda costmap: (self._global if costmap is self.global_costmap else self._local).in_use(),
        )

    def take_scan(self, scan: RangeScan) -> None:
        """Feed a scan to every layer that listens to its source, as ``ScanIntake.take``, whose errors it raises."""
        self._scans.take(scan)

    ground_is_level = True

    @property
    def map_views(self) -> tuple[str, ...]:
        """Both maps."""
        return ("global_costmap", "local_costmap")

    def map_view(self, name: str = "") -> GridView:
        """The costs of a map, of the global one without a name; 1 for what the robot's middle must not touch."""
        costmap = (self.local_costmap if name == "local_costmap" else self.global_costmap).snapshot()
        costs = np.divide(costmap.cells, np.float32(INSCRIBED), dtype=np.float32)
        costs[costmap.cells == UNKNOWN] = np.nan
        geometry = costmap.geometry
        return GridView(costs, (geometry.origin_x, geometry.upper_x, geometry.origin_y, geometry.upper_y))

    # --------------------------------------------------------------------------------------- changes at run time
    def set_layer_parameters(self, costmap: Which, layer: str, /, **changes: Any) -> None:
        """Change parameters of a layer of one map, all or none; the map's next update takes them into its cells.

        Raises
        ------
        ServerError
            There is no such map or layer.
        ValueError
            A value is not legal (pydantic's ValidationError is one), the parameter is read once only, or the layer does
            not take it. Nothing is changed.
        """
        served = self._served(costmap)
        if layer not in served.costmap.layers:
            raise ServerError(f"the {costmap} costmap has no layer {layer!r}, only {list(served.costmap.layers)}")
        served.set_layer_parameters(layer, changes)

    def set_costmap_parameters(self, costmap: Which, /, **changes: Any) -> None:
        """Change parameters of one map itself, such as ``footprint_padding`` or ``max_age``; raises as for a layer."""
        self._served(costmap).set_parameters(changes)

    def set_footprint(self, footprint: str | Sequence[Sequence[float]] | float) -> None:
        """Replace the robot's outline on both maps, e.g. when it lifts a load.

        Parameters
        ----------
        footprint : text, list of (x, y) or number
            Corners [m] without padding, as in the configuration, or the radius [m] of a round robot.

        Raises
        ------
        ValueError
            It is no polygon, or no radius; nothing is changed.
        """
        changes = {"footprint": footprint}
        if isinstance(footprint, int | float):
            changes = {"footprint": None, "robot_radius": footprint}  # type: ignore[dict-item]
        old = {name: getattr(self._global.parameters, name) for name in changes}
        self._global.set_parameters(changes)
        try:
            self._local.set_parameters(changes)
        except BaseException:
            self._global.set_parameters(old)
            raise

    def _served(self, costmap: Which) -> ServedCostmap:
        if costmap not in ("global", "local"):
            raise ServerError(f"there is no costmap {costmap!r}, only global and local")
        return self._global if costmap == "global" else self._local

    # ------------------------------------------------------------------------------------------------- life cycle
    @contextmanager
    def using_map(self, kind: PluginKind) -> Iterator[None]:
        """Keep both maps updated: a plugin of any kind may be bound to either of them."""
        with self._global.in_use(), self._local.in_use():
            yield

    def map_problem(self) -> str:
        """Why the local costmap is not current, if it is not."""
        return self.local_costmap.stale_reason(self.runtime.clock.now())

    def close_map(self) -> None:
        """End the threads that update the maps."""
        for name in ("_global", "_local"):
            if hasattr(self, name):
                getattr(self, name).close()

    @classmethod
    def config_for_map(cls, file: Path, unknown_is_free: bool = True) -> str | None:
        """Take every image format this package reads, and map_server's YAML."""
        if file.suffix.lower() not in MAP_SUFFIXES:
            return None
        words = {"allow_unknown": json.dumps(unknown_is_free), "track_unknown": json.dumps(not unknown_is_free)}
        return BARE_MAP.format(file=json.dumps(str(file)), **words)

    @classmethod
    def read_floor(cls, file: Path) -> FloorMap | None:
        """Read every image format this package reads, and map_server's YAML; a map with a yaw is laid upright."""
        if file.suffix.lower() not in MAP_SUFFIXES:
            return None
        try:
            content = load_map_file(file).upright()
        except MapError as error:
            raise ConfigError([Finding(str(error.file), 1, "", "a map", error.reason)]) from error
        return FloorMap(content.occupancy, content.resolution, *content.origin[:2])

    def _serve(self, config: Config, key: str) -> ServedCostmap:
        section = config.sections[key]
        parameters = cast(CostmapParameters, section.parameters)
        layer_classes: dict[str, Any] = {layer.type_name: layer.layer_class for layer in section.layers}
        costmap = build_layered_costmap(
            parameters,
            {layer.name: cast(Any, layer.parameters) for layer in section.layers},
            load_layer=layer_classes.__getitem__,
            base_folder=config.path.parent,
            transforms=self.runtime.transforms,
        )
        return ServedCostmap(costmap, self.runtime, parameters, key)
