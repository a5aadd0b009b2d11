"""What smoothed paths touch between their poses, in random worlds: nothing worse than their plans do near there."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import AS_CONFIGURED, PADDED, CellState
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.collision import footprint_costs
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.swept_outline import swept_states
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.refiners.smoother import SmootherRefiner

STEP = 0.01
"""m between the poses that are looked at."""


def boxes(rng):
    """A layered costmap of 3 to 7 m with boxes and unknown cells, for an oblong robot or a round one."""
    side = int(rng.integers(60, 140))
    cells = np.zeros((side, side), dtype=np.uint8)
    for value, count in ((254, rng.integers(3, 14)), (255, rng.integers(0, 2))):
        for _ in range(count):
            (x, y), (width, height) = rng.integers(0, side, 2), rng.integers(1, side // 4, 2)
            cells[y : y + height, x : x + width] = value
    length, width, shift = rng.uniform((0.1, 0.1, -0.09), (0.7, 0.35, 0.09))
    corners = [(x + shift, y) for x, y in ((length, width), (-length, width), (-length, -width), (length, -width))]
    outline = {"footprint": tuple(corners)} if rng.random() < 0.7 else {"robot_radius": float(width)}
    layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
    section = CostmapParameters(
        resolution=0.05, layers=layers, footprint_padding=0.02, track_unknown_space=True, **outline
    )
    inflation = {"inflation_radius": rng.uniform(0.3, 1.0), "cost_scaling_factor": rng.uniform(2.0, 15.0)}
    costmap = build_layered_costmap(section, {"inflation": inflation}, static_map=Costmap(cells, 0.05))
    costmap.update(None, 0.0)
    return costmap


def densely(path):
    """Poses along a path, ``STEP`` apart, each looking along its line."""
    poses = [path[0]]
    for a, b in zip(path.positions[:-1], path.positions[1:], strict=True):
        count = int(np.ceil(np.hypot(*(b - a)[:2]) / STEP))
        yaw = float(np.arctan2(*(b - a)[1::-1]))
        poses += [
            Pose.planar(*(a + share * (b - a))[:2].tolist(), yaw) for share in np.arange(count + 1) / max(count, 1)
        ]
    return Path.from_poses([*poses, path[-1]])


def random_plans(make_plugin, seeds):
    """Costmaps and paths of two planners between random poses."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        costmap = boxes(rng)
        size = costmap.geometry.width * 0.05
        for number in range(4):
            start, goal = (Pose.planar(*rng.uniform((0.2, 0.2, -3.0), (size - 0.2, size - 0.2, 3.0))) for _ in range(2))
            planner_class = (AStarPlanner, ThetaStarPlanner)[number % 2]
            planner = make_plugin(planner_class, FREE, costmap=costmap, allow_unknown=number > 1)
            plan = planner.make_plan(PlanRequest(start, goal))
            if plan.success and len(plan.path) > 3:
                yield costmap, plan.path, float(rng.choice([0.005, 0.02, 0.1]))


FREE = Costmap(np.zeros((4, 4), dtype=np.uint8), 0.05)
HARD = (35, 36, 190, 273, 305, 319, 327)
"""Worlds in which lines between smoothed poses once touched what the plan did not."""


@pytest.mark.parametrize("seeds", [HARD, range(1000, 1040)], ids=["found", "random"])
def test_between_its_poses_a_smoothed_path_is_on_no_worse_cells_than_its_plan(make_plugin, seeds):
    changed = 0
    for costmap, path, data_weight in random_plans(make_plugin, seeds):
        smoother = make_plugin(SmootherRefiner, FREE, costmap=costmap, data_weight=data_weight)
        result = smoother.apply_refinement(path, CancelToken())
        assert result.outcome == RefinePathOutcome.SUCCESS
        changed += result.path is not path
        for query in (AS_CONFIGURED, PADDED):
            check = costmap.pose_check(query)
            before, after = (check_path(check, densely(one)).state for one in (path, result.path))
            assert after <= before
    assert changed > 10


def test_a_plan_that_touches_an_obstacle_at_its_begin_is_smoothed_past_no_other(make_plugin):
    cells = np.zeros((120, 120), dtype=np.uint8)
    cells[24:30, 10:13] = 254  # beside the robot's left wheel at the start
    cells[26:, :74] = 254  # on the inner side of the corner: the outline of a shorter path reaches over it
    section = CostmapParameters(
        resolution=0.05,
        layers=({"name": "walls", "type": "static"},),
        footprint=((0.6, 0.25), (-0.2, 0.25), (-0.2, -0.25), (0.6, -0.25)),
    )
    costmap = build_layered_costmap(section, {}, static_map=Costmap(cells, 0.05))
    costmap.update(None, 0.0)
    corner = Path.from_points([(0.7, 1, 0), (4, 1, 0), (4, 4, 0)])
    check = costmap.pose_check(AS_CONFIGURED)
    assert check(corner[0]).state is CellState.LETHAL

    smoother = make_plugin(SmootherRefiner, FREE, costmap=costmap, data_weight=0.005, highest_cost=252)
    path = smoother.apply_refinement(corner, CancelToken()).path

    assert path.length < corner.length
    touched = [pose.x for pose in densely(path) if check(pose).state >= CellState.LETHAL]
    assert max(touched) < 1.5


def swept_by_hand(costmap, outline, start, end):
    """The slow twin: the outline at many places of the line."""
    yaw = float(np.arctan2(*(end - start)[::-1]))
    counts = [footprint_costs(costmap, outline, *(start + t * (end - start)), yaw) for t in np.linspace(0.0, 1.0, 400)]
    return max(one.state for one in counts), max(one.known for one in counts)


def test_the_cells_an_outline_sweeps_are_those_of_all_its_poses():
    rng = np.random.default_rng(3)
    for outline in (Footprint([[1.5, 0.8], [-2.0, 1.1], [-1.0, -0.9]]), Footprint([]), Footprint.circle(1.3)):
        corners = outline.vertices if len(outline.vertices) > 2 else np.zeros((1, 2))
        for _ in range(60):
            cells = rng.choice([0, 253, 254, 255], (20, 20), p=[0.93, 0.03, 0.02, 0.02]).astype(np.uint8)
            points = rng.uniform(-0.5 if rng.random() < 0.2 else 4.0, 16.0, (2, 2))
            state, known = swept_states(cells, corners, points)[0].tolist()
            twin = swept_by_hand(Costmap(cells, 1.0), outline, *points)
            assert state >= twin[0] and known >= (twin[1] if twin[0] < CellState.OUTSIDE else 0)
            if state != twin[0]:  # a corner of a cell that samples miss
                near = swept_by_hand(Costmap(cells, 1.0), outline.offset(0.02), *points)
                assert state <= near[0] or near[0] is CellState.OUTSIDE
