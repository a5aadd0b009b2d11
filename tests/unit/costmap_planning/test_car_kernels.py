"""The kernels under hybrid A*: where the car fits, what its arcs cost, the tree, and the search against a plain one."""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import footprint_samples
from mbf_costmap_nav.kernels.car.curves import curve_between
from mbf_costmap_nav.kernels.car.ground import CLOSE_COST, driven_cost, fitting_cost, ground_of, pose_cost
from mbf_costmap_nav.kernels.car.motion_primitives import (
    BACKWARD_SIDE,
    FORWARD_SIDE,
    MOTIONS,
    NO_MOTION,
    Car,
    curve_cost,
    direction_of,
    path_from_root,
    sample_arc,
    steering_of,
)
from mbf_costmap_nav.kernels.car.shorter_drive import drive_costs, shortened
from mbf_costmap_nav.kernels.car.state_tree import best_state, new_tree, with_state
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner

seeds = st.integers(0, 2**32 - 1)
POINT = np.zeros((1, 2))
NEVER = np.zeros(1, dtype=np.uint8)


def a_car(**changes):
    values = {"radius": 0.6, "reversing": True, "cost_factor": 2.0, "reverse_factor": 2.0, "turning_factor": 1.05}
    values |= {"change_cost": 0.3, "bin_size": 0.1, "step": 0.15, "pieces": 2}
    return Car(**(values | changes))


@settings(max_examples=60, deadline=None)
@given(seed=seeds, length=st.floats(0.1, 1.5), width=st.floats(0.1, 1.0), share=st.floats(0.0, 0.05))
def test_where_no_obstacle_is_near_the_short_answer_is_the_full_one(seed, length, width, share):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.uniform(size=(60, 70)) < share, 254, 7).astype(np.uint8)
    outline = np.array([[length, width], [-0.2, width], [-0.2, -width], [length, -width]])
    geometry, samples = np.array([0.1, -2.0, 5.0]), footprint_samples(outline, 0.1)
    ground = ground_of(cells, 252, geometry, samples)
    poses = rng.uniform((-2.5, 4.5, -4.0), (5.5, 11.5, 4.0), (60, 3))
    for pose in poses:
        assert fitting_cost(ground, pose) == pose_cost(cells, 252, geometry, samples, pose)


def test_kernels_get_the_cells_of_a_ground_read_only_whose_ever_they_are():
    cells = np.zeros((20, 20), dtype=np.uint8)
    ground = ground_of(cells, 252, np.array([0.1, 0.0, 0.0]), POINT)
    cells[3, 4] = 254
    assert not ground.cells.flags.writeable
    assert ground.cells[3, 4] == 254, "they are the same cells"


@settings(max_examples=40, deadline=None)
@given(seed=seeds, share=st.floats(0.0, 0.05), rooms=st.tuples(st.floats(0.05, 0.4), st.floats(0.0, 0.05)))
def test_a_pose_costs_more_for_each_larger_outline_that_does_not_fit(seed, share, rooms):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.uniform(size=(60, 70)) < share, 254, 7).astype(np.uint8)
    geometry = np.array([0.1, -2.0, 5.0])
    sizes = [(0.5 + room, 0.25 + room) for room in (0.0, *rooms)]
    outlines = [np.array([[a, b], [-a, b], [-a, -b], [a, -b]]) for a, b in sizes]
    samples, larger, slightly_larger = (footprint_samples(outline, 0.1) for outline in outlines)
    ground = ground_of(cells, 252, geometry, samples, larger, slightly_larger)
    for pose in rng.uniform((-2.5, 4.5, -4.0), (5.5, 11.5, 4.0), (60, 3)):
        costs = [pose_cost(cells, 252, geometry, one, pose) for one in (samples, larger, slightly_larger)]
        missing = 2 if costs[2] < 0 else 1 if costs[1] < 0 else 0
        assert fitting_cost(ground, pose) == (-1 if costs[0] < 0 else costs[0] + missing * CLOSE_COST)


