"""The plugin interfaces of the costmap server: the map-free ones plus the two shared costmaps.

Take ``self.costmap.snapshot()`` once per call of the main method and work on that: it is a read-only copy that no
update changes under you, and taking it costs nothing while the map does not change. The two maps stay reachable as
``self.global_costmap`` and ``self.local_costmap``, e.g. for a recovery that clears both.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.plugins import (
    AbstractController,
    AbstractPlanner,
    AbstractRecovery,
    AbstractRefiner,
    PluginContext,
)
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap


@dataclass(frozen=True)
class CostmapContext(PluginContext):
    """What a costmap plugin is constructed with.

    Attributes
    ----------
    global_costmap, local_costmap : LayeredCostmap
        The two shared maps of the server.
    costmap : LayeredCostmap
        The one this plugin is bound to: planners and refiners the global one, controllers and recoveries the local
        one, unless the plugin's block says ``costmap: local`` or ``costmap: global``.
    transforms : TransformBuffer
        The frames of the maps; a local map may be in another one than goals, paths and robot poses.
    """

    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap
    costmap: LayeredCostmap
    transforms: TransformBuffer = field(default_factory=TransformBuffer, kw_only=True)


class _OnCostmaps:
    """Keeps the maps of the context; mixed into the four interfaces."""

    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap
    costmap: LayeredCostmap
    transforms: TransformBuffer

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)  # type: ignore[call-arg]  # the abstract interface follows in the base list
        self.global_costmap = context.global_costmap
        self.local_costmap = context.local_costmap
        self.costmap = context.costmap
        self.transforms = context.transforms

    def on_map(self, pose: Pose, costmap: LayeredCostmap | None = None) -> Pose:
        """Express a pose in the frame of a costmap, the plugin's own if none is given; raises TransformError."""
        return self.transforms.transform_pose(pose, (costmap or self.costmap).frame_id)


class CostmapPlanner(_OnCostmaps, AbstractPlanner):
    """A planner on ``self.costmap``."""


class CostmapController(_OnCostmaps, AbstractController):
    """A controller on ``self.costmap``."""


class CostmapRecovery(_OnCostmaps, AbstractRecovery):
    """A recovery behaviour that may look at and clear both costmaps."""


class CostmapRefiner(_OnCostmaps, AbstractRefiner):
    """A path refiner on ``self.costmap``."""
