"""The server's side of the queries: which map, which frame, which outline, alive while asked."""

from contextlib import contextmanager

import pytest

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer, TransformError
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_costmap_nav.map.queries import CostmapQueries


class FixedClock:
    def now(self) -> float:
        return 7.0


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
    answers = CostmapQueries(global_costmap, local_costmap, robot, transforms, FixedClock())
    answers.update_map()
    return answers


SQUARE = [(0.4, 0.4), (-0.4, 0.4), (-0.4, -0.4), (0.4, -0.4)]


def test_a_point_in_another_frame_is_transformed(queries):
    assert queries.check_point(Pose.planar(2.5, 5.5, frame_id="odom")).state is CellState.LETHAL
    assert queries.check_point(Pose.planar(2.5, 5.5)).state is CellState.FREE


def test_the_local_map_is_asked_where_told(queries):
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


def test_updating_works_while_the_robots_pose_is_unknown(build, transforms):
    costmap = build("static")
    CostmapQueries(costmap, costmap, KnownRobot(None), transforms, FixedClock()).update_map()
    assert costmap.last_update == 7.0


def test_a_map_is_kept_alive_while_it_is_asked_even_if_that_fails(build, transforms):
    costmap, users = build("static"), []

    @contextmanager
    def using(asked):
        users.append(asked)
        try:
            yield
        finally:
            users.remove(asked)

    answers = CostmapQueries(costmap, costmap, KnownRobot(None), transforms, FixedClock(), using)
    with pytest.raises(TransformError):
        answers.check_point(Pose.planar(0.0, 0.0, frame_id="nowhere"))
    assert users == []
