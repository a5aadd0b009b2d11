"""A map larger than memory: building it tile by tile, and plans between random far points of it.

    python benchmarks/tiles.py [--quick] [--json] [--side 8001] [--workers 2] [--pairs 20] [--folder DIR]

Heights are a sum of waves 4 to 900 m long on a grid of 0.5 m, with rocks that are holes and lakes below a water line.
The build is killed twice (SIGKILL) and started again. Plans run in a process of their own; its peak memory is
reported. Times are those of the second plan of a pair (warm: its tiles are loaded) and of the first (cold: read from
disk). On the subset, a map of ``--subset`` samples a side in tiles of 64 m of which the memory holds a quarter, the
cost is divided by that of the exact plan on the whole mesh.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.search.leg_search import LegQuery, propagate_from, vertex_path_leg
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource, open_heights
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings
from mbf_mesh_nav.tiles.planning import plan_on_tiles
from mbf_mesh_nav.tiles.pool import TilePool
from mbf_mesh_nav.tiles.tiled_map import KEPT_TILES, TiledMap

SPACING, SEED = 0.5, 11
LAYERS = (
    ("border", "border", ()),
    ("steepness", "steepness", ()),
    ("height_diff", "height_diff", ()),
    ("lethal", "max_combination", ("border", "steepness", "height_diff")),
    ("inflation", "inflation", ("lethal",)),
    ("roughness", "roughness", ()),
    ("effort", "weighted_sum", ("steepness", "roughness", "height_diff")),
    ("safe", "max_combination", ("inflation", "effort")),
)
PARAMETERS = MeshMapParameters(
    layers=tuple(MeshLayerEntry(name=name, type=kind, inputs=inputs) for name, kind, inputs in LAYERS),
    edge_cost_factor=1.5,
    inscribed_radius=0.3,
)
BLOCKS = {
    "steepness": {"threshold": 0.7, "combination_weight": 0.6},
    "height_diff": {"threshold": 0.8, "height_limit": 1.0, "radius": 0.8, "combination_weight": 0.25},
    "roughness": {"threshold": 3.0, "radius": 0.8, "combination_weight": 0.4},
    "inflation": {"inscribed_radius": 0.3, "inflation_radius": 1.5, "lethal_value": float("inf")},
}
SETTINGS = TileSettings(mesh_map=PARAMETERS, layer_blocks=BLOCKS)
SUBSET_SETTINGS = TileSettings(mesh_map=PARAMETERS, layer_blocks=BLOCKS, tile_size=64.0)
SUBSET_SHARE = 0.25
"""Share of the tiles that the memory holds: as on the large map, costs cannot be proven then."""


def write_heights(path: Path, side: int) -> None:
    """Heights (side, side) float32, written row by row."""
    rng = np.random.default_rng(SEED)
    lengths = np.geomspace(4.0, 900.0, 28)
    angles, phases = rng.uniform(0.0, 2.0 * np.pi, (2, len(lengths)))
    x = SPACING * np.arange(side)
    rocks = rng.uniform(0.0, SPACING * side, (side * side // 8000, 2))
    radii = rng.uniform(0.5, 4.0, len(rocks))
    heights = np.lib.format.open_memmap(path, mode="w+", dtype=np.float32, shape=(side, side))
    by_row = np.argsort(rocks[:, 1])
    rocks, radii = rocks[by_row], radii[by_row]
    for row in range(side):
        y = SPACING * row
        line = np.zeros(side)
        for length, angle, phase in zip(lengths, angles, phases, strict=True):
            turn = 2.0 * np.pi / length
            line += 0.018 * length * np.sin(turn * (np.cos(angle) * x + np.sin(angle) * y) + phase)
        first, last = np.searchsorted(rocks[:, 1], (y - 4.0, y + 4.0))
        for (middle, along), radius in zip(rocks[first:last], radii[first:last], strict=True):
            half = radius * radius - (y - along) ** 2
            if half > 0.0:
                line[np.abs(x - middle) < np.sqrt(half)] = np.nan
        line[line < -22.0] = np.nan
        heights[row] = line
    heights.flush()


def build(arguments: argparse.Namespace, heights: Path, folder: Path) -> dict[str, Any]:
    """Build in processes that are killed twice; wall and CPU time of all of them together, peak memory of the last."""
    wall, figures = time.perf_counter(), {}
    command = [sys.executable, __file__, "--part", "build", "--folder", str(folder), "--heights", str(heights)]
    command += ["--workers", str(arguments.workers)]
    for kill_after in (*arguments.kills, 0):
        done = subprocess.run([*command, "--kill-after", str(kill_after)], capture_output=True, text=True, check=False)
        assert done.returncode == (-signal.SIGKILL if kill_after else 0), done.stderr
        if not kill_after:
            figures = json.loads(done.stdout.splitlines()[-1])
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = time.perf_counter() - wall
    size = sum(file.stat().st_size for file in folder.iterdir())
    return {**figures, "wall_s": wall, "cpu_s": usage.ru_utime + usage.ru_stime, "gigabytes": size / 1e9}


def build_here(arguments: argparse.Namespace) -> dict[str, Any]:
    """Build what is missing in this process, which kills itself after some tiles if it is asked to."""
    before = len(list(arguments.folder.glob("tile_*.npz"))) if arguments.folder.exists() else 0

    def report(done: int, total: int) -> None:
        print(f"{done} of {total} tiles", file=sys.stderr, flush=True)
        if arguments.kill_after and done - before >= arguments.kill_after:
            os.kill(os.getpid(), signal.SIGKILL)

    source = HeightSource(open_heights(arguments.heights, 10**9), SPACING, SPACING)
    index = build_tiles(source, arguments.folder, SETTINGS, workers=arguments.workers, on_tile=report)
    vertices = sum(entry.core_vertices for entry in index.tiles)
    return {"tiles": len(index.tiles), "core_vertices": vertices, "build_peak_mb": _peak_megabytes()}


def _peak_megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def random_pairs(heights: np.ndarray[Any, Any], count: int, seed: int) -> list[tuple[list[float], list[float]]]:
    """Places on the ground at least half a side apart."""
    rng, side = np.random.default_rng(seed), heights.shape[0]
    pairs: list[tuple[list[float], list[float]]] = []
    while len(pairs) < count:
        (a, b), (c, d) = rng.integers(8, side - 8, (2, 2)).tolist()
        if np.hypot(a - c, b - d) < 0.5 * side or np.isnan(heights[[b, d], [a, c]]).any():
            continue
        ends = [[SPACING * column, SPACING * row, float(heights[row, column])] for column, row in ((a, b), (c, d))]
        pairs.append((ends[0], ends[1]))
    return pairs


def plan_here(arguments: argparse.Namespace) -> dict[str, Any]:
    """Plan between random far points in this process, each pair twice."""
    began = time.perf_counter()
    tiled = TiledMap(arguments.folder, memory=arguments.memory)
    opened = time.perf_counter() - began
    heights = open_heights(arguments.heights, 10**9)
    pairs = random_pairs(heights, arguments.pairs + 1, 3)
    plan_on_tiles(tiled, *pairs.pop())  # the kernels are compiled
    rows = []
    for start, goal in pairs:
        times = []
        for _ in range(2):
            cpu, wall = time.process_time(), time.perf_counter()
            plan = plan_on_tiles(tiled, start, goal)
            times += [time.perf_counter() - wall, time.process_time() - cpu]
        row: dict[str, Any] = {
            "outcome": plan.outcome.name,
            "message": plan.message,
            "cost": plan.cost,
            "gap": plan.gap,
        }
        row["tiles"] = len(plan.tiles)
        rows.append(row | dict(zip(("cold_wall", "cold_cpu", "warm_wall", "warm_cpu"), times, strict=True)))
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    found = [row for row in rows if row["outcome"] == "SUCCESS"]
    figures: dict[str, Any] = {
        "open_s": opened,
        "slots": tiled.pool.slots,
        "plans": len(found),
        "blocked": len(rows) - len(found),
    }
    for name in ("cold_wall", "cold_cpu", "warm_wall", "warm_cpu", "gap", "tiles", "cost"):
        values = [row[name] for row in found]
        figures[name] = {"median": float(np.median(values)), "worst": max(values)}
    return figures | {"plan_peak_mb": _peak_megabytes()}


def ratios(side: int, count: int, folder: Path) -> dict[str, Any]:
    """Cost on tiles divided by that of the exact plan on the whole mesh, on a map of ``side`` samples a side."""
    file = folder / "subset.npy"
    write_heights(file, side)
    heights = np.load(file)
    index = build_tiles(HeightSource(heights, SPACING, SPACING), folder / "subset", SUBSET_SETTINGS, workers=2)
    slot, tables = TilePool(index.tiles, 0.0).slot_bytes, TiledMap(folder / "subset").table_bytes
    tiled = TiledMap(folder / "subset", memory=tables + slot * (KEPT_TILES + SUBSET_SHARE * len(index.tiles) + 0.5))
    vertices, faces = heightfield_mesh(heights, SPACING, SPACING, keep_grid=True)
    whole = build_mesh_map(PARAMETERS, BLOCKS, vertices=vertices, faces=faces)
    snapshot = whole.snapshot()
    blocked = snapshot.blocked(1.0)
    found, gaps, differing = [], [], 0
    for start, goal in random_pairs(heights, count, 5):
        plan = plan_on_tiles(tiled, start, goal)
        ends = [on_surface(whole.topology, whole.locator, np.array(end), 0.4) for end in (start, goal)]
        if plan.outcome.name not in ("SUCCESS", "NO_PATH_FOUND") or ends[0] is None or ends[1] is None:
            continue
        query = LegQuery(ends[0], ends[1], snapshot, blocked, np.zeros(1, dtype=np.uint8))
        distances, before, _ = propagate_from(whole, snapshot, blocked, ends[0], query.cancel_flag, ends[1])
        leg = vertex_path_leg(whole, query, distances, before)
        differing += (leg is None) != (plan.outcome.name == "NO_PATH_FOUND")
        if leg is not None and np.isfinite(plan.cost):
            found.append(plan.cost / leg.cost)
            gaps.append(plan.gap)
    return {
        "vertices": len(whole.vertices),
        "plans": len(found),
        "other_outcome": differing,
        "ratio": {"least": min(found), "median": float(np.median(found)), "worst": max(found)},
        "gap": {"median": float(np.median(gaps)), "worst": max(gaps)},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a map of 1001 and a subset of 501 samples a side")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    parser.add_argument("--side", type=int, default=8001, help="samples a side")
    parser.add_argument("--subset", type=int, default=1201, help="samples a side of the map that is planned exactly")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--memory", type=float, default=1.5e9, help="bytes for loaded tiles")
    parser.add_argument("--folder", type=Path, help="where heights and tiles are put and kept; else they are removed")
    parser.add_argument("--heights", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--part", choices=("build", "plan"), help=argparse.SUPPRESS)
    parser.add_argument("--kill-after", type=int, default=0, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.part:
        print(json.dumps(build_here(arguments) if arguments.part == "build" else plan_here(arguments)))
        return
    side, subset = (1001, 501) if arguments.quick else (arguments.side, arguments.subset)
    kept = arguments.folder
    place = kept or Path(tempfile.mkdtemp(prefix="tiles_"))
    arguments.kills = (1, 1) if arguments.quick else (20, 20)
    if (place / "map" / "index.json").exists():
        arguments.kills = ()  # built before
    try:
        place.mkdir(parents=True, exist_ok=True)
        heights = place / "heights.npy"
        if not heights.exists():
            write_heights(heights, side)
        figures: dict[str, Any] = {"samples": side * side, "build": build(arguments, heights, place / "map")}
        print(figures, flush=True)
        command = [
            sys.executable,
            __file__,
            "--part",
            "plan",
            "--folder",
            str(place / "map"),
            "--heights",
            str(heights),
        ]
        command += ["--pairs", str(arguments.pairs), "--memory", str(arguments.memory)]
        answer = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
        figures["plan"] = json.loads(answer.splitlines()[-1])
        print(figures["plan"], flush=True)
        figures["subset"] = ratios(subset, arguments.pairs, place)
    finally:
        if kept is None:
            shutil.rmtree(place)
    print(figures["subset"])
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    with interruptible():
        main()