@settings(max_examples=50, deadline=None)
@given(seed=seeds, radius=st.floats(0.3, 8.0), side=st.sampled_from([FORWARD_SIDE, BACKWARD_SIDE]))
def test_arcs_are_joined_without_a_gap_and_turn_by_their_length(seed, radius, side):
    rng = np.random.default_rng(seed)
    car, pose = a_car(radius=radius, step=0.5, pieces=7), rng.uniform(-3.0, 3.0, 3)
    tree, states = new_tree(pose, 0, NO_MOTION), [pose]
    for number, motion in enumerate(rng.integers(0, MOTIONS, 4).tolist()):
        along = side * 0.5 * direction_of(motion)
        turn = along * steering_of(motion) / radius
        chord, heading = along * np.sinc(turn / (2.0 * np.pi)), pose[2] + 0.5 * turn
        pose = pose + np.array([chord * np.cos(heading), chord * np.sin(heading), turn])
        tree = with_state(tree, pose, 0.0, number + 1, number, motion)
        states.append(pose)
    path = path_from_root(tree, 4, side, car)
    assert path[::7] == pytest.approx(np.array(states), abs=1e-9)
    assert np.hypot(*np.diff(path[:, :2], axis=0).T).max() <= 0.5 / 7 + 1e-9


@settings(max_examples=50, deadline=None)
@given(seed=seeds)
def test_what_is_driven_costs_the_mean_of_its_poses_and_nothing_blocked_is_driven(seed):
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([0, 0, 0, 0, 100, 254], dtype=np.uint8), (20, 20))
    start, poses = rng.uniform(0.0, 2.0, 3), rng.uniform(0.0, 2.0, (2, 3))
    cost = driven_cost(ground_of(cells, 252, np.array([0.1, 0.0, 0.0]), POINT), start, poses)
    corners = np.vstack([start, poses])[:, :2]
    dense = np.concatenate([a + np.linspace(0, 1, 2001)[:, None] * (b - a) for a, b in pairwise(corners)])
    crossed = cells[tuple((dense / 0.1).astype(int).T[::-1])]
    mean = cells[tuple((poses[:, :2] / 0.1).astype(int).T[::-1])].mean()
    assert cost < 0.0 or (crossed.max() < 253 and cost == pytest.approx(mean))
    assert cost >= 0.0 or (crossed >= 253).any() or min_gap_to_blocked(cells, dense) < 2e-3


def min_gap_to_blocked(cells, points):
    """Least distance [m] from points to a blocked cell: lines may clip a corner between two samples."""
    iy, ix = np.nonzero(cells >= 253)
    low = np.column_stack([ix, iy]) * 0.1
    gaps = np.maximum(np.maximum(low - points[:, None], points[:, None] - low - 0.1), 0.0)
    return np.hypot(gaps[..., 0], gaps[..., 1]).min()


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_a_tree_finds_the_latest_state_of_every_bin_however_many_there_are(seed):
    rng = np.random.default_rng(seed)
    tree, twin = new_tree(np.zeros(3), 5, NO_MOTION), {5: 0}
    bins = rng.integers(0, 2**40, 300) * 72
    for state in range(1, 10_000):
        key = int(rng.choice(bins) if state % 2 else bins[0] + 72 * state)
        tree = with_state(tree, np.full(3, float(state)), 0.5 * state, key, state - 1, state % MOTIONS)
        twin[key] = state
    assert all(best_state(tree, key) == state for key, state in twin.items())
    assert best_state(tree, 3) == -1 and tree.made[0] == 10_000
    assert (tree.poses[:10_000, 1] == np.arange(10_000)).all() and (tree.parents[1:10_000] == np.arange(9_999)).all()


@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_a_curve_costs_on_average_what_its_poses_cost(seed):
    rng = np.random.default_rng(seed)
    cells, car = np.full((100, 100), 126, dtype=np.uint8), a_car()
    ground = ground_of(cells, 252, np.array([0.1, 0.0, 0.0]), POINT)
    start, end = rng.uniform((3.0, 3.0, -3.0), (7.0, 7.0, 3.0), (2, 3))
    word = curve_between(start, end, car.radius, True)
    cost = curve_cost(ground, car, start, word, 0.0, 0.0, math.inf)
    weights = np.where(word[:, 1] < 0.0, 2.0, 1.0) * np.where(word[:, 0] == 0.0, 1.0, 1.05)
    directions = np.sign(word[np.abs(word[:, 1]) > 1e-9, 1])
    changes = np.count_nonzero(np.diff(directions))
    assert cost == pytest.approx(2.0 * car.radius * (weights * np.abs(word[:, 1])).sum() + 0.3 * changes)
    assert math.isinf(curve_cost(ground, car, start, word, 0.0, 0.0, 0.99 * cost))


