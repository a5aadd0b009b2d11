"""The server's side of the queries: which map, which frame, which outline, alive while asked."""

import math
from contextlib import contextmanager

import pytest

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.queries import CellState, PlaceQuery


class Served:
    """A costmap that is updated at 7 s, with the users it has had."""

    def __init__(self, costmap):
        self.map = costmap
        self.users = []

    @contextmanager
    def in_use(self):
        self.users.append("in use")
        try:
            yield
        finally:
            self.users.append("done")

    def update(self):
        self.map.update(None, 7.0)


class KnownRobot:
    """A robot that is at one place, or does not know."""

    def __init__(self, pose):
        self._pose = pose

    def pose(self) -> Pose:
        if self._pose is None:
            raise RobotStateError("no pose")
        return self._pose


@pytest.fixture
def transforms():
    buffer = TransformBuffer()
    buffer.set(Transform((2.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), "map", "odom", 0.0, static=True))
    return buffer


@pytest.fixture
def queries(build, seeing, transforms):
    """A static global map, an empty local one; the robot stands in odom."""
    global_costmap, local_costmap = (
        build("static", footprint_padding=0.5, outline=SQUARE),
        build("obstacle", obstacle=seeing),
    )
    robot = KnownRobot(Pose.planar(1.5, 4.5, frame_id="odom"))
    answers = MapQueries(Served(global_costmap), Served(local_costmap), robot, transforms)
    answers.update_map()
    return answers


SQUARE = [(0.4, 0.4), (-0.4, 0.4), (-0.4, -0.4), (0.4, -0.4)]


def test_a_point_in_another_frame_is_transformed(queries):
    assert queries.check_point(Pose.planar(2.5, 5.5, frame_id="odom")).state is CellState.LETHAL
    assert queries.check_point(Pose.planar(2.5, 5.5)).state is CellState.FREE


def test_the_local_map_is_asked_where_named(queries):
    assert queries.check_point(Pose.planar(4.5, 5.5), local=True).state is CellState.FREE


def test_without_a_pose_the_robots_own_is_checked_with_or_without_padding(queries):
    assert queries.check_pose(None).state is CellState.FREE
    assert queries.check_pose(None, PlaceQuery(use_padded_footprint=True)).state is CellState.LETHAL


def test_a_path_in_another_frame_is_transformed(queries):
    path = Path.from_points([(0.5, 5.5, 0.0), (2.5, 5.5, 0.0), (4.5, 8.5, 0.0)], frame_id="odom")
    answer = queries.check_path(path, return_on=CellState.LETHAL)
    assert (answer.last_checked, answer.state) == (1, CellState.LETHAL)


def test_a_valid_pose_is_found_for_a_pose_in_another_frame(queries):
    found = queries.find_valid_pose(Pose.planar(2.5, 5.5, frame_id="odom"), 3.0, 0.0)
    assert found.state is CellState.FREE and found.pose.frame_id == "map"
    assert queries.check_pose(found.pose).state is CellState.FREE


def test_an_unknown_frame_raises(queries):
    with pytest.raises(TransformError):
        queries.check_point(Pose.planar(0.0, 0.0, frame_id="nowhere"))


def test_without_a_known_pose_only_questions_about_it_fail(build, transforms):
    served = Served(build("static"))
    queries = MapQueries(served, served, KnownRobot(None), transforms)
    queries.update_map()
    assert served.map.last_update == 7.0
    with pytest.raises(RobotStateError):
        queries.check_pose(None)


def test_a_map_is_kept_alive_while_it_is_asked_even_if_that_fails(build, transforms):
    served = Served(build("static"))
    with pytest.raises(TransformError):
        MapQueries(served, served, KnownRobot(None), transforms).check_point(Pose.planar(0.0, 0.0, frame_id="nowhere"))
    assert served.users == ["in use", "done"]


@pytest.mark.parametrize("tolerances", [(math.nan, 0.0), (-1.0, 0.0), (1.0, math.nan), (1.0, -0.1)])
def test_tolerances_that_are_no_numbers_are_misuse(queries, tolerances):
    with pytest.raises(ValueError, match="tolerances must not be negative"):
        queries.find_valid_pose(Pose.planar(5.0, 5.0), *tolerances)


def test_a_tolerance_beyond_all_use_is_named_and_inf_means_anywhere(queries):
    with pytest.raises(ValueError, match=r"dist_tolerance must be at most 1000 m \(inf = anywhere\), got 1e\+30"):
        queries.find_valid_pose(Pose.planar(5.0, 5.0), 1e30, 0.0)
    assert queries.find_valid_pose(Pose.planar(5.0, 5.0), math.inf, math.inf).pose is not None


def test_path_cells_only_ignores_outline_and_safety_distance(queries):
    path = Path.from_points([(x + 0.5, 5.5, 0.0) for x in range(2)])
    query = PlaceQuery(safety_dist=3.0)
    assert queries.check_path(path, query, path_cells_only=True).state is CellState.FREE
    assert queries.check_path(path, query).state is CellState.OUTSIDE
