"""Speed of the grid kernels against Python-callable peers in the same run.

    python benchmarks/grid_speed.py [--quick] [--json]

Maps: rooms of 6 m with doors at 0.05 m, 1 % boxes, inflated (0.55 m, inscribed 0.22 m, scaling 3.0), corner to corner;
384^2, 1000^2 and 4000^2 cells (``--quick``: the first two). Medians are of 7 pairs. Ours and the peer alternate; a line
shows both medians [ms] and the median of the ratios ours / peer. ``C++`` is what the ratio of that Python peer to a C++
peer, measured on a quiet machine (peers.md, section 4), makes of ours: how many times faster we are than that C++
planner.
A peer that is not installed is skipped with a note. Times are CPU times of the one thread, so that other load on the
machine counts less.
"""

from __future__ import annotations

import argparse
import importlib
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter, sleep, thread_time
from types import ModuleType

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.time.program_end import interruptible
from mbf_costmap_nav.grid.costmap import CellBox
from mbf_costmap_nav.kernels.map.inflation import inflate
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, FOUND, search
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid, pad_cells
from mbf_costmap_nav.kernels.search.search_cells import new_records
from mbf_costmap_nav.kernels.search.theta_star import theta_search
from mbf_costmap_nav.layers.inflation import cost_table
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.planning.search_grid import traversal_table

RESOLUTION = 0.05
REPEATS = 7
"""Pairs a median is taken of."""
NO_CANCEL = np.zeros(1, dtype=np.uint8)
INFLATION_RADIUS = 11  # cells
INFLATION_COSTS = cost_table(INFLATION_RADIUS, RESOLUTION, 0.22, 3.0)  # made once, as the layer does
# C++ peer / Python peer by size, from the table of peers.md section 4 (ms / ms).
SMAC_TO_PYASTAR = {384: 28 / 6.5, 1000: 353 / 61, 4000: 13000 / 1600}
THETA_TO_PYASTAR = {384: 46 / 6.5, 1000: 317 / 61, 4000: 8800 / 1600}
NAVFN_TO_TCOD = {384: 3.9 / 51, 1000: 31.9 / 396, 4000: 658 / 8540}
INFLATION_TO_OPENCV = {384: 1.8 / 1.8, 1000: 8.5 / 12.5, 4000: 332 / 250}


def peer(name: str) -> ModuleType | None:
    """Import a peer, or say that it is skipped."""
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"{name}: not installed, skipped")
        return None


