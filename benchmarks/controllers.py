"""Cycle time of the controllers against a plain numpy rollout in the same run.

    python benchmarks/controllers.py [--quick] [--json]

The peer is what a numpy MPPI would do at least: 2000 x 56 noisy velocities integrated with numpy's cumulative sums and
one look-up in the map for each pose, no critics. Ours is the whole cycle: noise, limits, rollout, all eight critics,
weights, mean, smoothing, footprint check. CPU times of the one thread; medians and the median of the ratios.
"""

from __future__ import annotations

import argparse
import json
import os
from time import thread_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: one thread, as the peer

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.plugins import ControlRequest
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapContext

SAMPLES, STEPS, DT = 2000, 56, np.float32(0.05)


class GivenMap(LayeredCostmap):
    """A costmap without layers that shows one grid."""

    def __init__(self, grid: Costmap) -> None:
        super().__init__(grid.geometry, [], Footprint([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]))
        self.grid = grid

    def snapshot(self) -> Costmap:
        """Return the grid."""
        return self.grid


class StandingClock:
    """Time that stands still."""

    def now(self) -> float:
        """Return zero."""
        return 0.0


def local_map() -> Costmap:
    """10 m x 10 m with gradients of cost, free around the path."""
    distance = np.abs(np.arange(200) - 100)[:, None] * np.ones(200)[None]
    return Costmap(np.clip((distance - 30.0) * 4.0, 0.0, 252.0).astype(np.uint8), 0.05, -5.0, -5.0)


def numpy_rollout(rng: np.random.Generator, grid: Costmap):
    """Return the peer: integrate and look up, with noise drawn beforehand."""
    vx = (0.3 + 0.2 * rng.standard_normal((SAMPLES, STEPS))).astype(np.float32)
    wz = (0.4 * rng.standard_normal((SAMPLES, STEPS))).astype(np.float32)

    def run() -> np.ndarray:
        yaw = np.cumsum(wz * DT, axis=1)
        x = np.cumsum(vx * np.cos(yaw) * DT, axis=1)
        y = np.cumsum(vx * np.sin(yaw) * DT, axis=1)
        ix = ((x + np.float32(5.0)) / np.float32(0.05)).astype(np.int32)
        iy = ((y + np.float32(5.0)) / np.float32(0.05)).astype(np.int32)
        return grid.cells[np.clip(iy, 0, 199), np.clip(ix, 0, 199)].sum(axis=1)

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer repeats")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    arguments = parser.parse_args()
    grid = local_map()
    costmap = GivenMap(grid)
    path = Path.from_points([(x, 0.1 * x, 0.0) for x in np.linspace(0.0, 4.0, 41)])
    request = ControlRequest(Pose.planar(0.0, 0.05, 0.05), Twist.planar(0.3))
    peer = numpy_rollout(np.random.default_rng(0), grid)
    results: dict[str, float] = {}
    for controller_class in (MPPIController, DWAController, RegulatedPurePursuitController):
        parameters = controller_class.Parameters()
        rng = np.random.default_rng(0)
        context = CostmapContext("benchmark", parameters, StandingClock(), rng, None, costmap)
        controller = controller_class(context)
        controller.set_plan(path)
        times = []
        for repeat in range(13 if arguments.quick else 61):
            begin = thread_time()
            assert controller.compute_velocity_commands(request).success
            middle = thread_time()
            peer()
            if repeat >= 3:  # the first calls compile and fill caches
                times.append((middle - begin, thread_time() - middle))
        table = np.array(times) * 1e3
        ratio = float(np.median(table[:, 0] / table[:, 1]))
        name = controller_class.__name__.removesuffix("Controller")
        results[f"{name}_ms"], results[f"{name}_over_numpy_rollout"] = float(np.median(table[:, 0])), ratio
        print(
            f"{name:24s} {np.median(table[:, 0]):7.3f} ms a cycle, numpy rollout {np.median(table[:, 1]):7.3f} ms, "
            f"ratio {ratio:.3f}"
        )
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
