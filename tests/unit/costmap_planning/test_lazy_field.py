"""Costs that are worked out only as far as they are asked for are those of the whole field."""

import numpy as np
import pytest
from numba import njit

from mbf_costmap_nav.kernels.search.grid_search import new_search_memory, search
from mbf_costmap_nav.kernels.search.lazy_field import FieldMemory, field_cost, new_field
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid, pad_cells
from mbf_costmap_nav.kernels.search.search_cells import whole_grid
from mbf_costmap_nav.planning.search_grid import traversal_table

NOT_CANCELED = np.zeros(1, dtype=np.uint8)


@njit
def costs_of(memory, source, toward, asked, flag):
    """Costs (n,) of the cells that are asked for, one after the other, and how many cells the field has reached."""
    field = new_field(memory, source, toward, flag)
    costs = np.empty(len(asked), dtype=np.float32)
    for i in range(len(asked)):
        costs[i] = field_cost(field, asked[i])
    reached = 0
    for record in memory.records:
        reached += record.g < np.inf
    return costs, reached


def random_grid(rng, cost_factor=3.0, size=(40, 60), blocked=0.25):
    cells = np.where(rng.random(size) < blocked, 254, rng.integers(0, 253, size) * (rng.random(size) < 0.3))
    table = traversal_table(cost_factor, 253, True)
    return PaddedGrid(pad_cells(cells.astype(np.uint8), 254), size[1] + 2, table)


def memory_for(grid, capacity=None):
    records, buckets = new_search_memory(grid.cells.size)
    buckets = buckets if capacity is None else np.empty((len(buckets), capacity), dtype=np.int32)
    words = records.view(np.uint64).reshape(-1, grid.stride)
    box = whole_grid(grid.cells, grid.stride)
    return FieldMemory(grid.cells.reshape(-1, grid.stride), words, records, grid.table, buckets, box)


def free_cells(grid, rng, count):
    return rng.choice(np.flatnonzero(np.isfinite(grid.table[grid.cells])), count)


@pytest.mark.parametrize("cost_factor", [0.0, 3.0, 200.0])
@pytest.mark.parametrize("capacity", [None, 1])
def test_costs_are_those_of_the_whole_field_whatever_was_asked_before(cost_factor, capacity):
    rng, unreached = np.random.default_rng(5), 0
    for _ in range(40):
        grid = random_grid(rng, cost_factor, blocked=rng.uniform(0.1, 0.65))
        source, toward, *asked = free_cells(grid, rng, 30)
        _, whole, _ = search(grid, source, -1, 0.0, True, False, NOT_CANCELED)
        costs, _ = costs_of(memory_for(grid, capacity), source, toward, np.array(asked), NOT_CANCELED)
        np.testing.assert_allclose(costs, whole[asked], rtol=1e-5)
        unreached += np.isinf(costs).sum()
    assert unreached > 0


def test_a_field_in_the_memory_of_another_has_the_costs_of_one_of_its_own():
    rng = np.random.default_rng(6)
    grid = random_grid(rng)
    memory = memory_for(grid)
    for _ in range(60):
        source, toward, *asked = free_cells(grid, rng, int(rng.integers(3, 12)))
        again, _ = costs_of(memory, source, toward, np.array(asked), NOT_CANCELED)
        alone, _ = costs_of(memory_for(grid), source, toward, np.array(asked), NOT_CANCELED)
        assert again.tobytes() == alone.tobytes()


def test_only_what_is_asked_for_is_worked_out():
    grid = random_grid(np.random.default_rng(7), 0.0, (200, 200), 0.0)
    source, toward = 100 * grid.stride + 60, 100 * grid.stride + 140
    near = np.array([100 * grid.stride + x for x in range(60, 140)])
    costs, reached = costs_of(memory_for(grid), source, toward, near, NOT_CANCELED)
    assert costs.tolist() == list(range(80))
    assert reached < 2_000
    assert costs_of(memory_for(grid), source, toward, np.array([5 * grid.stride + 5]), NOT_CANCELED)[1] > 20_000


def test_a_canceled_field_says_nothing():
    rng = np.random.default_rng(8)
    grid = random_grid(rng)
    source, toward, asked = free_cells(grid, rng, 3)
    memory = memory_for(grid)
    costs_of(memory, source, toward, np.array([asked]), NOT_CANCELED)  # the records are written
    memory.touched[:] = 0
    costs, _ = costs_of(memory, source, toward, np.array([asked]), np.ones(1, dtype=np.uint8))
    assert np.isinf(costs).all() or asked == source
