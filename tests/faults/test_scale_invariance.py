"""Fault table, row 25: meshes far from their origin, in millimetres or in kilometres, and costmaps alike.

The same surface is planned on in metres at the origin and again elsewhere and in another unit, with the parameters in
that unit too: the answers must be the same but for unit and place.
"""

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PluginKind
from mbf_abstract.testing.contract.rig import rig
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.plugins import CostmapContext
from mbf_mesh_nav.layers.steepness import SteepnessLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.plugins import MeshContext

START, GOAL, BURIED = (0.37, 0.41), (4.58, 4.33), (2.5, 2.5)
PLACES = [
    pytest.param(1.0, (10_000.0, -10_000.0, 500.0), id="10 km away"),
    pytest.param(1000.0, (0.0, 0.0, 0.0), id="in millimetres"),
    pytest.param(1000.0, (1e7, 1e7, 1e6), id="in millimetres and 10 km away"),
    pytest.param(0.001, (0.0, 0.0, 0.0), id="in kilometres"),
]


def heights():
    """A 5 m field of bumps around a steep pillar, rough enough that no two ways are equally long."""
    x, y = np.meshgrid(np.arange(51) * 0.1, np.arange(51) * 0.1)
    bumps = 0.1 * np.sin(1.3 * x) * np.cos(1.1 * y) + 0.02 * np.random.default_rng(1).random(x.shape)
    return bumps + 2.0 * (np.maximum(abs(x - 2.5), abs(y - 2.5)) < 0.65)


def surface(scale=1.0, offset=(0.0, 0.0, 0.0)):
    vertices, faces = heightfield_mesh(heights(), 0.1, 0.1)
    mesh_map = MeshMap.from_arrays(vertices * scale + np.array(offset), faces)
    parameters = SteepnessLayer.Parameters(threshold=0.6)
    layer = SteepnessLayer(LayerContext("slopes", mesh_map.topology, mesh_map.locator, parameters))
    layer.recompute()
    mesh_map.set_layers(LayerGraph([layer]), "slopes", 1.0)
    return mesh_map


def in_unit(parameters_class, scale):
    """Default parameters whose lengths are given in another unit."""
    lengths = {
        name: field.default * scale
        for name, field in parameters_class.model_fields.items()
        if field.json_schema_extra["unit"] in ("m", "m/rad")
    }
    return parameters_class.model_construct(**lengths)


def plan_on_mesh(name, goal, scale=1.0, offset=(0.0, 0.0, 0.0)):
    """Ask for a plan; the path comes back in metres at the origin."""
    mesh_map = surface(scale, offset)
    planner_class = PluginRegistry("mesh").load(PluginKind.PLANNER, name)

    def pose(x, y):
        z = heights()[round(y / 0.1), round(x / 0.1)]
        return Pose.planar(x * scale + offset[0], y * scale + offset[1], 0.3, z * scale + offset[2])

    def make_context(base):
        return MeshContext(**vars(base), navigation_map=mesh_map)

    with rig(planner_class, make_context, in_unit(planner_class.Parameters, scale), pose(*START)) as made:
        result = made.plugin.make_plan(PlanRequest(pose(*START), pose(*goal)))
    return result, None if result.path is None else (result.path.positions - np.array(offset)) / scale


@pytest.mark.parametrize(("scale", "offset"), PLACES)
@pytest.mark.parametrize("name", PluginRegistry("mesh").names(PluginKind.PLANNER))
def test_a_mesh_planner_finds_the_same_path_in_every_unit_and_place(name, scale, offset):
    result, expected = plan_on_mesh(name, GOAL)
    assert result.success, result.message
    _, path = plan_on_mesh(name, GOAL, scale, offset)
    far = max(np.linalg.norm(expected - point, axis=1).min() for point in path)
    assert far < 0.05, "no point of the path is elsewhere"
    assert path_length(path) == pytest.approx(path_length(expected), rel=1e-3)


@pytest.mark.parametrize(("scale", "offset"), PLACES)
@pytest.mark.parametrize("name", PluginRegistry("mesh").names(PluginKind.PLANNER))
def test_a_lethal_goal_stays_blocked_in_every_unit_and_place(name, scale, offset):
    edge = (BURIED[0] + 0.6, BURIED[1])
    assert plan_on_mesh(name, edge)[0].outcome == GetPathOutcome.BLOCKED_GOAL
    assert plan_on_mesh(name, edge, scale, offset)[0].outcome == GetPathOutcome.BLOCKED_GOAL


@pytest.mark.parametrize(("scale", "offset"), PLACES)
@pytest.mark.parametrize("name", ["astar", "dijkstra", "theta_star", "hybrid_astar"])
def test_a_costmap_planner_finds_the_same_path_far_from_the_origin(name, scale, offset):
    if scale != 1.0:
        offset = tuple(1e6 * np.array([1.0, 0.1, 0.0]))  # a costmap's unit is the metre; it can only be far away
    cells = np.zeros((100, 100), np.uint8)
    cells[30:70, 30:70] = 254
    expected = plan_on_costmap(name, cells, (0.0, 0.0))
    path = plan_on_costmap(name, cells, offset[:2])
    assert path == pytest.approx(expected, abs=1e-6)


def plan_on_costmap(name, cells, origin):
    planner_class = PluginRegistry("costmap").load(PluginKind.PLANNER, name)
    layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
    parameters = CostmapParameters(resolution=0.05, robot_radius=0.2, max_age=0.0, layers=layers)
    costmap = build_layered_costmap(parameters, static_map=Costmap(cells, 0.05, *origin))
    costmap.update(None, 0.0)

    def make_context(base):
        return CostmapContext(**vars(base), navigation_map=costmap)

    start, goal = (Pose.planar(x + origin[0], y + origin[1], 0.7) for x, y in ((0.62, 0.62), (4.37, 4.12)))
    with rig(planner_class, make_context, None, start) as made:
        result = made.plugin.make_plan(PlanRequest(start, goal))
    assert result.success, result.message
    return result.path.positions[:, :2] - np.array(origin)


def path_length(points):
    return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
