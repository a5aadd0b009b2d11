"""Small terrains, the settings of their maps, and the exact plan on the whole mesh."""

import numpy as np

from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.search.leg_search import LegQuery, propagate_from, vertex_path_leg
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings

SPACING = 0.5
LAYERS = (
    ("border", "border", ()),
    ("steepness", "steepness", ()),
    ("height_diff", "height_diff", ()),
    ("lethal", "max_combination", ("border", "steepness", "height_diff")),
    ("inflation", "inflation", ("lethal",)),
    ("roughness", "roughness", ()),
    ("effort", "weighted_sum", ("steepness", "roughness")),
    ("safe", "max_combination", ("inflation", "effort")),
)
PARAMETERS = MeshMapParameters(
    layers=tuple(MeshLayerEntry(name=name, type=kind, inputs=inputs) for name, kind, inputs in LAYERS),
    edge_cost_factor=1.5,
    inscribed_radius=0.3,
)
BLOCKS = {
    "steepness": {"threshold": 0.7, "combination_weight": 0.6},
    "height_diff": {"threshold": 0.5, "height_limit": 1.0, "radius": 0.8},
    "roughness": {"threshold": 3.0, "radius": 0.8, "combination_weight": 0.4},
    "inflation": {"inscribed_radius": 0.3, "inflation_radius": 1.2, "lethal_value": np.inf},
}


def settings(tile_size=12.0, **changes):
    return TileSettings(mesh_map=PARAMETERS, layer_blocks=BLOCKS, tile_size=tile_size, **changes)


def terrain(side, seed, walls=12):
    """Hills with holes; with many walls a maze."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(SPACING * np.arange(side), SPACING * np.arange(side))
    heights = np.zeros((side, side))
    for _ in range(12):
        length, angle = rng.uniform(5.0, 40.0), rng.uniform(0.0, 2.0 * np.pi)
        along = np.cos(angle) * x + np.sin(angle) * y
        heights += 0.03 * length * np.sin(2.0 * np.pi * along / length + rng.uniform(0.0, 6.0))
    for _ in range(walls):
        column, row = rng.integers(5, side - 5, 2)
        width, depth = rng.integers(1, 8, 2)
        heights[row - width : row + width, column - depth : column + depth] = np.nan
    return heights


class WholeMap:
    """The naive twin: one mesh of everything, planned on exactly."""

    def __init__(self, heights, parameters=PARAMETERS, blocks=BLOCKS):
        vertices, faces = heightfield_mesh(heights, SPACING, SPACING, keep_grid=True)
        self.map = build_mesh_map(parameters, blocks, vertices=vertices, faces=faces)
        self.snapshot = self.map.snapshot()
        self.blocked = self.snapshot.blocked(1.0)

    def cost(self, start, goal):
        """Of the cheapest path along edges; inf without one."""
        ends = [on_surface(self.map.topology, self.map.locator, np.array(end), 0.4) for end in (start, goal)]
        query = LegQuery(ends[0], ends[1], self.snapshot, self.blocked, np.zeros(1, dtype=np.uint8))
        search = self.map, self.snapshot, self.blocked, ends[0], query.cancel_flag, ends[1]
        distances, predecessors, _ = propagate_from(*search)
        leg = vertex_path_leg(self.map, query, distances, predecessors)
        return np.inf if leg is None else leg.cost

    def free_places(self, count, seed):
        """Positions inside free faces (count, 3)."""
        rng = np.random.default_rng(seed)
        free = np.flatnonzero(~self.blocked[self.map.faces].any(axis=1))
        weights = rng.dirichlet(np.ones(3), count)
        corners = self.map.vertices[self.map.faces[rng.choice(free, count)]]
        return (weights[:, :, None] * corners).sum(axis=1)
