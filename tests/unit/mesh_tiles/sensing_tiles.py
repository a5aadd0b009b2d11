"""Maps of tiles on which a lidar marks obstacles, and their naive twin: the whole mesh with the same layers."""

import numpy as np
from test_tile_server import pose
from tiled_terrains import BLOCKS, PARAMETERS, SPACING, WholeMap

from mbf_abstract.maps.queries import PlaceQuery
from mbf_abstract.maps.sensing import RangeScan
from mbf_mesh_nav.layers.obstacle import ObstacleParameters
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.windows.window_settings import SHOWN, window_settings
from mbf_mesh_nav.tiles.tiled_map import TiledMap

SIDE = 16.0
RADIUS = BLOCKS["inflation"]["inflation_radius"]
ENTRIES = (
    MeshLayerEntry(name="obstacles", type="obstacle"),
    MeshLayerEntry(name="around", type="inflation", inputs=("obstacles",)),
)
SENSING = {
    "obstacles": {"sources": ("lidar",), "decay_time": np.inf, "clearing": False},
    "around": {"inscribed_radius": 0.3, "inflation_radius": RADIUS, "lethal_value": np.inf},
}
OBSTACLES = """  window: 16.0
  layers: [{name: obstacles, type: obstacle}, {name: around, type: inflation, inputs: [obstacles]}]
  obstacles: {sources: [lidar]}
  around: {inscribed_radius: 0.3, inflation_radius: 0.8, lethal_value: .inf}
"""
NEAR = PlaceQuery(safety_dist=1.0)
SENSING_OFF = ObstacleParameters(sources=("lidar",), enabled=False)


def sensing_map(folder, blocks=SENSING, side=SIDE, entries=ENTRIES, **more):
    tiled = TiledMap(folder, **more)
    return TiledNavigationMap(tiled, window=window_settings(tiled, side, entries, blocks))


class SensingWhole(WholeMap):
    """The naive twin: the whole mesh with the same layers, and the same combination of stored and sensed ones."""

    def __init__(self, heights, blocks=SENSING, entries=ENTRIES):
        entries = (*entries, MeshLayerEntry(name=SHOWN, type="max_combination", inputs=("safe", "around")))
        parameters = PARAMETERS.model_copy(update={"layers": (*PARAMETERS.layers, *entries)})
        super().__init__(heights, parameters, {**BLOCKS, **blocks})
        self.place = {tuple(position): number for number, position in enumerate(self.map.vertices.tolist())}

    def look(self):
        """Plan and answer on the map as it is now."""
        self.snapshot = self.map.snapshot()
        self.blocked = self.snapshot.blocked(1.0)


def scan(robot, points, stamp):
    return RangeScan.of_points("lidar", points, np.add(robot, (0.0, 0.0, 0.5)), stamp, "map")


def boxes_around(robot, rng, whole, count=3, reach=3.5):
    """Points above the surface around a robot, as of small boxes: as far as any window reaches."""
    middles = robot[:2] + rng.uniform(-reach, reach, (count, 2))
    xy = (middles[:, None] + rng.uniform(-0.3, 0.3, (count, 6, 2))).reshape(-1, 2)
    return above_ground(whole, xy, 0.6)


def above_ground(whole, xy, height):
    """Points (n, 3) so high above the surface, but none over a hole."""
    sky = np.column_stack([xy, np.full(len(xy), 50.0)])
    faces, depths = whole.map.locator.cast_rays(sky, (0.0, 0.0, -1.0))
    return (sky - np.column_stack([0.0 * xy, depths - height]))[faces >= 0]


def drive(tiled, whole, way, seed=0):
    """Show both maps the same along a way; yields after each step."""
    rng = np.random.default_rng(seed)
    for step, robot in enumerate(way):
        seen = scan(robot, boxes_around(robot, rng, whole), float(step))
        for one in (tiled, whole.map):
            one.insert_scan(seen)
            one.update(pose(robot), float(step))
        yield robot


def assert_same_costs(tiled, whole, margin=RADIUS + SPACING):
    """In the window, but for what lies within the layers' reach of its edge, costs are those of the whole mesh."""
    window = tiled.window_map
    inner = np.abs(window.vertices[:, :2] - tiled._window.now.middle).max(axis=1) < 0.5 * SIDE - margin
    order = np.array([whole.place[tuple(position)] for position in window.vertices.tolist()])[inner]
    ours, exact = window.snapshot(), whole.map.snapshot()
    assert np.array_equal(ours.lethal[inner], exact.lethal[order])
    assert np.allclose(ours.costs[inner], exact.costs[order], rtol=1e-6)
    return int((window.layers["around"].costs[inner] > 0.0).sum())
