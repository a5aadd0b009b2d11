"""The plugin interfaces of the mesh server: the abstract ones plus the mesh map.

A planner for meshes derives ``MeshPlanner`` and finds its map in ``self.mesh_map``; nothing else differs from
``mbf_abstract.plugins``. Work on one ``self.mesh_map.snapshot()`` per call: it never changes while you use it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mbf_abstract.maps.map_plugin import MapContext, MapPlugin
from mbf_abstract.plugins import AbstractController, AbstractPlanner, AbstractRecovery, AbstractRefiner
from mbf_mesh_nav.map.mesh_map import MeshMap


@dataclass(frozen=True)
class MeshContext(MapContext[MeshMap]):
    """What every plugin of the mesh server is constructed with; all share the one map."""


class MeshPlugin(MapPlugin):
    """Common part of the mesh interfaces: keeps the map of the context by its type."""

    map_type = MeshMap

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self.mesh_map = context.navigation_map


class MeshPlanner(MeshPlugin, AbstractPlanner):
    """Finds a path over the surface of a triangle mesh."""


class LocalMeshPlugin(MeshPlugin):
    """What a controller and a recovery have in common: they look at the map around the robot."""

    @classmethod
    def reach(cls, parameters: Any) -> float:
        """How far [m] around the robot it looks at the map with some parameters; inf = unknown.

        On a map of tiles it is given the part of the mesh that holds this at any time.
        """
        return math.inf


class MeshController(LocalMeshPlugin, AbstractController):
    """Follows a path over the surface of a triangle mesh."""

    @property
    def limit_factor(self) -> float:
        """At least 1: what a recovery behaviour grants at this time, see ``Slack.controller_factor``."""
        return self.relaxation.slack(self.clock.now()).controller_factor


class MeshRecovery(LocalMeshPlugin, AbstractRecovery):
    """Gets a robot on a triangle mesh out of trouble."""


class MeshRefiner(MeshPlugin, AbstractRefiner):
    """Improves a path on a triangle mesh."""
