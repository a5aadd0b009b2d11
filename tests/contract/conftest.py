"""One room as a costmap and one field as a mesh, with a wall that has a gap and a place that cannot be reached."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.plugins import CostmapContext
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.plugins import MeshContext


def is_wall(x, y):
    """Wall at x = 4 with a gap above y = 4.2, and a closed closet around (7.2, 5.2)."""
    wall = (np.abs(x - 4.0) < 0.11) & (y < 4.2)
    from_closet = np.maximum(np.abs(x - 7.2), np.abs(y - 5.2))
    return wall | ((from_closet > 0.55) & (from_closet < 0.8))


@pytest.fixture(scope="session")
def costmap_site():
    """A room of 8 m x 6 m with a robot of 0.2 m radius."""
    x, y = np.meshgrid((np.arange(160) + 0.5) * 0.05, (np.arange(120) + 0.5) * 0.05)
    cells = np.where(is_wall(x, y), 254, 0).astype(np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 254
    layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
    parameters = CostmapParameters(resolution=0.05, robot_radius=0.2, max_age=0.0, layers=layers)

    def make_map():
        costmap = build_layered_costmap(parameters, static_map=Costmap(cells.copy(), 0.05))
        costmap.update(Pose.planar(1.0, 1.0), 0.0)
        return costmap

    def make_context(base):
        costmap = make_map()
        return CostmapContext(**vars(base), global_costmap=costmap, local_costmap=costmap, costmap=costmap)

    return SimpleNamespace(make_context=make_context, watched=[])


class PaintedLayer(MeshLayer):
    """Lethal where the wall is."""

    def compute(self):
        lethal = is_wall(*self.topology.vertices[:, :2].T)
        return np.where(lethal, np.inf, 0.0).astype(np.float32), lethal


@pytest.fixture(scope="session")
def mesh_site():
    """The same walls painted on a flat field of triangles of 0.1 m."""
    mesh_map = MeshMap.from_heights(np.zeros((61, 81)), 0.1, 0.1)
    layer = PaintedLayer(LayerContext("walls", mesh_map.topology, mesh_map.locator, PaintedLayer.Parameters()))
    layer.recompute()
    mesh_map.set_layers(LayerGraph([layer]), "walls", 0.0)
    snapshot = mesh_map.snapshot()
    watched = [snapshot.costs, snapshot.lethal, snapshot.edge_weights, mesh_map.vertices]
    return SimpleNamespace(make_context=lambda base: MeshContext(**vars(base), mesh_map=mesh_map), watched=watched)


PLUGINS = """
recovery_behaviors:
  - {name: wait, type: wait}
  - {name: rotate, type: rotate}
  - {name: back_up, type: back_up}
  - {name: clear, type: clear}
  - {name: relax, type: relax}
"""

COSTMAP = (
    PLUGINS
    + """
backend: costmap
planners: [{name: astar, type: astar}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
global_costmap:
  width: 12.0
  height: 8.0
  resolution: 0.1
  robot_radius: 0.3
  layers: [{name: obstacles, type: obstacle}, {name: inflation, type: inflation}]
  obstacles: {sources: {lidar: {obstacle_max_range: 4.5, raytrace_max_range: 5.0}}}
  inflation: {inflation_radius: 0.5}
local_costmap:
  rolling_window: true
  width: 6.0
  height: 6.0
  resolution: 0.05
  robot_radius: 0.3
  update_frequency: 10.0
  layers: [{name: obstacles, type: obstacle}, {name: inflation, type: inflation}]
  obstacles: {sources: {lidar: {obstacle_max_range: 4.5, raytrace_max_range: 5.0}}}
  inflation: {inflation_radius: 0.5}
"""
)

MESH = (
    PLUGINS
    + """
backend: mesh
planners: [{name: cvp, type: cvp}]
controllers: [{name: follower, type: path_follower}]
mesh_map:
  mesh_file: floor.ply
  inscribed_radius: 0.3
  default_layer: inflation
  layers: [{name: obstacles, type: obstacle}, {name: inflation, type: inflation, inputs: [obstacles]}]
  obstacles: {sources: [lidar]}
  inflation: {inscribed_radius: 0.3, inflation_radius: 0.5, lethal_value: .inf, inscribed_value: 1.0}
"""
)


def costmap_server(rig, **parameters):
    return rig.server(COSTMAP, parameters)


def mesh_server(rig, **parameters):
    trimesh.Trimesh(*heightfield_mesh(np.zeros((81, 121)), 0.1, 0.1), process=False).export(rig.folder / "floor.ply")
    return rig.server(MESH, parameters)


BACKENDS = {"costmap": costmap_server, "mesh": mesh_server}


@pytest.fixture(scope="session")
def backends():
    """What makes the servers of the backends for the conformance suite, by name."""
    return BACKENDS


@pytest.fixture(params=BACKENDS)
def make_server(request):
    """What makes the server of a backend for the conformance suite, one backend after the other."""
    return BACKENDS[request.param]