@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_a_shortened_path_keeps_its_ends_stays_free_and_costs_no_more(seed):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.uniform(size=(80, 80)) < 0.002, 254, 20).astype(np.uint8)
    cells[30:50, 30:50] = 20
    car, ground = a_car(), ground_of(cells, 252, np.array([0.1, 0.0, 0.0]), footprint_samples(SQUARE, 0.1))
    poses, arc = [np.array([4.0, 4.0, 0.0])], np.empty((2, 3))
    for motion in rng.integers(0, MOTIONS, 60).tolist():
        sample_arc(poses[-1], motion, FORWARD_SIDE, car, arc)
        if driven_cost(ground, poses[-1], arc) >= 0.0:
            poses.extend(arc.copy())
    path = np.array(poses)
    shorter, cost = shortened(ground, car, path, NEVER)
    assert shorter[0] == pytest.approx(path[0])
    assert shorter[-1, :2] == pytest.approx(path[-1, :2], abs=1e-6)
    assert math.cos(shorter[-1, 2] - path[-1, 2]) == pytest.approx(1.0)
    assert cost <= drive_costs(ground, car, path)[0][-1] + 1e-9
    assert len(shorter) < 2 or driven_cost(ground, shorter[0], shorter[1:]) >= 0.0
    steps, turns = np.hypot(*np.diff(shorter[:, :2], axis=0).T), np.abs(np.diff(shorter[:, 2]))
    assert (steps <= 0.1 + 1e-9).all() and (turns <= steps / car.radius * 1.02 + 1e-6).all()


SQUARE = np.array([[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]])


def cost_of_a_plain_search(ground, car, start, goal):
    """Least cost by uniform-cost search over all states, each tried for a curve to the goal; inf without a way."""

    def bin_of(pose):
        return int(pose[0] / car.bin_size), int(pose[1] / car.bin_size), round(pose[2] / (2 * math.pi) * 72) % 72

    best, queue, number, found = {bin_of(start): 0.0}, [(0.0, 0, start, NO_MOTION)], 0, math.inf
    arc = np.empty((car.pieces, 3))
    while queue and queue[0][0] < found:
        g, _, pose, before = heapq.heappop(queue)
        if g > best[bin_of(pose)]:
            continue
        word = curve_between(pose, goal, car.radius, car.reversing)
        found = min(found, g + curve_cost(ground, car, pose, word, direction_of(before), 0.0, math.inf))
        for motion in range(MOTIONS if car.reversing else 3):
            sample_arc(pose, motion, FORWARD_SIDE, car, arc)
            cost = driven_cost(ground, pose, arc)
            weight = (car.reverse_factor if motion >= 3 else 1.0) * (1.0 if motion % 3 == 1 else car.turning_factor)
            g_new = g + car.step * weight * (1.0 + car.cost_factor * cost / 252.0)
            g_new += car.change_cost if direction_of(before) * direction_of(motion) < 0.0 else 0.0
            if cost >= 0.0 and g_new < best.get(bin_of(arc[-1]), math.inf):
                best[bin_of(arc[-1])], number = g_new, number + 1
                heapq.heappush(queue, (g_new, number, arc[-1].copy(), motion))
    return found


@pytest.mark.parametrize("reversing", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_what_a_plain_search_of_all_states_reaches_is_reached_at_a_cost_near_the_least(
    make_plugin, closed_loop, seed, reversing
):
    rng = np.random.default_rng([seed, reversing])
    cells = np.where(rng.uniform(size=(24, 24)) < 0.04, 254, 0).astype(np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = 254
    grid, outline = Costmap(closed_loop.inflated(cells, 0.15, 0.15, 0.6, 4.0), 0.15), 1.5 * SQUARE
    ground = ground_of(grid.cells, 252, np.array([0.15, 0.0, 0.0]), footprint_samples(outline, 0.15))
    car = a_car(radius=0.5, reversing=reversing, bin_size=0.15, step=0.225)
    while True:
        start, goal = rng.uniform((0.3, 0.3, -3.0), (3.3, 3.3, 3.0), (2, 3))
        if min(fitting_cost(ground, start), fitting_cost(ground, goal)) >= 0:
            break
    least = cost_of_a_plain_search(ground, car, start, goal)
    planner = make_plugin(
        HybridAStarPlanner, grid, footprint=Footprint(outline), min_turning_radius=0.5, allow_reversing=reversing
    )
    result = planner.make_plan(PlanRequest(Pose.planar(*start), Pose.planar(*goal)))
    assert result.success or math.isinf(least)
    if math.isfinite(least) and result.success:
        assert result.cost <= 2.0 * least + 0.5
