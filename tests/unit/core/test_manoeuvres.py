"""The manoeuvre search: what it returns can be driven and is shortest, compared with trying every sequence of steps.

Here it asks about one pose after the other, ``find``; as its naive twin does, which must find the same.
"""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.maps.kernels.steps import distances_from_points
from mbf_abstract.maps.manoeuvres import (
    CELL,
    GEAR_CHANGE_COST,
    HEADING,
    HEADINGS,
    STEP,
    Step,
    find_manoeuvre,
    kinds_of_steps,
)
from mbf_abstract.maps.queries import one_by_one

ORIGIN = (0.0, 0.0, 0.0)
DISCS = st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(0.05, 0.4)), max_size=6)


def clear_of(discs):
    return lambda pose: all(math.hypot(pose[0] - x, pose[1] - y) > radius for x, y, radius in discs)


def off_the_axis(distance):
    """Ends where it is this far [m] from the x axis."""
    return lambda pose: max(distance - abs(pose[1]), 0.0)


def find(is_free, left, most, turning_radius=0.0, **options):
    return find_manoeuvre(one_by_one(is_free, bool), one_by_one(left, float), most, turning_radius, **options)


def begun_at(kind, begin):
    """The same step from another pose than the origin."""
    x, y, yaw = begin
    c, s = math.cos(yaw), math.sin(yaw)
    moved = [(x + c * ahead - s * left, y + s * ahead + c * left, yaw + turn) for ahead, left, turn in kind.poses]
    return Step(kind.gear, tuple(moved), kind.cost)


def naive_search(is_free, left, most, turning_radius):
    """The same search, step by step and pose by pose."""

    def key(pose):
        return round(pose[0] / CELL), round(pose[1] / CELL), round(pose[2] / HEADING) % HEADINGS

    settled, queue, count = set(), [(0.0, 0, 0.0, ORIGIN, ())], 0
    while queue:
        _, _, cost, pose, steps = heapq.heappop(queue)
        if key(pose) in settled:
            continue
        settled.add(key(pose))
        if left(pose) <= 0.0:
            return list(steps)
        for kind in kinds_of_steps(turning_radius):
            step = begun_at(kind, pose)
            changes = bool(steps) and step.gear * steps[-1].gear < 0
            end, after = step.poses[-1], cost + step.cost + (GEAR_CHANGE_COST if changes else 0.0)
            if key(end) not in settled and after + left(end) <= most and all(map(is_free, step.poses)):
                count += 1
                heapq.heappush(queue, (after + left(end), count, after, end, (*steps, step)))
    return None


def cost_of(steps):
    changes = sum(a.gear * b.gear < 0 for a, b in pairwise(steps))
    return sum(step.cost for step in steps) + GEAR_CHANGE_COST * changes


def least_cost(is_free, left, depth, turning_radius, at=ORIGIN, gear=0):
    """Cost of the cheapest of all sequences of steps of a length, by trying every one; inf if none ends there."""
    if left(at) <= 0.0:
        return 0.0
    if depth == 0:
        return math.inf
    costs = [math.inf]
    for kind in kinds_of_steps(turning_radius):
        step = begun_at(kind, at)
        if all(is_free(pose) for pose in step.poses):
            rest = least_cost(is_free, left, depth - 1, turning_radius, step.poses[-1], kind.gear)
            costs.append(rest + step.cost + (GEAR_CHANGE_COST if gear * kind.gear < 0 else 0.0))
    return min(costs)


@given(DISCS, st.floats(0.1, 0.6), st.sampled_from([0.0, 0.8]))
@example([], 0.5, 0.0)
@example([], 0.5, 0.8)
def test_a_manoeuvre_joins_is_free_and_ends_where_it_shall(discs, distance, turning_radius):
    is_free, left = clear_of(discs), off_the_axis(distance)
    steps = find(is_free, left, 3.0, turning_radius)
    assert steps is not None or discs, "nothing is in its way"
    if steps is None:
        return
    at = ORIGIN
    for step in steps:
        ways = [begun_at(kind, at) for kind in kinds_of_steps(turning_radius)]
        assert step in ways, "each step begins where the last one ended"
        assert all(map(is_free, step.poses))
        at = step.poses[-1]
    assert left(at) == 0.0
    assert cost_of(steps) <= 3.0
    assert turning_radius == 0.0 or all(step.gear for step in steps)


