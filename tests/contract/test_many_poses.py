"""The check of many poses in a plane says of each what the check of one pose says, on costmaps and on meshes."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.queries import PADDED, CellState, Fit, PlaceQuery, each_pose, on_map
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from tests.contract.conftest import costmap_of, is_wall, mesh_of

POSES = 200


def rectangle_among_unknown_cells():
    """A costmap for an outline with corners, parts of which are unknown."""
    x, y = np.meshgrid((np.arange(160) + 0.5) * 0.05, (np.arange(120) + 0.5) * 0.05)
    cells = np.where(is_wall(x, y), 254, np.where(x > 6.0, 255, 0)).astype(np.uint8)
    outline = [(0.4, 0.2), (0.4, -0.2), (-0.1, -0.2), (-0.1, 0.2)]
    layers = ({"name": "walls", "type": "static"},)
    parameters = CostmapParameters(resolution=0.05, footprint=outline, max_age=0.0, layers=layers)
    costmap = build_layered_costmap(parameters, {}, static_map=Costmap(cells, 0.05))
    costmap.update(None, 0.0)
    return costmap


MAPS = {
    "round on a costmap": lambda: costmap_of(is_wall),
    "rectangle on a costmap": rectangle_among_unknown_cells,
    "mesh": lambda: mesh_of(is_wall),
}


def drawn_frame(rng):
    """A frame on the floor, or a little above or below it and tilted."""
    tilt = rng.choice([0.0, 0.05]) * rng.normal(size=2)
    yaw = 0.5 * rng.uniform(-math.pi, math.pi)
    rotation = np.array([*tilt, math.sin(yaw), math.cos(yaw)])
    place = rng.uniform((-0.5, -0.5, -0.1), (8.5, 6.5, 0.1))
    return Transform(tuple(place.tolist()), tuple((rotation / np.sqrt((rotation**2).sum())).tolist()), "map", "begin")


@pytest.fixture(scope="module", params=MAPS)
def navigation_map(request):
    return MAPS[request.param]()


@pytest.mark.parametrize("query", [PADDED, PlaceQuery(safety_dist=0.07)], ids=["padded", "with room"])
def test_of_many_poses_in_a_plane_it_says_what_it_says_of_each(navigation_map, query):
    rng, answers = np.random.default_rng(1), []
    touch, on_path = navigation_map.pose_check(query), navigation_map.path_check(query)
    for _ in range(10):
        frame = drawn_frame(rng)
        poses = rng.uniform((-1.5, -1.5, -7.0), (1.5, 1.5, 7.0), (POSES, 3))
        each = each_pose(touch, on_path, frame)(poses).tolist()
        assert navigation_map.plane_check(query, frame)(poses).tolist() == each
        answers += each
    assert 0.05 < np.mean(np.array(answers) == Fit.FREE) < 0.95, "both answers come"


def test_each_answer_is_that_of_the_checks_of_one_pose(navigation_map):
    frame, check = Transform((1.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), "map", "begin"), navigation_map.pose_check(PADDED)
    poses = [(0.1 * step, 0.2, 0.3) for step in range(-20, 60)]
    fits = [fit != Fit.TOUCHES for fit in navigation_map.plane_check(PADDED, frame)(np.array(poses)).tolist()]
    assert fits == [check(on_map(frame, pose)).state <= CellState.INSCRIBED for pose in poses]


def test_no_pose_gives_no_answer(navigation_map):
    frame = Transform((1.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), "map", "begin")
    assert len(navigation_map.plane_check(PADDED, frame)(np.zeros((0, 3)))) == 0
