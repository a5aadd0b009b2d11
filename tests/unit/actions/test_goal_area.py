"""Goal areas: the cheapest member is planned to, the robot stops as soon as it is inside."""

import math
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_area import DiscArea, PolygonArea, PoseSetArea
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted import straight_plan

NOT_LOOKED_AT = Pose.planar(-99.0, -99.0)
DISC = DiscArea(Pose.planar(3.0, 0.0), 1.0)
SQUARE = PolygonArea(((2.0, -1.0, 0.0), (4.0, -1.0, 0.0), (4.0, 1.0, 0.0), (2.0, 1.0, 0.0)))
STATIONS = PoseSetArea((Pose.planar(5.0, 0.0), Pose.planar(0.0, 2.0), Pose.planar(-4.0, 0.0)))
L_SHAPE = ((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 3.0, 0.0), (0.0, 3.0, 0.0))


def send(session, area, kind=GetPathGoal):
    return session.navigator.send(kind(NOT_LOOKED_AT, goal_area=area))


@pytest.mark.parametrize(("area", "length"), [(DISC, 7 / 3), (SQUARE, 2.6), (STATIONS, 2.0)])
def test_the_path_leads_to_the_nearest_member(make_session, area, length):
    session = make_session()
    result = send(session, area).wait()
    assert result.success
    assert area.contains(result.path[-1])
    assert result.path.length == pytest.approx(length)
    assert result.cost == pytest.approx(result.path.length)


def test_the_cheapest_member_wins(make_session):
    session = make_session()
    assert send(session, STATIONS).wait().path[-1].y == pytest.approx(2.0)
    assert [request.goal for request in session.planner.requests] == list(STATIONS.poses)


def test_members_that_can_not_be_reached_do_not_count(make_session):
    session = make_session(planner_max_retries=0)
    blocked = PlanResult(GetPathOutcome.BLOCKED_GOAL, "occupied")
    session.planner.play(lambda request: blocked if request.goal.x < 1.0 else straight_plan(request))
    assert send(session, STATIONS).wait().path[-1].x == pytest.approx(5.0)
    session.planner.play(blocked)
    assert send(session, STATIONS).wait().outcome == GetPathOutcome.BLOCKED_GOAL


def test_a_cancel_ends_the_search_between_two_members(make_session):
    session = make_session()
    handle = send(session, STATIONS)
    session.planner.play(lambda request: (handle.cancel(), straight_plan(request))[1])
    assert handle.wait().outcome == GetPathOutcome.CANCELED
    assert len(session.planner.requests) == 1


def test_a_robot_that_is_inside_already_stays_where_it_is(make_session):
    session = make_session()
    result = send(session, DiscArea(Pose.planar(0.2, 0.0), 1.0), MoveBaseGoal).wait()
    assert result.success
    assert not session.robot.moved_after(-1.0)


@pytest.mark.parametrize("area", [DISC, SQUARE, STATIONS])
def test_move_base_stops_inside_the_area(make_session, area):
    session = make_session()
    result = send(session, area, MoveBaseGoal).wait()
    assert result.success
    assert area.contains(session.robot.pose)
    assert session.robot.command == Twist()


def test_exe_path_stops_where_the_path_enters_the_area(make_session):
    session = make_session()
    assert session.navigator.send(ExePathGoal(session.path_to(9.0), goal_area=DISC)).wait().success
    assert 2.0 <= session.robot.pose.x < 2.1


def elsewhere(area, session):
    """The same area in the frame ``dock``, which is turned and shifted against ``map``."""
    dock = Transform((4.0, -1.0, 0.0), quaternion_from_yaw(math.pi / 2.0), "map", "dock", static=True)
    session.transforms.set(dock)
    there = dock.inverse()
    if isinstance(area, PolygonArea):
        return PolygonArea(tuple(map(tuple, there.apply(area.corners).tolist())), "dock")
    if isinstance(area, DiscArea):
        return DiscArea(there.apply_to_pose(area.center), area.radius)
    return replace(area, poses=tuple(map(there.apply_to_pose, area.poses)))


@pytest.mark.parametrize("area", [DISC, SQUARE, STATIONS])
def test_an_area_in_another_frame_is_that_area(make_session, area):
    session = make_session()
    there = elsewhere(area, session)
    assert there.frame_id == "dock"
    plan = send(session, there).wait()
    assert plan.success and area.contains(plan.path[-1])
    assert send(session, there, MoveBaseGoal).wait().success and area.contains(session.robot.pose)


