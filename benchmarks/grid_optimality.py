"""Optimality of the grid planners against published lengths.

    python benchmarks/grid_optimality.py [--quick] [--json] [--maps 'rooms/*'] [--data ../shared/data]

1. Every query of every MovingAI scenario under ``movingai/`` by our 8-connected A* (no corner cutting). Files with
   eight decimals are compared with 1e-6 relative. Older files print six significant digits and drop trailing zeros, so
   they are compared with half a unit of the sixth one. Their generator used the single-precision root of two, which
   moves 14 lengths of 8room_000 across a rounding border (159 straight and 96 diagonal steps are 294.764502 but were
   printed as 294.764), so that root is used for them. ``--quick`` takes every 60th query.
2. Theta* on the any-angle sets of ``movingai/anyangle/ohohcakester``, whose points are cell corners: each cell is cut
   into 16 x 16, a corner becomes the free small cell that touches it, and the way to its centre is added.
   Our path must keep half a small cell from obstacles, so a ratio slightly above 1 remains by construction.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np

from mbf_abstract.time.program_end import interruptible
from mbf_costmap_nav.kernels.search.grid_line import line_cost, pull_string
from mbf_costmap_nav.kernels.search.grid_search import FOUND, search
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid, pad_cells
from mbf_costmap_nav.kernels.search.short_lines import trace_lines
from mbf_costmap_nav.kernels.search.theta_star import theta_search
from mbf_costmap_nav.planning.search_grid import traversal_table

FINE = 16
"""Small cells along a cell of the any-angle maps."""
SINGLE_SQRT2 = float(np.float32(math.sqrt(2.0)))
"""Length [cells] of a diagonal step in scenario files of six significant digits."""
TABLE = traversal_table(0.0, 253, False)
NO_CANCEL = np.zeros(1, dtype=np.uint8)


def read_map(path: FilePath) -> np.ndarray:
    """MovingAI map as uint8 cells, row 0 = the file's first row."""
    rows = path.read_text().split("map\n", 1)[1].splitlines()
    return np.array([[0 if c in ".G" else 254 for c in row] for row in rows if row], dtype=np.uint8)


def octile_steps(grid: PaddedGrid, start: int, goal: int) -> tuple[float, int]:
    """Straight and diagonal steps of our A* path; inf straight ones without a path."""
    stride = grid.stride
    status, _, path = search(grid, start, goal, 1.0, False, False, NO_CANCEL)
    if status != FOUND:
        return math.inf, 0
    diagonal = int(np.count_nonzero(np.diff(path // stride) * np.diff(path % stride)))
    return len(path) - 1 - diagonal, diagonal


def agrees(straight: float, diagonal: int, printed: str) -> bool:
    """Whether a path of so many steps has the printed length."""
    value = float(printed)
    if len(printed.partition(".")[2]) >= 8:
        return abs(straight + diagonal * math.sqrt(2.0) - value) <= 1e-6 * value
    half_unit = 0.5 * 10.0 ** (math.floor(math.log10(value)) - 5) if value > 0.0 else 0.0
    return abs(straight + diagonal * SINGLE_SQRT2 - value) <= half_unit


def scenario_results(data: FilePath, every: int, pattern: str) -> tuple[int, int, list[str]]:
    """Queries, optimal ones, and a line of text for each map."""
    total, optimal, lines = 0, 0, []
    for scenario in sorted(data.glob(f"movingai/{pattern}.scen")):
        cells = read_map(scenario.with_name(scenario.name.removesuffix(".scen")))
        stride = cells.shape[1] + 2
        grid = PaddedGrid(pad_cells(cells, 254), stride, TABLE)
        queries = [line.split() for line in scenario.read_text().splitlines()[1:] if line.strip()][::every]
        good = 0
        for query in queries:
            sx, sy, gx, gy = (int(value) + 1 for value in query[4:8])
            straight, diagonal = octile_steps(grid, sy * stride + sx, gy * stride + gx)
            good += agrees(straight, diagonal, query[8])
        share = good / max(len(queries), 1)
        lines.append(f"  {scenario.name:28s} {good} of {len(queries)} optimal, share {share:.6f}")
        total, optimal = total + len(queries), optimal + good
    return total, optimal, lines


def fine_corner(cells: np.ndarray, x: int, y: int) -> int:
    """Flat padded index of a free small cell that touches the corner (x, y) of the coarse grid."""
    for dy in (-1, 0):
        for dx in (-1, 0):
            u, v = x * FINE + dx, y * FINE + dy
            if 0 <= u < cells.shape[1] and 0 <= v < cells.shape[0] and cells[v, u] == 0:
                return (v + 1) * (cells.shape[1] + 2) + u + 1
    raise ValueError(f"corner ({x}, {y}) touches no free cell")


def theta_length(grid: PaddedGrid, start: int, goal: int) -> float:
    """Length [small cells] of the any-angle path between two small cells."""
    stride = grid.stride
    _, _, origin = theta_search(grid, start, goal, NO_CANCEL)
    corners = pull_string(grid, trace_lines(origin, stride, start, goal))
    return sum(float(line_cost(grid, int(a), int(b))) for a, b in pairwise(corners))


def any_angle_results(data: FilePath, every: int) -> tuple[np.ndarray, int]:
    """Ratios of Theta* to the exact length, and the number of paths longer than the octile one."""
    ratios, longer = [], 0
    for folder in sorted(p.parent for p in data.glob("movingai/anyangle/ohohcakester/*/maze.txt")):
        numbers = np.array((folder / "maze.txt").read_text().split(), dtype=int)
        coarse = numbers[2:].reshape(numbers[1], numbers[0]).astype(np.uint8) * np.uint8(254)
        cells = np.repeat(np.repeat(coarse, FINE, axis=0), FINE, axis=1)
        grid = PaddedGrid(pad_cells(cells, 254), cells.shape[1] + 2, TABLE)
        for row in list(csv.reader((folder / "problems.csv").open()))[1::every]:
            start, goal = fine_corner(cells, int(row[0]), int(row[1])), fine_corner(cells, int(row[2]), int(row[3]))
            theta = theta_length(grid, start, goal)
            straight, diagonal = octile_steps(grid, start, goal)
            longer += int(theta > (straight + diagonal * math.sqrt(2.0)) * (1.0 + 1e-6))
            ratios.append((theta + math.sqrt(2.0)) / FINE / float(row[4]))
    return np.array(ratios), longer


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a part of the queries")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    parser.add_argument("--maps", default="*/*", help="folder/name of the scenario files, with wildcards")
    parser.add_argument("--data", type=FilePath, default=FilePath(__file__).parents[2] / "shared" / "data")
    arguments = parser.parse_args()
    total, optimal, lines = scenario_results(arguments.data, 60 if arguments.quick else 1, arguments.maps)
    print(f"8-connected A* on MovingAI: {optimal} of {total} queries optimal", *lines, sep="\n")
    ratios, longer = any_angle_results(arguments.data, 10 if arguments.quick else 1)
    print(
        f"Theta* over the exact any-angle length, {len(ratios)} queries: mean {ratios.mean():.4f}, "
        f"largest {ratios.max():.4f}; longer than the octile path: {longer}"
    )
    if arguments.json:
        result = {
            "queries": total,
            "optimal_share": optimal / max(total, 1),
            "theta_queries": len(ratios),
            "theta_ratio_mean": float(ratios.mean()),
            "theta_ratio_max": float(ratios.max()),
            "theta_longer_than_octile": int(longer),
        }
        print(json.dumps(result))


if __name__ == "__main__":
    with interruptible():
        main()
