"""Sensed obstacles on a map of tiles: from a scan to costs and to a plan, another window, and memory.

    python benchmarks/tiles_sensing.py [--sides 1001,2001] [--metres 60] [--json]

A robot drives ``--metres`` over the terrain of ``benchmarks/tiles.py``, tiles of 256 m, a scan of 2000 points with
boxes around it every metre, and a plan of 200 m every 5 m, searched and, to a goal that stays, by repair where that is
as good. Times are of the CPU, medians with the worst in brackets.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tiles import SETTINGS, SPACING, write_heights

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource, open_heights
from mbf_mesh_nav.tiles.planning import plan_between, plan_on_tiles
from mbf_mesh_nav.tiles.portals import NOT_CANCELLED
from mbf_mesh_nav.tiles.serving.corridor_field import CorridorField
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.windows.window_settings import window_settings
from mbf_mesh_nav.tiles.tiled_map import TiledMap

WINDOW, POINTS = 40.0, 2000
PLAN_EVERY, PLAN_LENGTH = 5, 200.0
LAYERS = (
    MeshLayerEntry(name="seen", type="obstacle"),
    MeshLayerEntry(name="around", type="inflation", inputs=("seen",)),
)
BLOCKS = {
    "seen": {"sources": ("lidar",), "obstacle_max_range": 10.0},
    "around": {"inscribed_radius": 0.3, "inflation_radius": 1.0, "lethal_value": float("inf")},
}


def megabytes() -> float:
    """Memory of this process now."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def timed(call: Callable[[], object]) -> float:
    """CPU time of a call [ms]."""
    begun = time.process_time()
    call()
    return 1e3 * (time.process_time() - begun)


def turn(navigation_map: TiledNavigationMap) -> None:
    """Lay what was sensed over the tiles, as every search begins."""
    with navigation_map.turn_to_search():
        pass


def drive(folder: Path, metres: int) -> dict[str, Any]:
    """Figures of one drive through the middle of the map along x."""
    tiled = TiledMap(folder)
    navigation_map = TiledNavigationMap(tiled, window=window_settings(tiled, WINDOW, LAYERS, BLOCKS))
    left, bottom, _, right, top, _ = tiled.index.box
    rng, before = np.random.default_rng(3), megabytes()
    names = ("scan_to_cost", "new_window", "overlay", "plan", "again", "repaired", "not_repaired")
    times: dict[str, list[float]] = {name: [] for name in names}
    vertices, sensed, above = [], [], [0.0]
    kept, goal = CorridorField(tiled), None
    for step in range(metres):
        x, y, now = 0.5 * (left + right) - 0.5 * metres + step, 0.5 * (bottom + top), float(step)
        ground = navigation_map.ground_heights(x, y) or (0.0,)
        robot = Pose.planar(x, y, 0.0, ground[0])
        old = navigation_map.window_map
        moved = timed(lambda robot=robot, now=now: navigation_map.update(robot, now))  # type: ignore[misc]
        if navigation_map.window_map is not old:
            times["new_window"].append(moved)
        middles = rng.uniform(-9.0, 9.0, (8, 2))
        places = (middles[:, None] + rng.uniform(-0.4, 0.4, (8, POINTS // 8, 2))).reshape(-1, 2)
        places += np.array((x, y))
        on = navigation_map.window_map.locate(np.column_stack([places, np.full(len(places), ground[0])]), 9.0).points
        seen = RangeScan.of_points("lidar", on[np.isfinite(on).all(axis=1)] + (0, 0, 0.5), (x, y, ground[0]), now)

        def take(seen: RangeScan = seen, robot: Pose = robot, now: float = now) -> None:
            navigation_map.insert_scan(seen)
            navigation_map.update(robot, now)

        times["scan_to_cost"].append(timed(take))
        vertices.append(len(navigation_map.window_map.vertices))
        if step % PLAN_EVERY == 0:
            times["overlay"].append(timed(lambda: turn(navigation_map)))
            shown, stored = navigation_map.window_map.snapshot(), navigation_map.layers[tiled.profile_layer]
            sensed.append(int(((shown.costs > stored.costs) | (shown.lethal & ~stored.lethal)).sum()))
            ends = np.array(robot.position), np.array((x + PLAN_LENGTH, y, ground[0]))
            start = tiled.find_place(ends[0], 60.0)
            goal = goal or tiled.find_place(ends[1], 60.0)
            begun = time.process_time()
            ours = kept.plan(start, goal, 0.03, NOT_CANCELLED)
            times["repaired" if "repaired" in ours.message else "not_repaired"].append(
                1e3 * (time.process_time() - begun)
            )
            above.append(ours.cost / plan_between(tiled, start, goal).cost - 1.0)
            for name in ("plan", "again"):
                times[name].append(timed(lambda ends=ends: plan_on_tiles(tiled, *ends, surface_distance=60.0)))  # type: ignore[misc]
    figures = {f"{name}_ms": (float(np.median(all_)), max(all_)) for name, all_ in times.items() if all_}
    return {
        **figures,
        "window_vertices": max(vertices),
        "sensed_vertices": max(sensed),
        "repairs": len(times["repaired"]),
        "repaired_above_searched": max(above),
        "raised_tiles": len(tiled._raised),
        "megabytes_at_the_start": before,
        "megabytes_at_the_end": megabytes(),
    }


def main() -> None:
    """Build the maps, drive on each, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sides", default="1001,2001", help="samples a side of the maps, at 0.5 m")
    parser.add_argument("--metres", type=int, default=60)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    for side in map(int, arguments.sides.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            heights = Path(folder) / "heights.npy"
            write_heights(heights, side)
            index = build_tiles(
                HeightSource(open_heights(heights, side * side), SPACING, SPACING),
                Path(folder) / "map",
                SETTINGS,
                workers=2,
            )
            with ProcessPoolExecutor(1, get_context("spawn")) as pool:  # the memory of the build does not count
                pool.submit(drive, Path(folder) / "map", 2).result()  # compiles
                driven = pool.submit(drive, Path(folder) / "map", arguments.metres).result()
            figures = {"side": side, "tiles": len(index.tiles), **driven}
        if arguments.json:
            print(json.dumps(figures))
            continue
        for name, value in figures.items():
            text = f"{value[0]:.1f} ({value[1]:.1f})" if isinstance(value, tuple) else f"{value:.6g}"
            print(f"{name:24} {text}", flush=True)


if __name__ == "__main__":
    with interruptible():
        main()
