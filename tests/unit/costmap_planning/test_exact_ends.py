"""Paths over cells that begin and end exactly where they are asked to: the kernel against the numpy formulas."""

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.planning.search_grid import NEAR_END, GridPlannerParameters, SearchGrid


def from_exactly(grid, exact, points):
    """Begin with a point of the first point's cell instead of that point, and of what lies as near."""
    if len(points) == 1:
        return np.stack([exact, points[0]])
    far = np.hypot(*(points[1:-1] - exact).T) > NEAR_END * grid.costmap.resolution
    rest = points[1 + (int(np.argmax(far)) if far.any() else len(far)) :]
    return np.vstack([exact, rest if grid.is_free_line(exact, rest[0]) else points])


def with_exact_ends(grid, points, start, goal):
    points = from_exactly(grid, np.array([start.x, start.y]), points)
    return points if goal is None else from_exactly(grid, np.array([goal.x, goal.y]), points[::-1])[::-1]


def grids(rng, count):
    for number in range(count):
        cells = rng.choice([0, 100, 254, 255], (40, 50), p=[0.7, 0.2, 0.05, 0.05]).astype(np.uint8)
        parameters = GridPlannerParameters(allow_unknown=number % 2 == 0, lethal_cost=(253, 90)[number // 2 % 2])
        yield SearchGrid.build(Costmap(cells, 0.05, -1.0, 0.3), parameters, CancelToken())


def test_exact_ends_are_those_of_the_numpy_formulas():
    rng, kept = np.random.default_rng(3), 0
    for grid in grids(rng, 400):
        walk = 20 + np.cumsum(rng.integers(-1, 2, (int(rng.integers(1, 15)), 2)), axis=0)
        points = grid.costmap.cells_to_world(walk)
        ends = points[[0, -1]] + 0.05 * rng.uniform(-0.5, 0.5, (2, 2))
        start, goal = (Pose.planar(*end) for end in ends.tolist())
        for end in (goal, None):
            expected = with_exact_ends(grid, points, start, end)
            given = grid.with_exact_ends(points, start, end)
            assert given.tobytes() == np.ascontiguousarray(expected).tobytes()
            kept += len(given) > len(points)
    assert 100 < kept < 700


def test_the_centres_of_cells_are_those_of_the_map():
    rng = np.random.default_rng(4)
    for grid in grids(rng, 20):
        cells = rng.integers((0, 0), (50, 40), (30, 2))
        indices = np.array([grid.index(tuple(cell)) for cell in cells.tolist()], dtype=np.int32)
        assert grid.points(indices).tobytes() == grid.costmap.cells_to_world(cells).tobytes()
