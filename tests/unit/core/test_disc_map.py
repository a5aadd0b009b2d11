"""The map-independent questions of a round robot, on a half plane: free on the left, a wall on the right."""

import math
from contextlib import nullcontext

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.disc_map import DiscMap
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.queries import CellState, PlaceAnswer, PlaceQuery


class HalfPlane(DiscMap):
    frame_id = "map"
    robot_radius = 0.5

    def place(self, x, y, safety_dist=0.0):
        state = CellState.LETHAL if x > 0.0 else CellState.INSCRIBED if x + safety_dist > -0.5 else CellState.FREE
        return PlaceAnswer(state, 2.0)

    def candidates(self, x, y, dist_tolerance):
        return np.column_stack([np.linspace(x - 4.0, x + 4.0, 81), np.full((81, 1), y), np.zeros(81)])

    def obstacles_near(self, x, y, within):
        return np.array([[max(x, 0.0), y]])


class Served:
    """The half plane, always up to date."""

    map = HalfPlane()

    def in_use(self):
        return nullcontext()

    def update(self):
        self.map.update(None, 0.0)


class Robot:
    def pose(self):
        return Pose.planar(-3.0, 1.0)


@pytest.fixture
def queries():
    transforms = TransformBuffer()
    transforms.set(Transform((-1.0, 0.0, 0.0), parent="map", child="dock", static=True))
    return MapQueries(Served(), Served(), Robot(), transforms)


def test_without_a_pose_the_robot_is_asked_for(queries):
    assert queries.check_pose(None) == PlaceAnswer(CellState.FREE, 2.0)


def test_poses_of_other_frames_are_brought_into_the_map(queries):
    assert queries.check_point(Pose.planar(1.5, 0.0, frame_id="dock")).state is CellState.LETHAL
    with pytest.raises(TransformError):
        queries.check_point(Pose.planar(0.0, 0.0, frame_id="moon"))


def test_a_path_is_as_bad_as_its_worst_pose_and_costs_their_sum(queries):
    path = Path.from_points([(x, 0.0, 0.0) for x in (-2.0, -1.0, -0.2, 1.0, -3.0)])
    whole, every_other = queries.check_path(path), queries.check_path(path, skip_poses=1)
    early = queries.check_path(path, return_on=CellState.INSCRIBED)

    assert (whole.state, whole.cost, whole.last_checked) == (CellState.LETHAL, 10.0, 4)
    assert (every_other.state, every_other.cost) == (CellState.LETHAL, 6.0), "the disc touches something"
    assert (early.state, early.last_checked) == (CellState.LETHAL, 2)
    assert queries.check_path(path[::2], path_cells_only=True).state is CellState.INSCRIBED


def test_the_nearest_free_pose_within_the_tolerance_keeps_its_heading(queries):
    wanted = Pose.planar(0.5, 2.0, 0.7)
    found = queries.find_valid_pose(wanted, 1.5, 0.0)

    assert found.pose.position == pytest.approx((-0.5, 2.0, 0.0))
    assert (found.state, found.pose.orientation) == (CellState.INSCRIBED, wanted.orientation)
    assert queries.find_valid_pose(wanted, 1.5, 0.0, PlaceQuery(safety_dist=0.25)).pose.x == pytest.approx(-0.8)


def test_where_nothing_is_free_within_the_tolerance_the_place_itself_is_reported(queries):
    answer = queries.find_valid_pose(Pose.planar(0.5, 2.0), 0.9, 0.0)

    assert (answer.pose, answer.state) == (None, CellState.LETHAL)


def test_a_robot_at_a_wall_gets_away_by_what_leads_from_it():
    assert getting_free(HalfPlane(), Pose.planar(-0.4, 0.0)) == ("it gets away by backing up 0.1 m")
    assert getting_free(HalfPlane(), Pose.planar(-0.35, 0.0, math.pi)) == "it gets away by driving on 0.2 m"
    assert getting_free(HalfPlane(), Pose.planar(-0.4, 0.0, 1.5708)).startswith("it gets away by moving left")


class AtTheEdge(HalfPlane):
    """The map ends where the wall begins, and hides it from whoever reaches beyond."""

    def pose_check(self, query, *, center_only=False):
        check = super().pose_check(query)
        return lambda pose: PlaceAnswer(CellState.OUTSIDE, 2.0) if pose.x > -0.3 else check(pose)


def test_a_motion_along_a_wall_at_the_edge_of_the_map_is_no_way_out():
    assert getting_free(AtTheEdge(), Pose.planar(-0.1, 0.0, 1.5708)) == "it gets away by moving left 0.5 m"
    assert getting_free(AtTheEdge(), Pose.planar(-0.1, 0.0)) == "it gets away by backing up 0.5 m"


def test_inside_of_an_obstacle_nothing_is_promised():
    assert getting_free(HalfPlane(), Pose.planar(3.0, 0.0)) == "no straight motion and no turn on the spot gets it away"
