"""Which layers a window on a map of tiles takes."""

import numpy as np
import pytest
from sensing_tiles import ENTRIES, OBSTACLES, SENSING, SENSING_OFF, SIDE
from test_tile_server import config, pose, serve

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.layers.obstacle import ObstacleLayer
from mbf_mesh_nav.map.layer import MeshLayer
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.windows.window_settings import SHOWN, window_settings
from mbf_mesh_nav.tiles.tiled_map import TiledMap


def test_a_layer_takes_the_place_of_the_stored_one_of_its_name_and_adds_to_it(tiled_hills, whole_hills):
    entries = (*ENTRIES, MeshLayerEntry(name="safe", type="max_combination", inputs=("around",)))
    tiled = TiledMap(tiled_hills)
    over = TiledNavigationMap(tiled, window=window_settings(tiled, SIDE, entries, SENSING))
    assert {"safe", "safe as built", SHOWN} <= set(over.layers)
    stored, shown = over.layers["safe as built"], over.window_map.snapshot()
    assert stored.lethal.any() and np.array_equal(stored.lethal, shown.lethal)
    assert np.array_equal(stored.costs, shown.costs) and not over.layers["safe"].lethal.any()


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("layers: [{name: rim, type: border}]", "layer 'rim' takes no scans and reads no layer that does"),
        ("layers: [{name: a, type: inflation, inputs: [safe]}]", "layer 'a' takes no scans and reads no layer that"),
        (
            "layers: [{name: o, type: obstacle}]\n  default_layer: safe",
            "default_layer 'safe': expected one of the list",
        ),
        ("layers: [{name: o, type: obstacle}]\n  default_layer: x", "default_layer 'x' is not a layer"),
        ("layers: [{name: shown, type: obstacle}]", "layer name 'shown' is used twice"),
        ("layers: [{name: o, type: obstacle}, {name: i, type: inflation, inputs: [p]}]", "i reads unknown layer 'p'"),
        (
            "layers: [{name: o, type: obstacle}, {name: i, type: inflation, inputs: [o]}]\n"
            "  window: 4.0\n  i: {inflation_radius: 1.5}",
            "the layers look 2.25 m around a vertex, a window of 4 m leaves 1 m around the robot: expected a window of "
            "more than 9 m",
        ),
    ],
)
def test_layers_that_do_not_belong_in_a_window_are_refused_at_the_start(tiled_hills, tmp_path, text, finding):
    with LoopbackSession(Pose.planar(0.0, 0.0)) as session, pytest.raises(LayerListError) as caught:
        serve(session, tmp_path, config(tiled_hills, block=f"  {text}\n"))
    assert finding in str(caught.value) and "robot.yaml: tiled_map: " in str(caught.value)


def test_a_layer_that_would_lose_its_obstacles_when_the_window_moves_is_refused(tiled_hills):
    class Forgetful(ObstacleLayer):
        take_over = MeshLayer.take_over

    tiled, entry = TiledMap(tiled_hills), MeshLayerEntry(name="mine", type="forgetful")
    with pytest.raises(LayerListError, match="layer 'mine' takes scans and does not override 'take_over'"):
        window_settings(tiled, SIDE, (entry,), {}, load_layer=lambda name: Forgetful)


def test_parameters_of_sensing_layers_change_and_last_those_of_the_tiles_do_not(tiled_hills, way, tmp_path):
    with LoopbackSession(pose(way[0])) as session:
        server = serve(session, tmp_path, config(tiled_hills, block=OBSTACLES))
        server.set_layer_parameters("around", inflation_radius=1.0)
        server.tiled_map.set_layer_parameters("obstacles", SENSING_OFF, until=5.0)
        server.tiled_map.update(pose(way[14]), 1.0)
        assert server.tiled_map.layers["around"].parameters.inflation_radius == 1.0
        assert not server.tiled_map.layers["obstacles"].parameters.enabled
        server.tiled_map.update(pose(way[14]), 5.0)
        assert server.tiled_map.layers["obstacles"].parameters.enabled
        with pytest.raises(ValueError, match="'steepness' has the values of the tiles"):
            server.set_layer_parameters("steepness", enabled=False)


def test_a_map_without_layers_of_its_own_has_nothing_to_clear_and_is_never_stale(tiled_hills, way, tmp_path):
    with LoopbackSession(pose(way[0])) as session:
        server = serve(session, tmp_path, config(tiled_hills))
        assert server.tiled_map.clear() == [] and not server.map_problem() and not server.tiled_map.senses
        assert tuple(server.tiled_map.layers) == server.tiled_map.tiled.index.layers


def test_a_layer_without_costs_limits_speed_in_the_window_and_hides_no_obstacle(tiled_hills):
    slow = MeshLayerEntry(name="slow", type="speed_limit")
    everywhere = [[-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0], [-1000.0, 1000.0]]
    blocks = {"slow": {"regions": [{"polygon": everywhere, "speed_limit": 0.2}]}}
    tiled = TiledMap(tiled_hills)
    for entries in ((slow,), (*ENTRIES, slow)):
        settings = window_settings(tiled, SIDE, entries, {**SENSING, **blocks} if len(entries) > 1 else blocks)
        shown = next(planned for planned in settings.planned if planned.entry.name == SHOWN)
        assert "slow" not in shown.entry.inputs and set(shown.entry.inputs) <= {"safe", ENTRIES[-1].name}
        over = TiledNavigationMap(tiled, window=settings)
        assert over.speed_limit_at(Pose.planar(1.0, 1.0), 1.0) == 0.2
