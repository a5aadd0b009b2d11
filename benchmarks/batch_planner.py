"""Many plans on all processors: throughput of ``BatchPlanner``, as a ratio to one worker in the same run.

    python benchmarks/batch_planner.py [--quick] [--json] [--pairs 60] [--workers N] [--rounds 3] [--ceiling] [--first]

Mesh: the fractal terrain of ``mesh_speed.py`` (277,000 vertices; ``--quick``: 90,000) with the layers of a bare mesh.
Grid: 1000 x 1000 cells (``--quick``: 400 x 400) with round obstacles, inflated. Each round plans all pairs with one
worker and with all of them, one after the other; the figure is the median ratio of the wall-clock times, so nothing
else may run meanwhile. The bar is 1.8 on two processors.

``--ceiling`` says beside it what the machine has to give: two processes without threads, one on each of the first two
processors, plan halves of the pairs that take equally long, at the same time. ``--first`` (Linux, as root) measures
before all that else is at work, for a second or two at a time.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from terrain_meshes import fractal_terrain

from mbf_abstract.geometry import Pose
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.batch_planner import BatchPlanner
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.server.standing_server import read_config_or_map, standing_server
from mbf_abstract.time.program_end import interruptible

Ends = tuple[list[Pose], list[Pose]]
BAR_ON_TWO = 1.8
MOST_DRAWS = 10
PLANNERS = {
    "mesh": ("astar", "dijkstra", "cvp", "any_angle", "heading_astar"),
    "costmap": ("astar", "theta_star", "hybrid_astar"),
}
MAP_YAML = """
image: discs.png
resolution: 0.05
origin: [0, 0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


def hills(folder: Path, side: int) -> Path:
    """A bare mesh of the fractal terrain with ``side`` vertices along an edge."""
    terrain = fractal_terrain(side)
    file = folder / "hills.ply"
    trimesh.Trimesh(terrain.vertices, terrain.faces, process=False).export(file)
    return file


def discs(folder: Path, side: int) -> Path:
    """A bare map of ``side`` x ``side`` cells of 5 cm with one round obstacle for each 2,500 cells."""
    rng = np.random.default_rng(7)
    image = np.full((side, side), 254, dtype=np.uint8)
    y, x = np.mgrid[0:side, 0:side]
    for centre_x, centre_y, radius in rng.uniform((0, 0, 2), (side, side, 9), (side * side // 2500, 3)):
        image[(x - centre_x) ** 2 + (y - centre_y) ** 2 < radius**2] = 0
    Image.fromarray(image).save(folder / "discs.png")
    file = folder / "discs.yaml"
    file.write_text(MAP_YAML)
    return file


def reachable_pairs(server: AbstractNavigationServer, size: float, count: int) -> tuple[list[Pose], list[Pose]]:
    """Random pairs of poses on the ground that the first planner finds a path between."""
    batch = BatchPlanner(server)
    rng, starts, goals = np.random.default_rng(11), [], []
    for _ in range(MOST_DRAWS):
        drawn = rng.uniform(0.05 * size, 0.95 * size, (2 * count, 2, 2))
        ends = [[server.ground_pose(*place) for place in drawn[:, side]] for side in (0, 1)]
        for start, goal, result in zip(*ends, batch.plan_many(*ends), strict=True):
            if result.success:
                starts.append(start)
                goals.append(goal)
        if len(starts) >= count:
            return starts[:count], goals[:count]
    raise SystemExit(f"only {len(starts)} of {2 * count * MOST_DRAWS} random pairs have a path, {count} are needed")


def seconds(batch: BatchPlanner, ends: Ends) -> float:
    """Wall-clock time [s] of all pairs."""
    begin = time.perf_counter()
    batch.plan_many(*ends)
    return time.perf_counter() - begin


def halves(batch: BatchPlanner, ends: Ends) -> tuple[Ends, Ends]:
    """Two parts of the pairs that take about as long as each other: the longest first, to whoever has less."""
    took = [min(seconds(batch, ([start], [goal])) for _ in range(3)) for start, goal in zip(*ends, strict=True)]
    parts: tuple[Ends, Ends] = (([], []), ([], []))
    sums = [0.0, 0.0]
    for index in np.argsort(took)[::-1].tolist():
        which = int(sums[1] < sums[0])
        sums[which] += took[index]
        for chosen, poses in zip(parts[which], ends, strict=True):
            chosen.append(poses[index])
    return parts


def in_processes(batch: BatchPlanner, parts: tuple[Ends, Ends]) -> float:
    """Wall-clock time [s] of two processes that plan a part of the pairs each, on a processor of its own."""
    fork = multiprocessing.get_context("fork")  # they share the map's memory, as threads do
    both, times = fork.Barrier(2), fork.SimpleQueue()

    def work(processor: int) -> None:
        os.sched_setaffinity(0, {processor})
        seconds(batch, parts[processor])
        both.wait()
        times.put(seconds(batch, parts[processor]))

    processes = [fork.Process(target=work, args=(processor,)) for processor in (0, 1)]
    for process in processes:
        process.start()
    slower = max(times.get() for _ in processes)
    for process in processes:
        process.join()
    return float(slower)


@contextmanager
def first(wanted: bool) -> Iterator[None]:
    """Run this thread, and those that it starts, before all other processes."""
    if wanted:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    yield
    if wanted:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def measure(backend: str, file: Path, size: float, options: argparse.Namespace) -> Iterator[dict[str, float | str]]:
    """Yield a row for each planner of a backend."""
    cls, config, _ = read_config_or_map(file)
    with standing_server(cls, config) as server:
        for name in PLANNERS[backend]:
            server.load_plugin_type(PluginKind.PLANNER, f"bench_{name}", name)
        ends = reachable_pairs(server, size, options.pairs)
        for name in PLANNERS[backend]:
            alone, together = (BatchPlanner(server, f"bench_{name}", workers) for workers in (1, options.workers))
            one = seconds(alone, ends) + seconds(together, ends)  # this round compiles
            parts = halves(alone, ends) if options.ceiling else None
            ratios, ceilings = [], []
            with first(options.first):
                for _ in range(options.rounds):
                    one = seconds(alone, ends)
                    ratios.append(one / seconds(together, ends))
                    if parts is not None:
                        ceilings.append(one / in_processes(alone, parts))
            yield {
                "planner": f"{backend}.{name}",
                "one_ms": 1e3 * one / options.pairs,
                "ratio": float(np.median(ratios)),
            } | ({"ceiling": float(np.median(ceilings))} if options.ceiling else {})


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="smaller maps")
    arguments.add_argument("--json", action="store_true", help="print the figures as one JSON line at the end")
    arguments.add_argument("--pairs", type=int, default=60)
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--workers", type=int, default=os.cpu_count())
    arguments.add_argument("--ceiling", action="store_true", help="two processes beside it")
    arguments.add_argument("--first", action="store_true", help="before all other processes, as root")
    options = arguments.parse_args()
    side, cells = (300, 400) if options.quick else (526, 1000)
    rows = []
    with tempfile.TemporaryDirectory(prefix="mbf_plan_many_") as folder:
        spacing = fractal_terrain(2).vertices[:, 0].max()
        worlds = (
            ("mesh", hills(Path(folder), side), spacing * (side - 1)),
            ("costmap", discs(Path(folder), cells), 0.05 * cells),
        )
        print(f"{'planner':22}{'one worker':>12} a plan, {options.workers} workers are as fast as")
        for backend, file, size in worlds:
            for row in measure(backend, file, size, options):
                rows.append(row)
                verdict = "" if options.workers != 2 else "ok" if row["ratio"] >= BAR_ON_TWO else "MISSED"
                factor = f"{row['ratio']:9.2f} of {row['ceiling']:.2f}" if options.ceiling else f"{row['ratio']:9.2f}"
                print(f"{row['planner']:22}{row['one_ms']:9.2f} ms {factor} {verdict}", flush=True)
    if options.json:
        print(json.dumps(rows))


if __name__ == "__main__":
    with interruptible():
        main()
