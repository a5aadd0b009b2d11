"""BARN worlds: local planning among cylinders, per controller, beside the published DWA run.

    python benchmarks/barn.py [--quick] [--json] [--controllers mppi,...] [--data ../shared/data]

A kinematic robot (0.42 x 0.33 m footprint with 0.1 m padding by costmap_2d's rule, 0.5 m/s, 1.57 rad/s, acceleration
10 m/s^2 and 20 rad/s^2 as in the published settings) drives from (-2, 3) to within 1 m of (-2, 13). It has no map: a
planar scan of 720 beams marks every cylinder hit within 10 m, marks are kept, the inflation radius is 0.30 m. Theta*
replans once a second from the pose on that map, the controller runs at 20 Hz. A collision is the unpadded footprint
touching a cylinder; the limit is 100 s. Score per run as in the challenge: success * t_opt / clip(t, 4 t_opt, 8 t_opt),
t_opt = reference length / 2 m/s. The scan is exact against circles and simulated here, so nothing but our planners and
controllers is measured. ``planner`` tells for all worlds whether Theta* finds a way with 0.25 m clearance.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path as FilePath

import numpy as np
from scipy.ndimage import distance_transform_edt

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.controllers.dwa import DwaController
from mbf_costmap_nav.controllers.mppi import MppiController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.costmap import Costmap
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.plugins import CostmapContext

RESOLUTION, ORIGIN, SIZE = 0.05, (-7.0, -1.0), (340, 200)
BODY = Footprint([[0.21, 0.165], [-0.21, 0.165], [-0.21, -0.165], [0.21, -0.165]])
PERIOD, REPLAN_PERIOD, SCAN_PERIOD = 0.05, 1.0, 0.1
BEAMS, SCAN_RANGE = 720, 10.0
LINEAR_ACCEL, ANGULAR_ACCEL, MAX_YAW_RATE = 10.0, 20.0, 1.57
PUBLISHED = {"success": 0.850, "collision": 0.056, "timeout": 0.094, "time": 33.15, "score": 0.158}
CONTROLLERS = {
    "regulated_pure_pursuit": (RegulatedPurePursuitController, {"max_angular_vel": 1.57}),
    "mppi": (MppiController, {"vx_max": 0.5, "wz_max": 1.57}),
    "dwa": (DwaController, {"max_vel_x": 0.5, "max_vel_theta": 1.57}),
}


class ScannedMap(LayeredCostmap):
    """A costmap of what the scan has seen, inflated with the inscribed radius of the padded footprint."""

    def __init__(self) -> None:
        self.seen = np.zeros(SIZE, dtype=np.uint8)
        empty = Costmap(self.seen, RESOLUTION, *ORIGIN)
        super().__init__(empty.geometry, [], BODY, footprint_padding=0.0)
        self.clearance = BODY.padded(0.1).inscribed_radius
        self.current = empty

    def snapshot(self) -> Costmap:
        """Return what has been seen so far."""
        return self.current

    def mark(self, points: np.ndarray) -> None:
        """Mark hits and inflate anew if one of them is new."""
        cells, inside = self.current.world_to_cells(points)
        before = int(self.seen.sum())
        self.seen[cells[inside, 1], cells[inside, 0]] = 1
        if int(self.seen.sum()) != before or self.current.version == 0:
            self.current = Costmap(inflate(self.seen, self.clearance), RESOLUTION, *ORIGIN, version=1)


def inflate(seen: np.ndarray, inscribed: float, radius: float = 0.55, decay: float = 5.0) -> np.ndarray:
    """costmap_2d's inflation of the marked cells."""
    if not seen.any():
        return np.zeros_like(seen)
    distance = distance_transform_edt(seen == 0) * RESOLUTION
    cost = (252.0 * np.exp(-decay * np.maximum(distance - inscribed, 0.0))).astype(np.uint8)
    cost[distance <= inscribed] = 253
    cost[distance > radius] = 0
    cost[distance == 0.0] = 254
    return cost


