"""Where an outline gets to nowhere even sideways, no car gets, and the planner says so, and where it is stuck."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.car.outline_flood import BITS, DEPTH, HEADINGS, covered_runs, flood, open_headings
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from mbf_costmap_nav.planning.outline_reach import where_outline_is_stuck

CAR = Footprint([[0.75, 0.29], [-0.17, 0.29], [-0.17, -0.29], [0.75, -0.29]])
ARROW = Footprint([[0.7, 0.0], [0.3, 0.25], [-0.2, 0.25], [-0.2, -0.25], [0.3, -0.25]])
OUTLINES = {
    "box": [[3.2, 1.4], [-3.2, 1.4], [-3.2, -1.4], [3.2, -1.4]],
    "notched": [[3.0, 2.0], [0.0, 0.8], [-3.0, 2.0], [-3.0, -2.0], [3.0, -2.0]],
}


def naive_reach(lethal, corners, first):
    """Bins (ix, iy, heading) reached from one, bin by bin; the outline's corners (n, 2) [cells] are from its middle."""
    height, width = lethal.shape
    places = np.argwhere(np.pad(lethal, 8, constant_values=True))[:, ::-1] - 8.0
    sides = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))

    longest = np.hypot(*corners.T).max() + 1.0
    offsets = np.array([(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)])[:, None]

    def is_open(ix, iy, heading):
        around = places - (ix, iy)
        shifted = around[np.hypot(*around.T) < longest] + offsets
        deep = np.ones(shifted.shape[1], dtype=bool)
        for turn in (-0.5, 0.5):
            angle = (heading + turn) * 2.0 * math.pi / HEADINGS
            c, s = math.cos(angle), math.sin(angle)
            points = (shifted @ [[c, -s], [s, c]]).reshape(-1, 2)
            inside = inside_polygon(points, corners)
            for a, b in sides:
                along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
                inside &= np.hypot(*(points - a - along[:, None] * (b - a)).T) >= DEPTH
            deep &= inside.reshape(4, -1).all(axis=0)
        return not deep.any()

    seen, waiting, answers = {first}, [first], {}
    while waiting:
        x, y, heading = waiting.pop()
        for step in np.ndindex(3, 3, 3):
            to = x + step[0] - 1, y + step[1] - 1, (heading + step[2] - 1) % HEADINGS
            if to in seen or not (0 <= to[0] < width and 0 <= to[1] < height):
                continue
            if to not in answers:
                answers[to] = is_open(*to)
            if answers[to]:
                seen.add(to)
                waiting.append(to)
    return seen


@pytest.mark.parametrize("outline", OUTLINES)
def test_the_flood_reaches_the_bins_that_a_naive_search_reaches(outline):
    corners, lethal = np.array(OUTLINES[outline]), np.zeros((7, 9), dtype=bool)
    lethal[:3, 7] = lethal[6, 3] = True
    words = open_headings(lethal, covered_runs(corners, 4), 4)
    first = (4, 3, 0)
    reached = flood(words, *first)
    bits = (reached[..., None] >> np.arange(BITS, dtype=np.uint64)) & np.uint64(1)
    found = {(int(x), int(y), int(h)) for y, x, h in np.argwhere(bits.reshape(7, 9, HEADINGS))}
    assert found == naive_reach(lethal, corners, first)
    assert 0 < len(found) < 7 * 9 * HEADINGS


def bend(width, angle=0.0, resolution=0.05, size=9.0):
    """A corridor [m] that bends by 90 degrees amid a map, turned by an angle [rad]; poses at its ends."""
    centres = (np.arange(round(size / resolution)) + 0.5) * resolution - 0.5 * size
    x, y = np.meshgrid(centres, centres)
    along, across = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
    free = (np.abs(across) < 0.5 * width) & (along < 0.5 * width)
    free |= (np.abs(along) < 0.5 * width) & (across > -0.5 * width)
    grid = Costmap(np.where(free, 0, 254).astype(np.uint8), resolution, -0.5 * size, -0.5 * size)
    ends = (-3.0, 0.0, angle), (0.0, 3.0, angle + 0.5 * math.pi)
    c, s = math.cos(angle), math.sin(angle)
    return grid, [Pose.planar(c * a - s * b, s * a + c * b, yaw) for a, b, yaw in ends]