def rooms(size: int, seed: int = 1) -> np.ndarray:
    """Lethal cells of a building of 6 m rooms with two doors each and 1 % boxes."""
    rng = np.random.default_rng(seed)
    cells = np.zeros((size, size), dtype=np.uint8)
    pitch = 120
    for wall in range(0, size, pitch):
        cells[wall : wall + 2] = cells[:, wall : wall + 2] = 254
    for y0 in range(0, size, pitch):
        for x0 in range(0, size, pitch):
            door_x, door_y = rng.integers(10, 70, 2)
            if y0:
                cells[y0 : y0 + 2, x0 + door_x : x0 + door_x + 34] = 0
            if x0:
                cells[y0 + door_y : y0 + door_y + 34, x0 : x0 + 2] = 0
    for y, x in rng.integers(4, size - 10, (size * size // 3600, 2)):
        cells[y : y + 6, x : x + 6] = 254
    cells[:, [0, -1]] = cells[[0, -1]] = 254
    cells[10:40, 10:40] = 0
    return cells


def inflated(cells: np.ndarray) -> np.ndarray:
    """Our inflation of 11 cells."""
    out = cells.copy()
    box = CellBox(0, 0, cells.shape[1], cells.shape[0])
    inflate(out, (cells == 254).astype(np.uint8), box, INFLATION_COSTS, INFLATION_RADIUS, 253)
    return out


def compare(ours: Callable[[], object], theirs: Callable[[], object]) -> tuple[float, float, float]:
    """Median times [ms] and median ratio of alternating calls, after one of each to compile and warm up."""
    times = []
    ours(), theirs()
    for _ in range(REPEATS):
        row = []
        for function in (ours, theirs):
            begin = thread_time()
            function()
            row.append((thread_time() - begin) * 1e3)
        times.append(row)
    table = np.array(times)
    return float(np.median(table[:, 0])), float(np.median(table[:, 1])), float(np.median(table[:, 0] / table[:, 1]))


class Suite:
    """One size of map: all comparisons on it."""

    def __init__(self, size: int, results: dict[str, float]) -> None:
        self.size, self.results = size, results
        self.lethal = rooms(size)
        self.cells = inflated(self.lethal)
        self.table = traversal_table(2.0, 253, False)
        self.stride = size + 2
        self.padded = PaddedGrid(pad_cells(self.cells, 254), self.stride, self.table)
        self.records = new_records(self.padded.cells.size)  # kept from search to search, as planners do
        self.start = (20 + 1) * self.stride + 20 + 1
        field = self.field()[1]
        self.goal = int(np.flatnonzero(np.isfinite(field))[-1])  # the reached cell nearest to the far corner
        self.weights = np.ascontiguousarray(self.table[self.cells])
        self.goal_cell = (self.goal // self.stride - 1, self.goal % self.stride - 1)

    def line(
        self,
        name: str,
        ours: Callable[[], object],
        theirs: Callable[[], object],
        cpp: tuple[str, float] | None = None,
    ) -> None:
        """Measure one pair and print it."""
        mine, other, ratio = compare(ours, theirs)
        self.results[f"{name}_{self.size}"] = ratio
        text = f"{self.size:5d}^2 {name:28s} {mine:9.2f} ms, peer {other:9.2f} ms, ratio {ratio:6.3f}"
        print(text + (f"   = {cpp[1] / ratio:.1f} x {cpp[0]} (C++)" if cpp else ""), flush=True)

    def astar(self) -> tuple[int, np.ndarray, np.ndarray]:
        """Run our A*."""
        return search(self.padded, self.start, self.goal, 1.0, False, False, NO_CANCEL, self.records)

    def field(self) -> tuple[int, np.ndarray, np.ndarray]:
        """Run our full field."""
        return search(self.padded, self.start, -1, 0.0, False, False, NO_CANCEL, self.records)

    def interpolated(self) -> tuple[int, np.ndarray, np.ndarray]:
        """Run navfn's potential up to the goal."""
        return search(self.padded, self.start, self.goal, 0.0, False, True, NO_CANCEL, self.records)

    def theta(self) -> tuple[int, np.ndarray, np.ndarray]:
        """Run our Theta*."""
        return theta_search(self.padded, self.start, self.goal, NO_CANCEL)

    def run(self) -> None:
        """All pairs whose peer is there."""
        cv2, tcod, pyastar, graph = (peer(n) for n in ("cv2", "tcod", "pyastar2d", "skimage.graph"))
        size = self.size
        if cv2:
            free = (self.lethal != 254).astype(np.uint8)
            cv2.setNumThreads(1)
            cpp = ("Nav2 inflation, legacy layer", INFLATION_TO_OPENCV[size])
            self.line(
                "inflation_over_opencv",
                lambda: inflated(self.lethal),
                lambda: cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE),
                cpp,
            )
        if pyastar:
            cpp = ("Smac 2D", SMAC_TO_PYASTAR[size])
            theirs = lambda: pyastar.astar_path(self.weights, (20, 20), self.goal_cell, allow_diagonal=True)  # noqa: E731
            self.line("astar_over_pyastar2d", self.astar, theirs, cpp)
            self.line("theta_over_pyastar2d", self.theta, theirs, ("Nav2 Theta*", THETA_TO_PYASTAR[size]))
        self.line("theta_over_our_astar", self.theta, self.astar)
        self.answers()
        integer = np.where(np.isfinite(self.weights), self.weights * 10.0, 0.0).astype(np.int32)
        if tcod:
            cpp = ("NavFn", NAVFN_TO_TCOD[size])
            self.line("field_over_tcod", self.field, lambda: tcod_field(tcod, integer), cpp)
            theirs = lambda: tcod.path.AStar(integer, 1.41).get_path(20, 20, *self.goal_cell)  # noqa: E731
            self.line("astar_over_tcod", self.astar, theirs)
        if graph:
            costs = np.where(np.isfinite(self.weights), self.weights, -1.0)
            theirs = lambda: graph.MCP_Geometric(costs).find_costs([(20, 20)])  # noqa: E731
            self.line("field_over_skimage", self.field, theirs)

    def answers(self) -> None:
        """Which planners find the way (on 4000^2 NavFn's A* does not), and how long a cancel takes."""
        found = {
            "A*": self.astar()[0],
            "navfn's potential": self.interpolated()[0],
            "Theta*": self.theta()[0],
        }
        delay = max(cancel_delay(self, after) for after in (0.002, 0.01, 0.03, 0.1, 0.2))
        self.results[f"ways_found_{self.size}"] = sum(status == FOUND for status in found.values())
        self.results[f"cancel_ms_{self.size}"] = delay
        names = ", ".join(name for name, status in found.items() if status == FOUND)
        print(f"{self.size:5d}^2 a way is found by {names}; a cancelled search ends within {delay:.1f} ms", flush=True)


def rolling_local_map(repeats: int) -> float:
    """Median time [ms] of a full update of a rolling 10 m x 10 m map at 0.05 m: 720 beams, inflation."""
    parameters = CostmapParameters(
        rolling_window=True,
        resolution=RESOLUTION,
        robot_radius=0.22,
        layers=({"name": "obstacles", "type": "obstacle"}, {"name": "inflation", "type": "inflation"}),
    )
    source = {"obstacle_max_range": 7.0, "raytrace_max_range": 7.0}
    inflation = {"inflation_radius": 0.55, "cost_scaling_factor": 3.0}
    blocks = {"obstacles": {"sources": {"scan": source}}, "inflation": inflation}
    costmap = build_layered_costmap(parameters, blocks)
    angles = np.arange(720) * (2.0 * np.pi / 720)
    ranges = 3.5 + 1.5 * np.sin(5.0 * angles)  # a room with five niches
    times = []
    for step in range(repeats + 2):
        x = 0.5 * step  # the window moves by ten cells
        ends = np.column_stack([x + ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(720)])
        begin = thread_time()
        costmap.insert_points("scan", ends, (x, 0.0, 0.0), 0.1 * step)
        box = costmap.update(Pose.planar(x, 0.0), 0.1 * step)
        times.append((thread_time() - begin) * 1e3)
        assert box == costmap.geometry.box, "the window moves, so all of it must be made anew"
    return float(np.median(times[2:]))  # the first ones compile


def cancel_delay(suite: Suite, after: float) -> float:
    """Wall-clock time [ms] from a cancel, ``after`` seconds into preparing and searching a full field, to its end.

    0 if it was done before.
    """
    flag = np.zeros(1, dtype=np.uint8)

    def field() -> int:
        padded = pad_cells(suite.cells, 254, flag)
        return search(PaddedGrid(padded, suite.stride, suite.table), suite.start, -1, 0.0, False, False, flag)[0]

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(field)
        sleep(after)
        begin = perf_counter()
        flag[0] = 1
        return (perf_counter() - begin) * 1e3 if running.result() == CANCELED else 0.0


def tcod_field(tcod: ModuleType, costs: np.ndarray) -> np.ndarray:
    """Integer Dijkstra field of tcod with the octile weights 10 and 14."""
    distance = np.full(costs.shape, np.iinfo(np.int32).max, dtype=np.int32)
    distance[20, 20] = 0
    return tcod.path.dijkstra2d(distance, costs, 10, 14, out=distance)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two sizes")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    arguments = parser.parse_args()
    results: dict[str, float] = {}
    results["rolling_local_map_ms"] = rolling_local_map(15 if arguments.quick else 101)
    print(f"rolling local map, 200^2 cells, 720 beams: {results['rolling_local_map_ms']:.3f} ms a full update")
    for size in (384, 1000) if arguments.quick else (384, 1000, 4000):
        Suite(size, results).run()
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    with interruptible():
        main()
