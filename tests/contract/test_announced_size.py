"""Robots announce how large they are, from the outline that each map has of them."""

import numpy as np
import pytest
import trimesh

from mbf_abstract.server.announcer import Announcer
from mbf_abstract.server.standing_server import read_config_text, standing_server
from mbf_abstract.traffic.traffic import SharedChannel
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CORNERS = "[[0.4, 0.3], [0.4, -0.3], [-0.3, -0.3], [-0.3, 0.3]]"
COSTMAP = f"{{width: 4.0, height: 4.0, footprint_padding: 0.0, footprint: '{CORNERS}'}}"
OUTLINES = {
    "costmap": (f"global_costmap: {COSTMAP}\nlocal_costmap: {COSTMAP}", 0.5),
    "mesh": ("mesh_map: {mesh_file: MESH, inscribed_radius: 0.35, layers: []}", 0.35),
}


@pytest.mark.parametrize("backend", OUTLINES)
def test_a_robot_announces_how_large_it_is(backend, tmp_path):
    text, radius = OUTLINES[backend]
    trimesh.Trimesh(*heightfield_mesh(np.zeros((9, 9)), 0.5, 0.5), process=False).export(tmp_path / "floor.ply")
    text = f"backend: {backend}\nplanners: []\ncontrollers: []\n{text}".replace("MESH", str(tmp_path / "floor.ply"))
    cls, config = read_config_text(text)
    channel = SharedChannel()
    with standing_server(cls, config) as server:
        Announcer(server, "anna", channel).announce()
    assert channel.latest()[0].radius == pytest.approx(radius, rel=0.01)
