"""The same places as a costmap and as a mesh: walls where a test wants them, and layers that sensors fill."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.plugins import CostmapContext
from mbf_mesh_nav.layers.combinations.max_combination import MaxCombinationLayer
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.layers.obstacle import ObstacleLayer
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import MeshSource
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings

RADIUS = 0.2  # m, of the robot


def is_wall(x, y):
    """Wall at x = 4 with a gap above y = 4.2, and a closed closet around (7.2, 5.2)."""
    wall = (np.abs(x - 4.0) < 0.11) & (y < 4.2)
    from_closet = np.maximum(np.abs(x - 7.2), np.abs(y - 5.2))
    return wall | ((from_closet > 0.55) & (from_closet < 0.8))


def costmap_of(lethal, **layers):
    """A room of 8 m x 6 m; ``layers`` are blocks by the types that are their names."""
    x, y = np.meshgrid((np.arange(160) + 0.5) * 0.05, (np.arange(120) + 0.5) * 0.05)
    cells = np.where(lethal(x, y), 254, 0).astype(np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 254
    entries = [{"name": name, "type": {"walls": "static"}.get(name, name)} for name in ("walls", *layers)]
    parameters = CostmapParameters(resolution=0.05, robot_radius=RADIUS, max_age=0.0, layers=tuple(entries))
    costmap = build_layered_costmap(parameters, layers, static_map=Costmap(cells, 0.05))
    costmap.update(Pose.planar(1.0, 1.0), 0.0)
    return costmap


class PaintedLayer(MeshLayer):
    """Lethal where the wall is."""

    lethal_at = staticmethod(is_wall)

    def compute(self):
        lethal = self.lethal_at(*self.topology.vertices[:, :2].T)
        return np.where(lethal, np.inf, 0.0).astype(np.float32), lethal


def mesh_of(lethal, **layers):
    """The same walls painted on a flat field of triangles of 0.1 m; ``obstacle`` and ``inflation`` come on top."""
    mesh_map = MeshMap.from_heights(np.zeros((61, 81)), 0.1, 0.1)
    mesh_map.inscribed_radius = RADIUS
    made = []

    def add(layer_class, name, block, *inputs):
        parameters = layer_class.Parameters.model_validate(block)
        made.append(layer_class(LayerContext(name, mesh_map.topology, mesh_map.locator, parameters, inputs)))
        if name == "walls":
            made[-1].lethal_at = lethal
        made[-1].recompute()
        return made[-1]

    shown = add(PaintedLayer, "walls", {})
    if "obstacle" in layers:
        shown = add(MaxCombinationLayer, "both", {}, shown, add(ObstacleLayer, "obstacle", layers["obstacle"]))
    if "inflation" in layers:
        shown = add(InflationLayer, "inflation", {"inscribed_radius": RADIUS, **layers["inflation"]}, shown)
    mesh_map.set_layers(LayerGraph(made), shown.name, 0.0)
    return mesh_map


@pytest.fixture(scope="session")
def costmap_site():
    """A room of 8 m x 6 m with a robot of 0.2 m radius."""

    def make_context(base):
        return CostmapContext(**vars(base), navigation_map=costmap_of(is_wall, inflation={}))

    return SimpleNamespace(make_context=make_context, watched=[])


@pytest.fixture(scope="session")
def mesh_site():
    """The same walls painted on a flat field of triangles of 0.1 m."""
    mesh_map = mesh_of(is_wall)
    snapshot = mesh_map.snapshot()
    watched = [snapshot.costs, snapshot.lethal, snapshot.edge_weights, mesh_map.vertices]

    def make_context(base):
        return MeshContext(**vars(base), navigation_map=mesh_map)

    return SimpleNamespace(make_context=make_context, watched=watched)


@pytest.fixture(params=["costmap", "mesh"])
def world(request):
    """One map after the other: ``world.map_of(lethal)``, ``world.sensing(rate)``, ``world.see(map, x, y)``."""
    costmap = request.param == "costmap"
    make = costmap_of if costmap else mesh_of

    def map_of(lethal):
        return make(lethal)

    def inflated(lethal):
        """A map that is inflated to 0.8 m."""
        return make(lethal, inflation={"inflation_radius": 0.8})

    def sensing(rate=0.0):
        """A map without walls whose layer ``obstacle`` listens to the sensor ``scan``, inflated to 0.8 m."""
        source = {"expected_update_rate": rate}
        block = {"sources": {"scan": source}} if costmap else {"sources": ["scan"], **source}
        return make(lambda x, y: x < -1.0, obstacle=block, inflation={"inflation_radius": 0.8})

    def see(navigation_map, *places, stamp=0.0, height=0.3):
        """Let the sensor see something at places (x, y) [m], and the map take it in."""
        navigation_map.insert_points("scan", [(x, y, height) for x, y in places], (3.0, 3.0, height), stamp)
        navigation_map.update(Pose.planar(3.0, 3.0), stamp)

    def cost_at(navigation_map, x, y):
        """Cost at a place, inf where it is lethal."""
        if costmap:
            cost = navigation_map.snapshot().cost_at(x, y)
            return np.inf if cost == 254 else float(cost)
        place, snapshot = navigation_map.locate_one((x, y, 0.0)), navigation_map.snapshot()
        vertex = navigation_map.faces[place.face][np.argmax(place.barycentric)]
        return np.inf if snapshot.lethal[vertex] else float(snapshot.costs[vertex])

    context = CostmapContext if costmap else MeshContext
    return SimpleNamespace(
        backend=request.param,
        map_of=map_of,
        inflated=inflated,
        sensing=sensing,
        see=see,
        cost_at=cost_at,
        context=context,
    )


# ------------------------------------------------------------------------------------------------- whole backends
PLUGINS = """
recovery_behaviors:
  - {name: wait, type: wait}
  - {name: rotate, type: rotate}
  - {name: back_up, type: back_up}
  - {name: clear, type: clear}
  - {name: relax, type: relax}
  - {name: move_away, type: move_away}
