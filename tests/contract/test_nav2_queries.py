"""Nav2's question whether a path is still valid, on every map, against a walk over the poses before the robot."""

import numpy as np
import pytest

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.queries import CellState, PlaceAnswer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.testing.conformance.rig import SENSOR, Box
from mbf_abstract.testing.conformance.site import site
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.pose_checks import pose_check
from mbf_ros.messages.geometry import MessageContext, path_message
from mbf_ros.messages.interfaces import MessageError
from mbf_ros.messages.nav2.queries import NAV2_QUESTIONS, NOT_VALID, is_path_valid

CONTEXT = MessageContext()
WALL = Box(4.0, 3.0, 4.4, 5.0)
WORST = {CellState.LETHAL, CellState.OUTSIDE}


@pytest.fixture(params=["costmap", "mesh"])
def made(request, backends):
    """A robot at (2, 4) in front of the wall."""
    with site(backends[request.param]) as made:
        made.place(WALL)
        yield made


def lost():
    raise RobotStateError("no fresh robot pose")


def ask(made, path, **request):
    return is_path_valid(made.server, {"path": path_message(path, CONTEXT), **request}, CONTEXT)


def naive(made, path, worst):
    """Indices of the poses from the nearest one on where the robot does not stand free."""
    robot = made.rig.robot.pose
    nearest = min(range(len(path)), key=lambda i: (path[i].distance_to(robot), i))
    return [i for i in range(nearest, len(path)) if made.server.queries.check_pose(path[i]).state in worst]


@pytest.mark.parametrize("corners", [((2.0, 4.0), (6.0, 4.0)), ((2.0, 4.0), (2.0, 9.5)), ((2.0, 4.0), (3.0, 4.0))])
def test_a_path_is_valid_where_the_robot_stands_free_at_each_pose_before_it(made, corners):
    path = made.path(*corners)
    answer, wanted = ask(made, path), naive(made, path, WORST)
    assert list(answer["invalid_pose_indices"]) == wanted
    assert answer["is_valid"] == (not wanted) == (corners[-1] == (3.0, 4.0))


def test_what_lies_behind_the_robot_does_not_count(made):
    path = made.path((4.2, 4.0), (2.0, 4.0), (1.0, 4.0))
    assert made.server.queries.check_pose(path[0]).state in WORST
    assert ask(made, path)["is_valid"]


def test_unknown_ground_counts_only_if_it_is_asked_for(made, monkeypatch):
    path = made.path((2.0, 4.0), (3.0, 4.0))
    unknown = PlaceAnswer(CellState.UNKNOWN, 0.0)
    monkeypatch.setattr(MapQueries, "check_poses", lambda queries, path: (unknown,) * len(path))
    assert ask(made, path)["is_valid"]
    assert len(ask(made, path, consider_unknown_as_obstacle=True)["invalid_pose_indices"]) == len(path)


def test_what_is_lethal_beside_unknown_ground_counts_always(made, monkeypatch):
    path = made.path((2.0, 4.0), (3.0, 4.0))
    mixed = PlaceAnswer(CellState.UNKNOWN, 0.0, CellState.LETHAL)
    monkeypatch.setattr(MapQueries, "check_poses", lambda queries, path: (mixed,) * len(path))
    assert len(ask(made, path)["invalid_pose_indices"]) == len(path)


def test_a_wall_is_found_where_an_unknown_cell_lies_under_the_same_outline(monkeypatch):
    """On the map of cells, whose states are those of single cells; a disc on a mesh has no unknown ones."""
    cells = np.zeros((40, 40), np.uint8)
    cells[20, 22], cells[20, 18] = 254, 255
    check = pose_check(Costmap(cells, 0.1), Footprint.circle(0.3))
    both = check(Pose.planar(2.0, 2.0))
    assert (both.state, both.known) == (CellState.UNKNOWN, CellState.LETHAL)
    assert both.is_blocked()
    unknown = check(Pose.planar(1.6, 2.0))
    assert (unknown.state, unknown.is_blocked(), unknown.is_blocked(unknown=True)) == (CellState.UNKNOWN, False, True)


