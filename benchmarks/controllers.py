"""Cycle time of the controllers against a plain numpy rollout in the same run.

    python benchmarks/controllers.py [--quick] [--json]

The peer is what a numpy MPPI would do at least: 2000 x 56 noisy velocities integrated with numpy's cumulative sums and
one look-up in the map for each pose, no critics. Ours is the whole cycle: noise, limits, rollout, all eight critics,
weights, mean, smoothing, footprint check. CPU times of the one thread; medians and the median of the ratios.

The guard that stops the robot before contact judges each command. Its peer is the command of regulated pure pursuit in
the same run: the robot drives at 0.6 m/s between two rows of others, who all wait or all walk along beside it.
"""

from __future__ import annotations

import argparse
import json
import os
from time import thread_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: one thread, as the peer

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.layers.layer_list import LayerEntry
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.plugins import ControlRequest
from mbf_abstract.time.program_end import interruptible
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapContext

SAMPLES, STEPS, DT = 2000, 56, np.float32(0.05)
FOOTPRINT = [[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]
SCANS, SCAN_PERIOD, PERIOD_MS = 20, 0.1, 50.0  # -, s, ms


class GivenMap(LayeredCostmap):
    """A costmap without layers that shows one grid."""

    def __init__(self, grid: Costmap) -> None:
        super().__init__(grid.geometry, [], Footprint(FOOTPRINT))
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


def map_with(count: int, speed: float) -> LayeredCostmap:
    """A map on which ``count`` others are known: two rows beside the robot's way, who go along it at a speed [m/s]."""
    entries = (LayerEntry(name="moving", type="moving_obstacles"),)
    parameters = CostmapParameters(footprint=FOOTPRINT, layers=entries)
    found = build_layered_costmap(
        parameters,
        {"moving": {"sources": ["lidar"], "obstacle_max_range": 10.0}},
        static_map=Costmap(np.zeros((200, 200), np.uint8), 0.05),
    )
    k = np.arange(count)
    middles = np.column_stack([2.5 + 0.65 * (k // 2), 5.0 + np.where(k % 2, 0.6, -0.6)])
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    sides = 0.15 * np.column_stack([np.cos(angles), np.sin(angles)])
    for scan in range(SCANS):
        stamp = SCAN_PERIOD * scan
        flat = (middles[:, None] + (speed * stamp, 0.0) + sides[None]).reshape(-1, 2)
        points = np.column_stack([flat, np.full(len(flat), 0.3)])
        found.insert_scan(RangeScan.of_points("lidar", points, (1.0, 5.0, 0.3), stamp))
        found.update(Pose.planar(1.0, 5.0), stamp)
    return found


def guard_times(costmap: LayeredCostmap, repeats: int) -> tuple[float, float]:
    """Median time [ms] in which the guard judges a command, and the least share of one that it let pass."""
    ahead, now, times, least = Twist.planar(0.6), SCAN_PERIOD * (SCANS - 1), [], 1.0
    for repeat in range(repeats):
        pose = Pose.planar(2.0 + 0.1 * (repeat % 20), 5.0)
        begin = thread_time()
        share, *_ = costmap.safe_share(pose, ahead, ahead, now)
        times.append(1e3 * (thread_time() - begin))
        least = min(least, share)
    return float(np.median(times[3:])), least


def measure_guard(results: dict[str, float], repeats: int) -> None:
    """Print and add to ``results`` what the guard takes for a command [ms]."""
    for motion, speed in ((Motion.WAITING, 0.0), (Motion.MOVING, 0.5)):
        for count in (1, 5, 20):
            others, name = map_with(count, speed), f"guard_{count}_{motion.value}"
            known = others.layers["moving"].guarded_objects(SCAN_PERIOD * (SCANS - 1))
            assert [one.motion for one in known] == count * [motion]
            results[f"{name}_ms"], least = guard_times(others, repeats)
            ms = results[f"{name}_ms"]
            print(
                f"{name:24s} {ms:7.3f} ms a command, {ms / results['RegulatedPurePursuit_ms']:.2f} of that of pure "
                f"pursuit, {100.0 * ms / PERIOD_MS:.1f} % of a period of 50 ms; least share {least:.2f}"
            )


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
    measure_guard(results, 63 if arguments.quick else 403)
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    with interruptible():
        main()
