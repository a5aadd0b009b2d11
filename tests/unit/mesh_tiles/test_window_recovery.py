"""A recovery for meshes on a map of tiles: out of what sensors have marked, as on the whole mesh."""

import numpy as np
import pytest
from sensing_tiles import OBSTACLES
from test_tile_planning import build_storeys, storeys

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader

START = Pose.planar(9.4, 1.8)  # tiles meet at x = 10
ESCAPE = "recovery_behaviors: [{name: out, type: escape}]\nout: {max_distance: 3.0, speed: 0.6}\n"
LAYERS = OBSTACLES.replace("[lidar]}", "[lidar], expected_update_rate: 0.0}")
ON_TILES = "backend: tiles\nplanners: [{name: far, type: tiles.hierarchical}]\ntiled_map:\n  folder: map\n"
ON_MESH = "backend: mesh\nplanners: [{name: astar, type: astar}]\nmesh_map:\n  mesh_file: storeys.ply\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("storeys")
    build_storeys(folder / "map", portal_length=2.0)
    write_map(folder / "storeys.ply", *storeys(), MapHeader((0, 0, 0), 0, 0))
    (folder / "tiles.yaml").write_text(ESCAPE + ON_TILES + LAYERS.replace("16.0", "24.0"), "utf-8")
    (folder / "mesh.yaml").write_text(ESCAPE + ON_MESH + LAYERS.replace("  window: 16.0\n", ""), "utf-8")
    return folder


def escaped(folder, backend, *seen):
    """What became of an escape with obstacles at places (x, y) [m], and where the robot stood then."""
    with LoopbackSession(START) as session:
        server = session.serve(*read_config(folder / f"{backend}.yaml"), session.robot, session.transforms)
        navigation_map = next(iter(server.served.values())).map
        navigation_map.insert_points("lidar", [(x, y, 0.3) for x, y in seen], (9.4, 1.8, 0.5), session.clock.now())
        result = session.navigator.send(RecoveryGoal("out")).wait()
        inner = server.plugins.get(PluginKind.RECOVERY, "out").instance
        if backend == "tiles":
            assert not navigation_map._window._held and inner._inner.mesh_map is navigation_map.window_map
        return result, session.robot.pose


@pytest.mark.parametrize(
    ("seen", "outcome"),
    [
        ([(9.7, 2.1), (9.7, 2.2)], RecoveryOutcome.SUCCESS),
        ([(2.0, 2.0)], RecoveryOutcome.SUCCESS),
        (np.mgrid[6.0:13.0:0.4, 0.1:4.1:0.4].reshape(2, -1).T.tolist(), RecoveryOutcome.IMPASSABLE),
    ],
)
def test_an_escape_ends_as_on_the_whole_mesh(folder, seen, outcome):
    (ours, stood), (expected, stands) = (escaped(folder, backend, *seen) for backend in ("tiles", "mesh"))
    assert ours.outcome == outcome == expected.outcome
    assert ours.message == expected.message
    assert stood.distance_to(stands) < 0.05
    assert (stood.distance_to(START) > 0.2) == (len(seen) == 2)