@pytest.mark.parametrize(("max_cost", "worst"), [(253, WORST | {CellState.INSCRIBED}), (254, WORST), (255, WORST)])
def test_a_cost_of_inscribed_cells_forbids_them_too(made, max_cost, worst):
    path = made.path((2.0, 4.0), (3.5, 4.0))
    wanted = naive(made, path, worst)
    assert list(ask(made, path, max_cost=max_cost)["invalid_pose_indices"]) == wanted
    assert bool(wanted) == (max_cost == 253)


CLEARS = {
    "clear_entirely_{}_costmap": {True, False},
    "clear_around_{}_costmap": {True},
    "clear_except_{}_costmap": {False},
}
"""What each service clears: what is in a square of 3 m around the robot (True), and what is not (False)."""


NEAR, FAR = Pose.planar(3.0, 4.0), Pose.planar(2.0, 6.0)


def mark_both(made):
    """Mark a place in that square and one out of it, on all maps."""
    ends = np.array([[*NEAR.position[:2], 0.4], [*FAR.position[:2], 0.4]])
    made.sees(RangeScan(SENSOR, "map", np.array([2.0, 4.0, 0.4]), ends, np.array([True, True]), made.rig.clock.now()))


def marked(made, which):
    """Whether they are in the square, of those of the two places that one of the maps shows."""
    queries = made.server.queries
    return {place is NEAR for place in (NEAR, FAR) if queries.check_point(place, which == "local").state in WORST}


def test_each_clearing_service_clears_its_map_where_it_says(made):
    made.rig.sensing, made.rig.boxes = False, []
    for service, cleared in CLEARS.items():
        for which, other in (("global", "local"), ("local", "global")):
            mark_both(made)
            assert marked(made, which) == marked(made, other) == {True, False}
            name = f"{which}_costmap/{service.format(which)}"
            assert NAV2_QUESTIONS[name].ask(made.server, {"reset_distance": 3.0}, CONTEXT) == {}
            assert marked(made, which) == {True, False} - cleared, name
            if made.server.backend == "costmap":  # a mesh server has one map
                assert marked(made, other) == {True, False}, name


@pytest.mark.parametrize("name", ["global_costmap", "local_costmap"])
def test_a_costmap_is_handed_out_with_its_obstacles_and_a_mesh_is_refused(made, name):
    question = NAV2_QUESTIONS[f"{name}/get_costmap"]
    if made.server.backend == "mesh":
        with pytest.raises(MessageError, match=r"this map has no cells; the costs of a mesh are on ~/vertex_costs"):
            question.ask(made.server, {}, CONTEXT)
        return
    costmap = question.ask(made.server, {}, CONTEXT)["map"]
    metadata, frame = costmap["metadata"], costmap["header"]["frame_id"]
    assert (metadata["layer"], frame) == (name, "map")
    costs = costmap["data"].reshape(metadata["size_y"], metadata["size_x"])
    origin = metadata["origin"]["position"]
    row, wall, robot = (
        int((place - origin[axis]) / metadata["resolution"]) for place, axis in ((4.0, "y"), (4.05, "x"), (2.0, "x"))
    )
    assert costs[row, wall] == 254 and costs[row, robot] == 0


def test_the_whole_path_counts_while_the_robot_is_lost(made):
    path = made.path((4.2, 4.0), (2.0, 4.0))
    made.server.runtime.robot.pose = lost
    assert 0 in ask(made, path)["invalid_pose_indices"]


def test_an_empty_path_is_not_valid_and_a_cost_that_cannot_be_respected_is_refused(made):
    assert ask(made, Path(np.zeros((0, 3)))) == NOT_VALID
    with pytest.raises(MessageError, match="max_cost 100 is not supported here; leave it at 254"):
        ask(made, Path.from_poses([Pose.planar(2.0, 4.0)]), max_cost=100)
