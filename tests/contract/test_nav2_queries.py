"""Nav2's question whether a path is still valid, on every map, against a walk over the poses before the robot."""

import numpy as np
import pytest

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.queries import CellState, PlaceAnswer
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import site
from mbf_ros.messages.geometry import MessageContext, path_message
from mbf_ros.messages.interfaces import MessageError
from mbf_ros.messages.nav2_queries import NOT_VALID, is_path_valid

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


def test_the_whole_path_counts_while_the_robot_is_lost(made):
    path = made.path((4.2, 4.0), (2.0, 4.0))
    made.server.runtime.robot.pose = lost
    assert 0 in ask(made, path)["invalid_pose_indices"]


def test_an_empty_path_is_not_valid_and_a_cost_that_cannot_be_respected_is_refused(made):
    assert ask(made, Path(np.zeros((0, 3)))) == NOT_VALID
    with pytest.raises(MessageError, match="max_cost 100 is not supported here; leave it at 254"):
        ask(made, Path.from_poses([Pose.planar(2.0, 4.0)]), max_cost=100)
