"""The plugin interfaces of the costmap server: the map-free ones plus the two shared costmaps.

Take ``self.costmap.snapshot()`` once per call of the main method and work on that: it is a read-only copy that no
update changes under you, and taking it costs nothing while the map does not change. The two maps stay reachable as
``self.global_costmap`` and ``self.local_costmap``, e.g. for a recovery that clears both.
"""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.maps.map_plugin import MapContext, MapPlugin
from mbf_abstract.plugins import AbstractController, AbstractPlanner, AbstractRecovery, AbstractRefiner
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap


@dataclass(frozen=True)
class CostmapContext(MapContext[LayeredCostmap]):
    """What a costmap plugin is constructed with.

    Planners and refiners are bound to the global costmap, controllers and recoveries to the local one, unless the
    plugin's block sets ``costmap: local`` or ``costmap: global``. ``maps`` has both, under these names; without them
    the one costmap is both.
    """


class _OnCostmaps(MapPlugin):
    """Keeps the maps of the context by their types; mixed into the four interfaces."""

    map_type = LayeredCostmap

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self.costmap = context.navigation_map
        self.global_costmap = context.maps.get("global", self.costmap)
        self.local_costmap = context.maps.get("local", self.costmap)


class CostmapPlanner(_OnCostmaps, AbstractPlanner):
    """A planner on ``self.costmap``."""


class CostmapController(_OnCostmaps, AbstractController):
    """A controller on ``self.costmap``."""


class CostmapRecovery(_OnCostmaps, AbstractRecovery):
    """A recovery behaviour that may look at and clear both costmaps."""


class CostmapRefiner(_OnCostmaps, AbstractRefiner):
    """A path refiner on ``self.costmap``."""