def scan(x: float, y: float, cylinders: np.ndarray, radius: float) -> np.ndarray:
    """(n, 2) hits of all beams on the circles."""
    angles = np.arange(BEAMS) * (2.0 * np.pi / BEAMS)
    beams = np.column_stack([np.cos(angles), np.sin(angles)])
    offsets = cylinders - (x, y)
    along = beams @ offsets.T
    square = radius**2 - np.sum(offsets**2, axis=1) + along**2
    ranges = np.where((square >= 0.0) & (along > 0.0), along - np.sqrt(np.maximum(square, 0.0)), np.inf).min(axis=1)
    hit = ranges < SCAN_RANGE
    # A hair inside the surface, so that the mark falls into the cell of the obstacle.
    return np.array([x, y]) + beams[hit] * (ranges[hit, None] + 0.005)


def touches(x: float, y: float, yaw: float, cylinders: np.ndarray, radius: float) -> bool:
    """Whether the unpadded rectangle touches a circle."""
    c, s = math.cos(yaw), math.sin(yaw)
    local = (cylinders - (x, y)) @ np.array([[c, -s], [s, c]])
    outside = np.maximum(np.abs(local) - (0.21, 0.165), 0.0)
    return bool((np.hypot(*outside.T) < radius).any())


class RunClock:
    """The run's own time."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        """Return the run's time [s]."""
        return self.time


def make_plugin(plugin_class: type, costmap: LayeredCostmap, clock: RunClock, seed: int, **parameters: object):
    values = plugin_class.Parameters(**parameters)
    context = CostmapContext("barn", values, clock, np.random.default_rng(seed), None, costmap, costmap, costmap)
    return plugin_class(context)


def run_world(world: dict, radius: float, name: str, seed: int) -> tuple[str, float]:
    """Drive one world; returns success, collision or timeout, and the time [s]."""
    cylinders = np.array(world["cylinders"], dtype=float)
    costmap, clock = ScannedMap(), RunClock()
    controller_class, parameters = CONTROLLERS[name]
    controller = make_plugin(controller_class, costmap, clock, seed, **parameters)
    planner = make_plugin(ThetaStarPlanner, costmap, clock, seed, cost_factor=4.0)
    state, twist = np.array([-2.0, 3.0, 1.57]), np.zeros(3)
    goal = Pose.planar(-2.0, 13.0, 1.57)
    failures = 0
    for cycle in range(int(100.0 / PERIOD)):
        clock.time = cycle * PERIOD
        pose = Pose.planar(*state)
        if math.hypot(state[0] + 2.0, state[1] - 13.0) <= 1.0:
            return "success", clock.time
        if cycle % round(SCAN_PERIOD / PERIOD) == 0:
            costmap.mark(scan(state[0], state[1], cylinders, radius))
        if cycle % round(REPLAN_PERIOD / PERIOD) == 0 or failures > 0:
            plan = planner.make_plan(PlanRequest(pose, goal, dist_tolerance=1.0))
            if plan.success:
                controller.set_plan(plan.path)
        result = controller.compute_velocity_commands(ControlRequest(pose, Twist.planar(*twist)))
        failures = 0 if result.success else failures + 1
        wanted = np.array([result.command.vx, 0.0, result.command.wz]) if result.success else np.zeros(3)
        if failures > 20:  # a second without a command: back up slowly, as a recovery would
            wanted = np.array([-0.1, 0.0, 0.0])
        change = np.array([LINEAR_ACCEL, LINEAR_ACCEL, ANGULAR_ACCEL]) * PERIOD
        wanted[2] = np.clip(wanted[2], -MAX_YAW_RATE, MAX_YAW_RATE)
        twist = np.clip(wanted, twist - change, twist + change)
        yaw = state[2] + 0.5 * twist[2] * PERIOD
        state = state + np.array([math.cos(yaw) * twist[0], math.sin(yaw) * twist[0], twist[2]]) * PERIOD
        if touches(*state, cylinders, radius):
            return "collision", clock.time
    return "timeout", 100.0


