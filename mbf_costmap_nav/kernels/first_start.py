"""The kernels that a first start on a costmap needs, so that a second process can compile them ahead.

Each with an example of its arguments: numba compiles for their types, and what they hold is of no matter. Costs that
are asked for are read-only, those of a layer are not. A test compares the types with those of a real start.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mbf_costmap_nav.kernels.map.footprint_cost import first_collision, first_lethal
from mbf_costmap_nav.kernels.map.inflation import _column_distances, _spread_rows
from mbf_costmap_nav.kernels.map.outline_along import fits_along
from mbf_costmap_nav.kernels.map.path_poses import first_off_grid, level_path
from mbf_costmap_nav.kernels.map.rasterisation import fill_polygon
from mbf_costmap_nav.kernels.map.raytrace import clear_rays, mark_points
from mbf_costmap_nav.kernels.search.exact_ends import cell_centres, with_exact_ends
from mbf_costmap_nav.kernels.search.grid_search import _search_and_trace
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid
from mbf_costmap_nav.kernels.search.search_cells import new_records


def kernels() -> list[tuple[Any, tuple[Any, ...]]]:
    """Return each kernel with an example of its arguments, in the order in which a start needs them."""
    cells, row, cost = _example(np.uint8, 2), _example(np.uint8), np.uint8(0)
    reals, points, hits, box = _example(float), _example(float, 2), _example(np.bool_), _example(np.int64)
    grid, records, buckets = PaddedGrid(row, 0, _example(np.float32)), new_records(2), _example(np.int32, 2)
    costs = cells.copy()
    costs.flags.writeable = False  # a type of its own for numba
    path = points.copy()
    path.flags.writeable = False
    return [
        (_column_distances, (cells, 0, 0, cells, cost)),
        (_spread_rows, (cells, (0, 0, 0, 0), cells, 0, 0, 0, row, cost)),
        (first_lethal, (costs, 0.0, 0.0, 0.0, points, 0.0, 0.0, 0.0, 0.0)),
        (
            _search_and_trace,
            (grid, cells, _example(np.uint64, 2), records, records["g"], 0, 0, 0.0, True, True, row, buckets, box),
        ),
        (cell_centres, (_example(np.int32), 0, reals)),
        (with_exact_ends, (costs, 0, 0, reals, points, 0.0, 0.0, 0.0, 0.0, 0.0)),
        (fits_along, (costs, 0.0, 0.0, 0.0, points, points, 0.0, 0.0, 0.0, 0.0)),
        (level_path, (points, 0.0, 0.0)),
        (first_off_grid, (path, 0, 0, 0.0, 0.0, 0.0)),
        (first_collision, (costs, 0.0, 0.0, 0.0, points, points)),
        (fill_polygon, (cells, points, 0)),
        (clear_rays, (cells, reals, 0.0, reals, points, 0.0, 0.0, 0, box)),
        (mark_points, (cells, reals, 0.0, reals, points, hits, 0.0, 0.0, 0, box)),
    ]


def _example(kind: DTypeLike, dimensions: int = 1) -> NDArray[Any]:
    return np.zeros((1,) * dimensions, dtype=kind)
