"""move_base: via poses are passed in order and without a stop; what is passed stays passed."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.actions.via_poses import ViaPoses, rests_along
from mbf_abstract.execution.path_tracker import SAME_PLACE
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_area import DiscArea
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.faulty import drive, slow
from mbf_abstract.testing.scripted import straight_plan

VIA = (Pose.planar(1.0, 0.0), Pose.planar(1.0, 1.0))


def asked(session):
    """The x, y of the via poses of each plan that was asked for."""
    return [[(pose.x, pose.y) for pose in request.via] for request in session.planner.requests]


def watched(handle):
    left = []
    handle.add_feedback_callback(lambda feedback: left.append(feedback.via_left))
    return left


def test_the_robot_passes_all_via_poses_without_a_stop(make_session):
    session = make_session()
    handle = session.send(2.0, 1.0, via=VIA)
    left = watched(handle)
    assert handle.wait().success
    assert sorted(set(left), reverse=True) == [2, 1, 0] and left == sorted(left, reverse=True)
    assert session.robot.pose.distance_to(Pose.planar(2.0, 1.0)) < 0.15
    commands = [command for _, command in session.robot.commands]
    first = next(k for k, command in enumerate(commands) if not command.is_stopped())
    stops = [k for k, command in enumerate(commands) if k > first and command.is_stopped()]
    assert all(command.is_stopped() for command in commands[stops[0] :])


def test_replanning_leads_through_the_poses_that_are_left(make_session):
    session = make_session(planner_frequency=2.0)
    assert session.send(2.0, 1.0, via=VIA).wait().success
    counts = [len(via) for via in asked(session)]
    assert counts[0] == 2 and counts[-1] == 0 and counts == sorted(counts, reverse=True) and 1 in counts


def test_a_pose_that_is_passed_while_the_robot_waits_for_the_next_plan_stays_passed(make_session):
    session = make_session(planner_frequency=2.0)
    session.planner.play(straight_plan, slow(session.clock, 1.5, straight_plan))
    handle = session.send(4.0, via=(Pose.planar(1.0, 0.0), Pose.planar(3.0, 0.0)))
    left = watched(handle)
    assert handle.wait().success
    assert left == sorted(left, reverse=True)


def test_a_recovery_keeps_the_poses_that_are_left(make_session):
    session = make_session(retries=0, dist_tolerance=0.1)
    failed = []

    def fail_behind_the_first(request):
        if request.pose.x > 1.3 and not failed:
            failed.append(request.pose.x)
            return ControlResult(ExePathOutcome.NO_VALID_CMD, "blocked")
        return session.controller.follow(request)

    session.controller.play(fail_behind_the_first)
    assert session.send(4.0, via=(Pose.planar(1.0, 0.0), Pose.planar(3.0, 0.0))).wait().success
    assert session.recoveries == ["first"]
    assert asked(session) == [[(1.0, 0.0), (3.0, 0.0)], [(3.0, 0.0)]]


def test_a_failed_plan_keeps_its_code_and_says_how_many_poses_are_passed(make_session):
    session = make_session(retries=0, planner_frequency=1.0, replan_failed_policy="stop")

    def walled_in(request):
        return straight_plan(request) if len(request.via) == 2 else session.no_path

    session.planner.play(walled_in)
    result = session.send(4.0, via=(Pose.planar(1.0, 0.0), Pose.planar(3.0, 0.0))).wait()
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert result.message == "replanning failed: with 1 of 2 via poses passed: walled in"


def test_a_newer_goal_brings_its_own_via_poses(make_session):
    session = make_session()
    first = session.send(5.0, via=(Pose.planar(4.0, 0.0),))
    session.clock.sleep(1.0)
    second = session.send(0.0, 2.0, via=(Pose.planar(1.0, 2.0),))
    left = watched(second)
    assert second.wait().success and first.status is GoalStatus.CANCELED
    assert asked(session) == [[(4.0, 0.0)], [(1.0, 2.0)]]
    assert set(left) == {1, 0}


def test_canceled_between_two_poses_the_robot_stands(make_session):
    session = make_session()
    handle = session.send(5.0, via=(Pose.planar(1.0, 0.0), Pose.planar(4.0, 0.0)))
    left = watched(handle)
    while not left or left[-1] == 2:
        session.clock.sleep(0.1)
    handle.cancel()
    assert handle.wait().outcome == Outcome.CANCELED
    assert session.robot.command.is_stopped() and handle.feedback.via_left == 1


def test_a_pose_where_the_robot_stands_is_passed_at_once(make_session):
    session = make_session()
    handle = session.send(1.0, via=(Pose.planar(0.0, 0.0),))
    left = watched(handle)
    assert handle.wait().success and set(left) == {0}


def test_a_paused_goal_keeps_the_poses_that_are_left(make_session):
    session = make_session(planner_frequency=2.0)
    handle = session.send(3.0, via=(Pose.planar(1.0, 0.0), Pose.planar(2.5, 0.0)))
    left = watched(handle)
    while not left or left[-1] == 2:
        session.clock.sleep(0.1)
    handle.pause()
    session.clock.sleep(0.5)
    plans = session.plans
    session.clock.sleep(5.0)
    assert session.plans == plans and session.robot.command.is_stopped()
    handle.resume()
    assert handle.wait().success and left[-1] == 0
    assert len(asked(session)[plans]) == 1


def test_via_poses_and_a_goal_area_are_refused_together(make_session):
    session = make_session()
    handle = session.send(2.0, via=VIA, goal_area=DiscArea(Pose.planar(2.0, 0.0), 0.5))
    assert handle.status is GoalStatus.REJECTED and handle.wait().outcome == Outcome.FAILURE
    assert "goal area" in handle.result.message


def test_a_via_pose_in_an_unknown_frame_is_a_tf_error(make_session):
    session = make_session()
    result = session.send(2.0, via=(Pose.planar(1.0, 0.0, frame_id="nowhere"),)).wait()
    assert result.outcome == Outcome.TF_ERROR and "nowhere" in result.message


def test_what_is_no_pose_is_refused_with_its_place_in_the_list():
    with pytest.raises(TypeError, match=r"via\[1\] must be a Pose, such as .*, got tuple"):
        MoveBaseGoal(Pose.planar(1.0, 0.0), via=[Pose.planar(0.0, 0.0), (1.0, 2.0)])


# ----------------------------------------------------------------------------------------------- places on a path
def test_a_path_by_a_later_pose_first_passes_it_after_the_earlier_one():
    path = Path.from_points([[x, 0.0, 0.0] for x in (*np.arange(0.0, 4.0), *np.arange(4.0, -1.0, -1.0))])
    via = ViaPoses([Pose.planar(4.0, 0.0), Pose.planar(1.0, 0.0)])
    via.plan()
    via.follow(path)
    via.note_progress(6.0, 0.1)  # beside the second pose for the first time
    assert len(via.left) == 2
    via.note_progress(4.0, 0.1)
    assert [pose.x for pose in via.left] == [1.0]
    via.note_progress(1.0, 0.1)
    assert via.left == ()


def test_a_pose_is_passed_within_the_tolerance_and_a_plan_that_was_asked_for_before_does_not_bring_it_back():
    path = Path.from_points([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    via = ViaPoses([Pose.planar(1.0, 0.0), Pose.planar(3.0, 0.0)])
    via.plan()
    via.follow(path)
    for to_go, count in ((3.2, 2), (3.05, 1)):
        via.note_progress(to_go, 0.1)
        assert len(via.left) == count
    via.follow(path)
    via.note_progress(2.9, 0.1)
    assert [pose.x for pose in via.left] == [3.0]


def test_a_robot_that_stands_where_its_goal_is_plans_on_while_poses_are_left(make_session):
    session = make_session(planner_frequency=2.0)
    session.controller.play(drive(0.0))
    handle = session.send(0.05, via=(Pose.planar(2.0, 0.0),), dist_tolerance=0.01)
    session.clock.sleep(3.2)
    assert session.plans >= 6
    handle.cancel()
    assert handle.wait().outcome == Outcome.CANCELED


def naive_rests(points, poses):
    """Twin of ``rests_along``: walks over the segments of a path one by one."""
    begins = [0.0]
    for a, b in pairwise(points):
        begins.append(begins[-1] + math.dist(a, b))
    place, rests = 0.0, []
    for pose in poses:
        visits = []  # gap and place, of each segment that does not end before the last place
        for a, b, begin, end in zip(points, points[1:], begins, begins[1:], strict=False):
            if end < place:
                continue
            side = [q - p for p, q in zip(a, b, strict=True)]
            squared = sum(s * s for s in side)
            along = sum((r - p) * s for r, p, s in zip(pose, a, side, strict=True)) / max(squared, 1e-18)
            along = min(max(along, max(place - begin, 0.0) / max(end - begin, 1e-18)), 1.0)
            foot = [p + along * s for p, s in zip(a, side, strict=True)]
            visits.append((math.dist(foot, pose), begin + along * (end - begin)))
        least = min(gap for gap, _ in visits)
        first = next(k for k, (gap, _) in enumerate(visits) if gap <= least + SAME_PLACE)
        last = next((k for k in range(first, len(visits)) if visits[k][0] > least + SAME_PLACE), len(visits))
        place = min(visits[first:last])[1]
        rests.append(begins[-1] - place)
    return rests


# quarters: of two places of a path that are equally near to a pose both ways of counting take the same one
coordinates = st.tuples(*[st.integers(-12, 12).map(lambda k: k / 4.0)] * 2, st.just(0.0))


@given(st.lists(coordinates, min_size=2, max_size=12), st.lists(coordinates, max_size=4))
def test_places_along_a_path_are_those_of_a_walk_over_its_segments(points, poses):
    rests = rests_along(Path.from_points(points), [Pose(pose) for pose in poses])
    assert len(rests) == len(poses) and rests == sorted(rests, reverse=True)
    assert rests == pytest.approx(naive_rests(points, poses), abs=1e-6)


def test_of_a_path_of_one_pose_nothing_is_left():
    assert rests_along(Path([[1.0, 0.0, 0.0]]), [Pose.planar(1.0, 0.0)]) == [0.0]