def planner_results(worlds: dict, radius: float) -> tuple[int, float]:
    """Worlds with a Theta* path at 0.25 m clearance, and the largest excess [m] over the published length."""
    found, excess = 0, -math.inf
    for world in worlds.values():
        centres = Costmap(np.zeros(SIZE, dtype=np.uint8), RESOLUTION, *ORIGIN)
        iy, ix = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        points = centres.cells_to_world(np.column_stack([ix.ravel(), iy.ravel()]))
        near = np.full(len(points), np.inf)
        for cylinder in np.array(world["cylinders"], dtype=float):
            near = np.minimum(near, np.hypot(*(points - cylinder).T))
        blocked = (near < radius + 0.25).reshape(SIZE).astype(np.uint8) * np.uint8(254)
        costmap = ScannedMap()
        costmap.current = Costmap(blocked, RESOLUTION, *ORIGIN)
        planner = make_plugin(ThetaStarPlanner, costmap, RunClock(), 0, cost_factor=0.0)
        plan = planner.make_plan(PlanRequest(Pose.planar(-2, 3, 1.57), Pose.planar(-2, 13, 1.57)))
        if plan.success:
            found += 1
            excess = max(excess, plan.path.length - reference_length(world))
    return found, excess


def reference_length(world: dict) -> float:
    """Length [m] of the world's published path."""
    return float(next(world[key] for key in world if "length" in key))


def chosen_worlds(worlds: dict, every: int) -> Iterator[tuple[str, dict]]:
    yield from list(worlds.items())[::every]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a few worlds")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    parser.add_argument("--controllers", default=",".join(CONTROLLERS))
    parser.add_argument("--every", type=int, default=0, help="take every n-th world (default 1, quick 40)")
    parser.add_argument("--data", type=FilePath, default=FilePath(__file__).parents[2] / "shared" / "data")
    arguments = parser.parse_args()
    barn = json.loads((arguments.data / "barn" / "barn240.json").read_text())
    every = arguments.every or (40 if arguments.quick else 1)
    summary: dict[str, object] = {}
    print("controller                worlds  success  collision  timeout  mean time of successes  score")
    print("published DWA run            50    0.850      0.056    0.094                   33.15  0.158")
    for name in arguments.controllers.split(","):
        runs = []
        for number, world in chosen_worlds(barn["worlds"], every):
            outcome, time = run_world(world, barn["radius"], name, seed=int(number))
            best = reference_length(world) / 2.0
            runs.append((outcome, time, (outcome == "success") * best / min(max(time, 4 * best), 8 * best)))
        shares = {
            kind: float(np.mean([run[0] == kind for run in runs])) for kind in ("success", "collision", "timeout")
        }
        times = [run[1] for run in runs if run[0] == "success"]
        shares |= {"time": float(np.mean(times)) if times else 100.0, "score": float(np.mean([run[2] for run in runs]))}
        summary[name] = {"worlds": len(runs), **shares}
        print(
            f"{name:25s} {len(runs):6d} {shares['success']:8.3f} {shares['collision']:10.3f} {shares['timeout']:8.3f}"
            f" {shares['time']:23.2f} {shares['score']:6.3f}",
            flush=True,
        )
    worlds = dict(chosen_worlds(barn["worlds"], max(1, every // 4)))
    found, excess = planner_results(worlds, barn["radius"])
    print(
        f"Theta* with 0.25 m clearance: {found} of {len(worlds)} worlds, at most {excess:.2f} m over the published path"
    )
    if arguments.json:
        planner = {"worlds": len(worlds), "found": found, "largest_excess": excess}
        print(json.dumps({"published_dwa": PUBLISHED, "planner": planner, **summary}))


if __name__ == "__main__":
    main()
