"""The accepted figures of the field: routes on the published maps that must exist, be cut, and have a known length."""

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner


def build(file, entries, blocks, edge_cost_factor=0.0):
    parameters = MeshMapParameters(
        mesh_file=str(file),
        layers=tuple(MeshLayerEntry(name=name, type=name, inputs=inputs) for name, inputs in entries.items()),
        default_layer="inflation",
        edge_cost_factor=edge_cost_factor,
    )
    return build_mesh_map(parameters, blocks)


def lava_map(shared_data, inscribed_radius):
    """floor_is_lava with the thresholds of the reference configuration."""
    guards = {"border": (), "height_diff": (), "roughness": ()}
    entries = guards | {"weighted_sum": tuple(guards), "inflation": ("weighted_sum",)}
    blocks = {
        "border": {"border_cost": 1.0, "threshold": 0.2},
        "height_diff": {"threshold": 0.2, "radius": 0.3},
        "roughness": {"threshold": 0.8, "radius": 0.3},
        "inflation": {
            "inscribed_radius": inscribed_radius, "inflation_radius": 1.5, "lethal_value": np.inf,
            "inscribed_value": 1.0, "cost_scaling_factor": 2.0,
        },
    }  # fmt: skip
    return build(shared_data / "meshes/mesh_navigation_tutorials/floor_is_lava_map.ply", entries, blocks)


def test_the_lava_plateaus_are_joined_for_a_robot_of_35_cm_and_cut_for_one_of_40(shared_data, make_plugin):
    # West end to west end; published for ends not named exactly: 19.5 m by CVP, 20.8 m along edges.
    request = PlanRequest(Pose.planar(-0.6, -7.1, z=-0.1), Pose.planar(-0.6, 0.2, z=-0.1))
    joined = lava_map(shared_data, 0.35)
    over_faces = make_plugin(CVPPlanner, joined, cost_limit=0.99).make_plan(request)
    along_edges = make_plugin(DijkstraPlanner, joined, cost_limit=0.99).make_plan(request)
    assert over_faces.success, over_faces.message
    assert 19.0 < over_faces.path.length < 20.5
    assert 1.04 < along_edges.path.length / over_faces.path.length < 1.08
    cut = make_plugin(CVPPlanner, lava_map(shared_data, 0.4), cost_limit=0.99).make_plan(request)
    assert cut.success and "lead along edges between blocked faces" in cut.message  # over no whole faces any more


def test_the_garage_route_from_the_ground_to_the_roof_has_the_accepted_length(shared_data, make_plugin):
    guards = ("border", "steepness")
    entries = {"border": (), "steepness": (), "max_combination": guards, "inflation": ("max_combination",)}
    blocks = {
        "border": {"threshold": 0.2},
        "steepness": {"threshold": 0.7},
        "inflation": {"inscribed_radius": 0.4, "inflation_radius": 1.5, "lethal_value": np.inf, "inscribed_value": 1.0},
    }
    garage = build(shared_data / "meshes/derived/parking_garage_1m.ply", entries, blocks)
    request = PlanRequest(Pose((-4.37, -18.43, 0.0)), Pose((24.37, 58.43, 18.0)))
    result = make_plugin(CVPPlanner, garage, cost_limit=0.99).make_plan(request)
    assert result.success, result.message
    assert 180.0 <= result.path.length <= 188.0
    assert (np.diff(result.path.positions[:, 2]) > -0.2).all()  # up the ramps, never through a floor
