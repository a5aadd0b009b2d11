"""What a tiled map is built with, and how far its layers look around a vertex."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbf_abstract.maps.layers.layer_list import PlannedLayer
from mbf_mesh_nav.map.layer import MeshLayer
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.building.sources import TileSource
from mbf_mesh_nav.tiles.index import CostProfile, TileIndex

PORTALS_OF_A_SIDE = 16
"""Portals along the side of a tile, unless a length is given."""


@dataclass(frozen=True)
class TileSettings:
    """What a tiled map is built with.

    Attributes
    ----------
    mesh_map : MeshMapParameters
        Its layers, default layer, edge cost factor and inscribed radius count; the mesh comes from the source.
    layer_blocks : mapping
        Layer name -> parameters.
    profiles : mapping
        Cost profiles by name; without any, one called "default" with the default layer and the edge cost factor.
    tile_size, portal_length : float
        Sides of tiles and of the cubes of portals [m]; a portal length of 0 is a sixteenth of a tile. Shorter portals
        make the lower bounds closer and the build longer.
    """

    mesh_map: MeshMapParameters
    layer_blocks: Mapping[str, Any] = field(default_factory=dict)
    profiles: Mapping[str, CostProfile] = field(default_factory=dict)
    tile_size: float = 256.0
    portal_length: float = 0.0
    frame_id: str = "map"

    def __post_init__(self) -> None:
        if not (self.tile_size > 0.0 and 0.0 <= self.portal_length <= self.tile_size):
            raise ValueError(
                f"expected a tile size above 0 and a portal length of at most that, "
                f"got {self.tile_size:g} and {self.portal_length:g} m"
            )

    @property
    def cube(self) -> float:
        """Side of the cubes of portals [m]."""
        return self.portal_length or self.tile_size / PORTALS_OF_A_SIDE

    def all_profiles(self) -> dict[str, CostProfile]:
        """The profiles, or the one of the map's own parameters."""
        return dict(self.profiles) or {"default": CostProfile(edge_cost_factor=self.mesh_map.edge_cost_factor)}

    def digest(self, source: TileSource) -> str:
        """Hexadecimal SHA-256 of a source and of these settings, but for those that say how a mesh is read and kept."""
        blocks = {name: getattr(block, "model_dump", lambda b=block: b)() for name, block in self.layer_blocks.items()}
        profiles = {name: one.model_dump() for name, one in self.all_profiles().items()}
        sizes = [TileIndex.model_fields["version"].default, self.tile_size, self.cube, self.frame_id]
        wanted = self.mesh_map.model_dump(include={"layers", "default_layer", "edge_cost_factor", "inscribed_radius"})
        text = json.dumps([sizes, wanted, blocks, profiles], sort_keys=True, default=str)
        return hashlib.sha256(f"{source.digest()} {text}".encode()).hexdigest()


def reach_of(plan: list[PlannedLayer[MeshLayer]]) -> float:
    """How far [m] around a vertex lies whatever the values of any layer depend on, through its inputs.

    Raises
    ------
    MeshError
        A layer does not state how far it looks.
    """
    reach: dict[str, float] = {}
    for planned in plan:  # inputs first
        own = planned.layer_class.reach(planned.parameters)
        if not np.isfinite(own):
            layer = f"layer '{planned.entry.name}' of type {planned.entry.type}"
            hint = "height_diff needs a height_limit for it" if planned.entry.type == "height_diff" else ""
            raise MeshError("tiles", [f"{layer} does not state how far it looks around a vertex (reach)"], hint)
        reach[planned.entry.name] = own + max((reach[read] for read in planned.entry.reads), default=0.0)
    return max(reach.values())