"""

COSTMAP = (
    PLUGINS
    + """
backend: costmap
planners: [{name: astar, type: astar}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
refiners: [{name: smoother, type: smoother}]
global_costmap:
  width: 12.0
  height: 8.0
  resolution: 0.1
  robot_radius: 0.3
  layers:
    [{name: obstacles, type: obstacle}, {name: moving, type: moving_obstacles}, {name: inflation, type: inflation}]
  moving: {sources: [lidar]}
  obstacles:
    footprint_clearing_enabled: false
    sources: {lidar: {obstacle_max_range: 4.5, raytrace_max_range: 5.0}}
  inflation: {inflation_radius: 0.5}
local_costmap:
  rolling_window: true
  width: 6.0
  height: 6.0
  resolution: 0.05
  robot_radius: 0.3
  update_frequency: 10.0
  layers:
    [{name: obstacles, type: obstacle}, {name: moving, type: moving_obstacles}, {name: inflation, type: inflation}]
  moving: {sources: [lidar]}
  obstacles:
    footprint_clearing_enabled: false
    sources: {lidar: {obstacle_max_range: 4.5, raytrace_max_range: 5.0}}
  inflation: {inflation_radius: 0.5}
"""
)

SENSING_LAYERS = """\
  inscribed_radius: 0.3
  default_layer: safe
  layers:
    - {name: obstacles, type: obstacle}
    - {name: moving, type: moving_obstacles, inputs: [obstacles]}
    - {name: inflation, type: inflation, inputs: [moving]}
    - {name: safe, type: max_combination, inputs: [inflation, moving]}
  obstacles: {sources: [lidar]}
  moving: {sources: [lidar], inscribed_radius: 0.3}
  inflation: {inscribed_radius: 0.3, inflation_radius: 0.5, lethal_value: .inf, inscribed_value: 1.0}
"""

MESH = (
    PLUGINS
    + """
backend: mesh
planners: [{name: cvp, type: cvp}]
controllers: [{name: follower, type: path_follower}]
refiners: [{name: pulling, type: string_pulling}]
mesh_map:
  mesh_file: floor.ply
"""
    + SENSING_LAYERS
)

TILES = (
    PLUGINS
    + """
backend: tiles
planners: [{name: far, type: tiles.hierarchical}]
controllers: [{name: follower, type: path_follower}]
refiners: [{name: pulling, type: string_pulling}]
tiled_map:
  folder: floor
"""
    + SENSING_LAYERS
)

GRAPH = (
    PLUGINS
    + """
planners: [{name: dijkstra, type: "mbf_abstract.maps.graph.graph_planner:GraphPlanner"}]
controllers: [{name: follower, type: follow_path}]
"""
)

ELEVATION_GRID = (
    GRAPH
    + """
backend: elevation_grid:ElevationGridServer
elevation_grid: {file: flat.npy, resolution: 0.1, robot_radius: 0.3, obstacles: {sources: [lidar]}}
"""
)

OCCUPANCY_OCTREE = (
    GRAPH
    + """
backend: occupancy_octree:OctreeServer
occupancy_octree: {resolution: 0.2, width: 12.0, height: 8.0, robot_radius: 0.3, obstacles: {sources: [lidar]}}
"""
)


def costmap_server(rig, controller="regulated_pure_pursuit", **parameters):
    return rig.server(COSTMAP.replace("regulated_pure_pursuit", controller), parameters)


def mesh_server(rig, controller="path_follower", **parameters):
    trimesh.Trimesh(*heightfield_mesh(np.zeros((81, 121)), 0.1, 0.1), process=False).export(rig.folder / "floor.ply")
    return rig.server(MESH.replace("path_follower", controller), parameters)


def tiles_server(rig, **parameters):
    """On tiles of 5 m, whose borders cross the ways of the situations.

    Paths follow edges: the diagonals of this floor lead the way of the goals, so no path has a detour for them.
    """
    vertices, faces = heightfield_mesh(np.zeros((41, 61)), 0.2, 0.2)
    floor = MeshSource(vertices * (-1.0, 1.0, 1.0) + (12.0, 0.0, 0.0), faces[:, ::-1])
    layers = (MeshLayerEntry(name="slope", type="steepness"),)
    build_tiles(floor, rig.folder / "floor", TileSettings(mesh_map=MeshMapParameters(layers=layers), tile_size=5.0))
    return rig.server(TILES, parameters)


def elevation_grid_server(rig, **parameters):
    np.save(rig.folder / "flat.npy", np.zeros((81, 121)))
    return rig.server(ELEVATION_GRID, parameters)


def occupancy_octree_server(rig, **parameters):
    return rig.server(OCCUPANCY_OCTREE, parameters)


BACKENDS = {
    "costmap": costmap_server,
    "mesh": mesh_server,
    "tiles": tiles_server,
    "elevation_grid": elevation_grid_server,
    "occupancy_octree": occupancy_octree_server,
}


@pytest.fixture(scope="session", autouse=True)
def example_backends():
    """The example backends are imported by name, as a configuration does."""
    folder = str(Path(__file__).resolve().parents[2] / "examples" / "backends")
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)


@pytest.fixture(scope="session")
def backends():
    """What makes the servers of the backends for the conformance suite, by name."""
    return BACKENDS


@pytest.fixture(params=BACKENDS)
def make_server(request):
    """What makes the server of a backend for the conformance suite, one backend after the other."""
    return BACKENDS[request.param]
