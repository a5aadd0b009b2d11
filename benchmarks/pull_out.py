"""How long a robot searches for a place to let others pass, with a check of many poses and with one of each.

    python benchmarks/pull_out.py
    python benchmarks/pull_out.py --repeats 3 --json rows.jsonl

A room of 2.5 m x 3 m, and a corridor of 0.9 m to the next one, on a costmap and on a mesh. The robot stands in the
first room on its path through the corridor, which it has to leave free: by 0.6 m, for which there is a place, and by
1.6 m, for which there is none, so that all that can be reached is looked at.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from types import MethodType
from typing import Any

import numpy as np
from moving_worlds import RESOLUTION, cut, floor
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.pull_out import find_pull_out, paths_to_keep_free
from mbf_abstract.time.program_end import interruptible
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_mesh_nav.map.mesh_map import MeshMap

RADIUS, REACH, EDGE = 0.2, 4.0, 0.1  # m
START = Pose.planar(2.0, 2.0)
DISTANCES = {"a place": 0.6, "none": 1.6}  # m from the path


def rooms() -> NDArray[np.bool_]:
    """Free cells of the floor."""
    free = floor(11.0, 4.0)
    for x0, x1, y0, y1 in ((0.5, 3.0, 0.5, 3.5), (3.0, 8.0, 1.55, 2.45), (8.0, 10.5, 0.5, 3.5)):
        cut(free, x0, x1, y0, y1)
    return free


def costmap() -> NavigationMap:
    """Return the rooms as a costmap, for a round robot."""
    cells = np.where(rooms(), 0, 254).astype(np.uint8)
    layers = ({"name": "walls", "type": "static"},)
    parameters = CostmapParameters(resolution=RESOLUTION, robot_radius=RADIUS, max_age=0.0, layers=layers)
    made = build_layered_costmap(parameters, {}, static_map=Costmap(cells, RESOLUTION))
    made.update(START, 0.0)
    return made


def mesh() -> NavigationMap:
    """Return the floor of the rooms as triangles, which end where it ends."""
    every = round(EDGE / RESOLUTION)
    made = MeshMap.from_heights(np.where(rooms()[::every, ::every], 0.0, np.nan), EDGE, EDGE)
    made.inscribed_radius = RADIUS
    return made


def pose_by_pose(navigation_map: NavigationMap) -> NavigationMap:
    """Return the map with the check of many poses that every map inherits."""
    inherited = MethodType(NavigationMap.plane_check, navigation_map)
    setattr(navigation_map, "plane_check", inherited)  # noqa: B010 - a method is replaced for this object only
    return navigation_map


def search(navigation_map: NavigationMap, distance: float, repeats: int) -> tuple[float, int]:
    """Shortest time [ms] of some searches, and the number of steps found; -1 without a place."""
    keep_free = paths_to_keep_free(START, np.zeros((0, 3)), [], REACH)
    times = []
    for _ in range(repeats + 1):  # the first one compiles
        begin = time.perf_counter()
        steps = find_pull_out(navigation_map, START, keep_free, distance, REACH)
        times.append(1e3 * (time.perf_counter() - begin))
    return min(times[1:]), -1 if steps is None else len(steps)


def main(arguments: list[str] | None = None) -> None:
    """Measure, and print a line for each map and distance."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3, help="searches of each kind; the shortest time counts")
    parser.add_argument("--json", type=Path, help="append the rows to this file")
    options = parser.parse_args(arguments)
    for make in (costmap, mesh):
        for name, distance in DISTANCES.items():
            at_once, steps = search(make(), distance, options.repeats)
            one_by_one, same = search(pose_by_pose(make()), distance, options.repeats)
            assert steps == same, "both find the same"
            row: dict[str, Any] = {"map": make.__name__, "there is": name, "ms": at_once, "pose_by_pose_ms": one_by_one}
            print(f"{make.__name__:8} {name:8} {at_once:8.1f} ms, pose by pose {one_by_one / at_once:.1f} times that")
            if options.json is not None:
                with options.json.open("a", encoding="utf-8") as rows:
                    rows.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    with interruptible():
        main()
