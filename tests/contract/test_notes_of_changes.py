"""What is suspicious on a map is noted once per change, and no longer once it holds no more, on both maps."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.events import EventKind
from mbf_abstract.server.standing_server import read_config_text, standing_server
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGURATIONS = {
    "costmap": """
backend: costmap
global_costmap:
  {width: 4.0, height: 4.0, robot_radius: 0.3, layers: [{name: fading, type: inflation}]}
planners: [{name: plan, type: astar}]
""",
    "mesh": """
backend: mesh
mesh_map: {mesh_file: MESH, default_layer: fading, layers: [{name: fading, type: steepness}], fading: {threshold: 0.5}}
planners: [{name: plan, type: astar}]
""",
}
PARAMETERS = {"costmap": ("global_costmap.fading", "cost_scaling_factor"), "mesh": ("mesh_map.fading", "threshold")}


@pytest.fixture(params=CONFIGURATIONS)
def server(request, tmp_path):
    """A server whose one layer warns of values above 1."""
    trimesh.Trimesh(*heightfield_mesh(np.zeros((9, 9)), 0.5, 0.5), process=False).export(tmp_path / "level.ply")
    text = CONFIGURATIONS[request.param].replace("MESH", str(tmp_path / "level.ply"))
    with standing_server(*read_config_text(text + "controllers: []\n")) as made:
        layer_name, key = PARAMETERS[request.param]
        layer = made.served[layer_name.split(".")[0]].map.layers["fading"]

        def warning():
            value = getattr(layer.parameters, key)
            return f"{key} {value:g} is much" if value > 1.0 else ""

        layer.configuration_warning = warning
        made.change = lambda value: made.set_layer_parameters(layer_name, **{key: value})
        yield made


def noted(server):
    return [note for note in server.notes if "is much" in note]


def test_a_note_stands_once_however_often_something_else_changes(server):
    server.change(1.5)
    (note,) = noted(server)
    assert "layer 'fading': " in note and "1.5 is much" in note
    for _ in range(3):
        server.change(1.5)
        server.served[note.split(":")[0]].report_configuration_warnings()
    assert noted(server) == [note]
    messages = [event.data["message"] for event in server.runtime.events.memory.of_kind(EventKind.MAP)]
    assert messages.count(note) == 1


def test_a_note_changes_with_what_it_is_about_and_goes_with_it(server):
    server.change(1.5)
    server.change(1.25)
    (note,) = noted(server)
    assert "1.25 is much" in note
    server.change(0.5)
    assert noted(server) == []
    assert server.runtime.events.memory.of_kind(EventKind.MAP)[-1].data["message"] == f"no longer: {note}"
    server.change(1.25)
    assert noted(server) == [note]