def test_a_path_ends_in_an_area_of_another_frame(make_session):
    session = make_session()
    goal = ExePathGoal(session.path_to(9.0), goal_area=elsewhere(DISC, session))
    assert session.navigator.send(goal).wait().success
    assert DISC.contains(session.robot.pose) and session.robot.pose.x < 9.0 - 2.0


def test_an_area_stays_where_it_was_when_the_goal_began(make_session):
    session = make_session()
    area = elsewhere(DISC, session)
    handle = send(session, area, MoveBaseGoal)
    session.clock.sleep(0.5)
    session.transforms.set(Transform((50.0, 0.0, 0.0), parent="map", child="dock", static=True))
    assert handle.wait().success and DISC.contains(session.robot.pose)


@pytest.mark.parametrize("kind", [GetPathGoal, MoveBaseGoal])
def test_an_area_in_an_unknown_frame_is_a_tf_error(make_session, kind):
    session, area = make_session(), DiscArea(Pose.planar(1, 0, frame_id="nowhere"), 1.0)
    followed = session.navigator.send(ExePathGoal(session.path_to(1.0), goal_area=area)).wait()
    for result in (send(session, area, kind).wait(), followed):
        assert result.outcome_name == "TF_ERROR" and "nowhere" in result.message


@pytest.mark.parametrize(
    ("x", "y", "inside"), [(0.5, 2.5, True), (2.5, 0.5, True), (2.5, 2.5, False), (-0.1, 0.5, False)]
)
def test_a_polygon_may_be_concave(x, y, inside):
    assert PolygonArea(L_SHAPE).contains(Pose.planar(x, y)) is inside


@pytest.mark.parametrize(("z", "inside"), [(-3.0, False), (-0.6, False), (-0.4, True), (2.4, True), (2.6, False)])
def test_a_polygon_lies_on_the_storey_of_its_corners(z, inside):
    ramp = PolygonArea(((0.0, -2.0, 0.0), (8.0, -2.0, 2.0), (8.0, 2.0, 2.0), (0.0, 2.0, 0.0)))
    assert ramp.contains(Pose.planar(4.0, 0.0, z=z)) is inside
    assert not ramp.contains(Pose.planar(4.0, 3.0, z=z))


def test_a_robot_outside_a_polygon_on_another_storey_is_as_far_as_it_is_in_3d():
    assert SQUARE.depth(Pose.planar(3.0, 0.0, z=-3.5)) == pytest.approx(-3.0)
    assert SQUARE.depth(Pose.planar(8.0, 0.0, z=3.5)) == pytest.approx(-5.0)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=3, max_size=3))
@example([(0.0, 0.0), (0.0, 1.0), (1.0, 5e-323)])  # a side that rises by next to nothing
def test_every_member_of_a_triangle_is_inside_it(points):
    (ax, ay), (bx, by), (cx, cy) = points
    if abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) < 1e-3:
        return
    area = PolygonArea(tuple((x, y, 0.0) for x, y in points))
    members = area.members()
    assert members
    assert all(area.contains(member) for member in members)


def test_every_member_of_a_disc_is_inside_it():
    assert all(DISC.contains(member) for member in DISC.members())


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: DiscArea(Pose.planar(0, 0), 0.0), "the radius must be positive"),
        (lambda: PolygonArea(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))), "at least three corners, got 2"),
        (lambda: PolygonArea(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))), "encloses no area"),
        (lambda: PoseSetArea(()), "at least one pose"),
        (lambda: PoseSetArea(STATIONS.poses, dist_tolerance=-1.0), "tolerances must not be negative"),
        (lambda: PoseSetArea(STATIONS.poses, angle_tolerance=360.0), "angle_tolerance must be at most 6.28 rad"),
        (lambda: PoseSetArea((Pose.planar(0, 0), Pose.planar(0, 0, frame_id="odom"))), "all in one frame"),
    ],
)
def test_an_area_without_inside_is_refused(make, why):
    with pytest.raises(ValueError, match=why):
        make()


def test_a_polygon_of_flat_corners_says_what_a_corner_has():
    with pytest.raises(ValueError, match=r"a corner of a polygon has x, y and z \[m\], got \(1.0, 10.0\)"):
        PolygonArea(((1.0, 10.0), (3.0, 10.0), (3.0, 12.0)))


def test_the_member_of_an_area_whose_arms_are_hardly_wide_lies_inside():
    corners = [(10, 20), (12, 20), (12, 20.01), (10.01, 20.01), (10.01, 22), (10, 22)]
    (member,) = PolygonArea(tuple((x, y, 0.0) for x, y in corners)).members()
    assert PolygonArea(tuple((x, y, 0.0) for x, y in corners)).contains(member)