@pytest.mark.parametrize("footprint", [CAR, ARROW])
@pytest.mark.parametrize("angle", [0.0, 0.3, 0.785, 2.2])
def test_the_outline_gets_wherever_a_path_leads(make_plugin, footprint, angle):
    answers = []
    for width in (0.6, 0.8, 0.9, 1.0, 1.2, 1.5):
        grid, (start, goal) = bend(width, angle)
        planner = make_plugin(HybridAStarPlanner, grid, footprint=footprint, min_turning_radius=0.8, max_states=60_000)
        found = planner.make_plan(PlanRequest(start, goal)).success
        answers.append((found, where_outline_is_stuck(grid, footprint, start, goal) is None))
    assert (True, False) not in answers
    assert answers[-1] == (True, True) and (footprint is ARROW or answers[0] == (False, False))


def two_rooms(width):
    """Rooms of 12 m x 6 m, and between them a corridor [m] with a bend near (15.7, 3.3); walls that stay."""
    cells, wide = np.full((340, 480), 254, dtype=np.uint8), round(width / 0.05)
    cells[4:120, 4:240] = cells[190:336, 240:476] = 0
    cells[60 : 60 + wide, 240:320] = cells[60:200, 320 - wide : 320] = 0
    return Costmap(cells, 0.05), Pose.planar(3.0, 2.0), Pose.planar(21.0, 14.0, 0.5)


def planner_in(grid, make_plugin, **parameters):
    """The planner on a map whose walls stay."""
    settings = CostmapParameters(
        footprint=CAR.vertices.tolist(), footprint_padding=0.0, layers=[{"name": "walls", "type": "static"}]
    )
    costmap = build_layered_costmap(settings, {}, static_map=grid)
    costmap.update(None, 0.0)
    return make_plugin(HybridAStarPlanner, grid, costmap=costmap, min_turning_radius=1.06, **parameters)


def test_a_bend_that_the_disc_passes_and_the_car_does_not_ends_the_search_for_good_and_is_named(make_plugin):
    grid, start, goal = two_rooms(0.65)
    result = planner_in(grid, make_plugin).make_plan(PlanRequest(start, goal))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and result.permanent
    assert "no way there leaves the robot, 0.92 m x 0.58 m, room to turn or to pass" in result.message
    x, y = map(float, result.message.split("no farther than (")[1].split(")")[0].split(", "))
    assert math.dist((x, y), (15.7, 3.3)) < 0.6


def test_where_it_is_not_known_the_search_ends_with_its_share_of_states_and_says_where_it_was_stuck(make_plugin):
    grid, start, goal = two_rooms(0.75)
    result = planner_in(grid, make_plugin, max_states=60_000).make_plan(PlanRequest(start, goal))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and not result.permanent
    assert "see max_states: the robot got no farther than (" in result.message
    assert int(result.message.split(" within ")[1].split()[0]) <= 60_100


def test_a_bend_that_hardly_lets_the_car_pass_is_found_in_small_bins_before_all_large_ones_are_tried(
    make_plugin, closed_loop
):
    grid, start, goal = two_rooms(0.85)
    inflated = Costmap(closed_loop.inflated(grid.cells, 0.05, 0.17, 0.75, 3.0), 0.05)
    planner = make_plugin(
        HybridAStarPlanner, inflated, footprint=CAR, min_turning_radius=1.06, max_states=400_000, allow_unknown=False
    )
    result = planner.make_plan(PlanRequest(start, goal))
    assert result.success, result.message


def test_nothing_is_known_of_a_point_and_of_who_touches_something_and_a_tolerance_that_reaches_out_will_do():
    grid, (start, goal) = bend(0.6)
    assert where_outline_is_stuck(grid, Footprint([]), start, goal) is None
    assert where_outline_is_stuck(grid, CAR, Pose.planar(-3.0, 0.3), goal) is None
    assert where_outline_is_stuck(grid, CAR, start, goal, 0.5) is not None
    assert where_outline_is_stuck(grid, CAR, start, goal, 5.0) is None
    assert where_outline_is_stuck(grid, CAR, start, goal, math.inf) is None
