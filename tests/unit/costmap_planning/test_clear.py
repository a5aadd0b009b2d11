"""What the clear recovery forgets: which maps, which layers, which area; walls of the floor plan always stay."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.files.map_io import OccupancyMap
from mbf_costmap_nav.files.map_saver import save_map

CONFIG = """
backend: costmap
planners: [{name: astar, type: astar}]
recovery_behaviors: [{name: clear, type: clear}]
clear: {BLOCK}
global_costmap: &map
  robot_radius: 0.2
  layers:
    - {name: walls, type: static}
    - {name: front, type: obstacle}
    - {name: back, type: obstacle}
    - {name: keepout, type: keepout}
  walls: {map_file: walls.yaml}
  front: {sources: {front: {obstacle_max_range: 9.0}}}
  back: {sources: {back: {obstacle_max_range: 9.0}}}
  keepout: {zones: [{name: stairs, polygon: [[-5.0, -5.0], [-4.0, -5.0], [-4.0, -4.0]]}]}
local_costmap: *map
"""
GLOBAL_WITHOUT_BACK = CONFIG.replace("global_costmap: &map", "local_costmap: &map").replace(
    "local_costmap: *map",
    """global_costmap:
  robot_radius: 0.2
  layers: [{name: walls, type: static}, {name: front, type: obstacle}, {name: keepout, type: keepout}]
  walls: {map_file: walls.yaml}
  front: {sources: {front: {obstacle_max_range: 9.0}}}
  keepout: {zones: [{name: stairs, polygon: [[-5.0, -5.0], [-4.0, -5.0], [-4.0, -4.0]]}]}""",
)
PLACES = {"near": Pose.planar(1.05, 0.05), "far": Pose.planar(6.05, 0.05), "behind": Pose.planar(-1.05, 0.05)}
STAIRS, WALL = Pose.planar(-4.05, -4.55), Pose.planar(0.05, 1.05)


def save_walls(folder):
    """A floor plan of 20 m x 20 m around the origin with one wall, at y = 1 m."""
    occupancy = np.zeros((200, 200), dtype=np.uint8)
    occupancy[110] = 100
    save_map(folder / "walls.yaml", OccupancyMap(occupancy, 0.1, (-10.0, -10.0, 0.0)))


@pytest.fixture
def clear(tmp_path):
    """``clear("costmaps: local")`` runs the recovery and returns its result and what is left on each map."""
    clock, transforms, opened = SimClock(), TransformBuffer(), []
    save_walls(tmp_path)

    def clear(block, config=CONFIG):
        file = tmp_path / "clear.yaml"
        file.write_text(config.replace("BLOCK", block))
        robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
        opened.extend([navigator := Navigator.from_file(file, robot, clock, transforms), robot])
        for source, names in (("front", ("near", "far")), ("back", ("behind",))):
            ends = [(*PLACES[name].position[:2], 0.2) for name in names]
            navigator.server.take_scan(RangeScan(source, "map", (0.0, 0.0, 0.2), ends, [True] * len(ends), clock.now()))
        queries = navigator.server.queries
        queries.update_map()
        result = navigator.recover("clear")
        for local in (False, True):
            for place in (STAIRS, WALL):
                assert queries.check_point(place, local=local).state is CellState.LETHAL
        left = [
            {
                name
                for name, place in PLACES.items()
                if queries.check_point(place, local=local).state is CellState.LETHAL
            }
            for local in (True, False)
        ]
        return result, *left

    yield clear
    for thing in opened:
        thing.close()


EVERYTHING = set(PLACES)


@pytest.mark.parametrize(
    ("block", "local", "in_global"),
    [
        ("", set(), set()),
        ("costmaps: local", set(), EVERYTHING),
        ("costmaps: global", EVERYTHING, set()),
        ("layers: [back]", {"near", "far"}, {"near", "far"}),
        ("radius: 3.0", {"far"}, {"far"}),
        ("radius: 3.0, keep_inside: true", {"near", "behind"}, {"near", "behind"}),
        ("radius: 3.0, costmaps: local, layers: [front]", {"far", "behind"}, EVERYTHING),
    ],
)
def test_it_forgets_what_it_is_asked_to_forget(clear, block, local, in_global):
    result, left_local, left_global = clear(block)
    assert result.success
    assert (left_local, left_global) == (local, in_global)


def test_a_layer_that_only_one_map_has_is_cleared_there(clear):
    result, left_local, left_global = clear("layers: [back]", GLOBAL_WITHOUT_BACK)
    assert result.success and "local: back" in result.message and "global" not in result.message
    assert (left_local, left_global) == ({"near", "far"}, {"near", "far"})


def test_a_layer_that_is_not_there_is_a_failure_that_names_the_known_ones(clear):
    result, left_local, _ = clear("layers: [sonar]")
    assert result.outcome == RecoveryOutcome.FAILURE
    assert "'sonar'" in result.message and "front" in result.message and '"' not in result.message
    assert left_local == EVERYTHING
