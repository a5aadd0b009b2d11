"""A planner for which it is an obstacle where somebody will be is noted, on both maps."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.server.standing_server import read_config_text, standing_server
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGURATIONS = {
    "costmap": """
backend: costmap
global_costmap:
  {width: 4.0, height: 4.0, robot_radius: 0.3, layers: [{name: moving, type: moving_obstacles}],
   moving: {sources: [lidar], prediction_cost: COST}}
planners: [{name: plan, type: astar}]
plan: {lethal_cost: 138}
controllers: []
""",
    "mesh": """
backend: mesh
mesh_map:
  {mesh_file: MESH, default_layer: moving, layers: [{name: moving, type: moving_obstacles}],
   moving: {sources: [lidar], prediction_cost: COST, inscribed_radius: 0.3}}
planners: [{name: plan, type: astar}]
plan: {cost_limit: 0.55}
controllers: []
""",
}


@pytest.mark.parametrize("backend", CONFIGURATIONS)
@pytest.mark.parametrize(("cost", "is_noted"), [(0.8, True), (0.5, False)])
def test_a_planner_that_never_plans_through_where_somebody_will_be_is_noted(tmp_path, backend, cost, is_noted):
    trimesh.Trimesh(*heightfield_mesh(np.zeros((9, 9)), 0.5, 0.5), process=False).export(tmp_path / "level.ply")
    text = CONFIGURATIONS[backend].replace("MESH", str(tmp_path / "level.ply")).replace("COST", str(cost))
    with standing_server(*read_config_text(text)) as server:
        notes = [note for note in server.notes if "prediction_cost" in note]
    assert bool(notes) == is_noted
    if is_noted:
        assert "planner 'plan': what costs 0.55 of an obstacle is one for it" in notes[0]
        assert "layer 'moving' has prediction_cost 0.8" in notes[0]