@given(DISCS, st.floats(0.1, 0.3), st.sampled_from([0.0, 0.8]))
@example([], 0.2, 0.0)
@example([], 0.2, 0.8)
def test_no_sequence_of_steps_is_shorter_by_more_than_a_step(discs, distance, turning_radius):
    """Poses that share a cell are one state, so it may miss the very shortest by a little, but not by a step."""
    is_free, left = clear_of(discs), off_the_axis(distance)
    naive = least_cost(is_free, left, 3, turning_radius)
    steps = find(is_free, left, 4.0, turning_radius)
    assert naive < math.inf or discs, "nothing is in its way"
    if naive < math.inf:
        assert steps is not None and cost_of(steps) <= naive + STEP


@settings(max_examples=30)
@given(DISCS, st.floats(0.1, 0.6), st.sampled_from([0.0, 0.8]))
@example([(0.3, 0.0, 0.2), (-0.4, 0.3, 0.2)], 0.6, 0.0)
def test_it_finds_what_a_search_finds_that_asks_pose_by_pose(discs, distance, turning_radius):
    questions = clear_of(discs), off_the_axis(distance)
    assert find(*questions, 1.5, turning_radius) == naive_search(*questions, 1.5, turning_radius)


def test_distances_are_those_from_the_nearest_point():
    rng = np.random.default_rng(0)
    points, poses = rng.normal(size=(40, 2)), rng.normal(size=(9, 3))
    naive = [min(math.sqrt((px - x) ** 2 + (py - y) ** 2) for px, py in points.tolist()) for x, y, _ in poses.tolist()]
    assert distances_from_points(points, poses).tolist() == naive
    assert distances_from_points(points[:0], poses).tolist() == [math.inf] * 9


def test_a_robot_in_a_corridor_backs_into_the_bay():
    def is_free(pose):
        x, y, _ = pose
        return abs(y) < 0.1 or (-1.6 < x < -0.9 and 0.0 < y < 1.0)

    steps = find(is_free, off_the_axis(0.7), 4.0)
    assert {step.gear for step in steps[:2]} == {-1}
    x, y, _ = steps[-1].poses[-1]
    assert -1.6 < x < -0.9 and y >= 0.7


def test_where_it_stands_is_the_end_if_nothing_is_left():
    assert find(lambda pose: False, lambda pose: 0.0, 1.0) == []


@pytest.mark.parametrize(
    ("is_free", "most", "canceled"),
    [(lambda pose: False, 9.0, False), (lambda pose: True, 0.5, False), (lambda pose: True, 9.0, True)],
    ids=["boxed in", "too far", "canceled"],
)
def test_without_a_place_there_is_no_manoeuvre(is_free, most, canceled):
    assert find(is_free, off_the_axis(1.0), most, is_canceled=lambda: canceled) is None


def test_a_robot_that_turns_on_the_spot_does_so_where_it_is_shorter():
    steps = find(lambda pose: abs(pose[0]) < 0.05, off_the_axis(0.5), 9.0)
    assert [step.gear for step in steps[:3]] == [0, 0, 0], "it turns aside before it drives"
    assert abs(steps[2].poses[-1][2]) == pytest.approx(3 * HEADING)


def test_a_car_keeps_to_its_turning_radius():
    steps = find(lambda pose: True, off_the_axis(1.0), 9.0, turning_radius=1.2)
    assert steps
    for step in steps:
        turned = step.poses[-1][2] - step.poses[0][2]
        driven = math.dist(step.poses[-1][:2], step.poses[0][:2])
        assert step.gear != 0 and abs(turned) <= driven / 1.2 + 0.01
