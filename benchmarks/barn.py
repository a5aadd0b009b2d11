"""BARN worlds: local planning among cylinders, per controller, beside the published DWA run.

    python benchmarks/barn.py [--quick] [--json] [--controllers mppi,...] [--data ../shared/data]

The whole stack drives: the costmap server of ``barn.yaml`` on simulated time, one move_base goal a world, replanning
and recoveries as any robot has them. A kinematic robot (0.42 x 0.33 m; padding 0.1 m, inflation 0.30 m, 0.5 m/s,
1.57 rad/s, 10 m/s^2 and 20 rad/s^2 as in the published settings) goes from (-2, 3) to within 1 m of (-2, 13). It has
no map: a planar lidar of 720 beams, 10 Hz, 10 m, exact against the circles, is all it knows. A collision is the
unpadded footprint touching a cylinder; the limit is 100 s, and a goal that move_base gives up counts as timeout.
Score per run as in the challenge: success * t_opt / clip(t, 4 t_opt, 8 t_opt), t_opt = reference length / 2 m/s.
``planner`` tells whether Theta* finds a way with 0.25 m clearance to all cylinders, and how long it is.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path as FilePath

import numpy as np

from mbf_abstract.actions.goals import MoveBaseGoal
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.navigator import Navigator
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.sensing import RangeScan
from mbf_abstract.sim_clock import SimClock
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.transforms import TransformBuffer
from mbf_costmap_nav.costmap import Costmap
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from mbf_costmap_nav.plugins import CostmapContext

CONFIGURATION = FilePath(__file__).with_name("barn.yaml")
CONTROLLERS = ("regulated_pure_pursuit", "mppi", "dwa")
HALF_LENGTH, HALF_WIDTH = 0.21, 0.165
BEAMS, SCAN_RANGE, SCAN_PERIOD = 720, 10.0, 0.1
STEP = 0.02
ACCELERATION = np.array([10.0, 10.0, 20.0])
START, GOAL, REACH, TIME_LIMIT = Pose.planar(-2.0, 3.0, 1.57), Pose.planar(-2.0, 13.0, 1.57), 1.0, 100.0
RESOLUTION, ORIGIN, SIZE = 0.05, (-7.0, -1.0), (340, 200)
PUBLISHED = {"success": 0.850, "collision": 0.056, "timeout": 0.094, "time": 33.15, "score": 0.158}


class BarnRobot(LoopbackRobot):
    """The loopback robot with limited accelerations, a lidar, and cylinders around it that it can touch."""

    def __init__(self, clock: SimClock, transforms: TransformBuffer, cylinders: np.ndarray, radius: float) -> None:
        self.cylinders, self.radius = cylinders, radius
        self.collided = False
        self.navigator: Navigator | None = None
        self._twist = np.zeros(3)
        self._steps = 0
        super().__init__(clock, transforms, START, period=STEP)

    def _velocity(self) -> Twist:
        command = super()._velocity()
        wanted = np.array([command.vx, command.vy, command.wz])
        change = ACCELERATION * STEP
        self._twist = np.clip(wanted, self._twist - change, self._twist + change)
        return Twist.planar(*self._twist.tolist())

    def _step(self, seconds: float) -> None:
        super()._step(seconds)
        self.collided = self.collided or self._touches()
        self._steps += 1
        if self.navigator is not None and self._steps % round(SCAN_PERIOD / STEP) == 0:
            self.navigator.server.take_scan(self.scan())

    def scan(self) -> RangeScan:
        """All beams against all circles."""
        here = np.array([self._x, self._y])
        angles = np.arange(BEAMS) * (2.0 * np.pi / BEAMS)
        beams = np.column_stack([np.cos(angles), np.sin(angles)])
        offsets = self.cylinders - here
        offsets = offsets[np.hypot(*offsets.T) < SCAN_RANGE + self.radius]
        along = beams @ offsets.T
        square = self.radius**2 - np.sum(offsets**2, axis=1) + along**2
        beam, circle = np.nonzero((square >= 0.0) & (along > 0.0))
        ranges = np.full(BEAMS, np.inf)
        np.minimum.at(ranges, beam, along[beam, circle] - np.sqrt(square[beam, circle]))
        hits = ranges < SCAN_RANGE
        # A hair inside the surface, so that the mark falls into the cell of the obstacle.
        ends = here + beams * (np.minimum(ranges, SCAN_RANGE)[:, None] + 0.005 * hits[:, None])
        stamp = self._clock.now()
        return RangeScan("scan", "map", np.append(here, 0.0), np.pad(ends, ((0, 0), (0, 1))), hits, stamp)

    def _touches(self) -> bool:
        """Whether the unpadded rectangle touches a circle."""
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        local = (self.cylinders - (self._x, self._y)) @ np.array([[c, -s], [s, c]])
        outside = np.maximum(np.abs(local) - (HALF_LENGTH, HALF_WIDTH), 0.0)
        return bool((np.hypot(*outside.T) < self.radius).any())


def run_world(world: dict, radius: float, controller: str, seed: int) -> tuple[str, float]:
    """Drive one world; returns success, collision or timeout, and the time [s]."""
    clock, transforms = SimClock(), TransformBuffer()
    robot = BarnRobot(clock, transforms, np.array(world["cylinders"], dtype=float), radius)
    with Navigator.from_file(CONFIGURATION, robot, clock, transforms, seed=seed) as navigator:
        robot.navigator = navigator
        clock.sleep(1.0)  # first scans
        begin = clock.now()
        goal = MoveBaseGoal(GOAL, controller=controller, dist_tolerance=REACH, angle_tolerance=math.pi)
        handle = navigator.send(goal)
        outcome = "timeout"
        while clock.now() - begin < TIME_LIMIT and outcome == "timeout" and not handle.done:
            clock.sleep(STEP)
            if robot.collided:
                outcome = "collision"
            elif robot.pose.distance_to(GOAL) <= REACH:
                outcome = "success"
        time = clock.now() - begin
        handle.cancel()
    robot.close()
    clock.sleep(1.0)
    return outcome, time


class GivenMap(LayeredCostmap):
    """A costmap without layers that shows one grid."""

    def __init__(self, grid: Costmap) -> None:
        super().__init__(grid.geometry, [], Footprint([]))
        self.grid = grid

    def snapshot(self) -> Costmap:
        """Return the grid."""
        return self.grid


def planner_results(worlds: dict, radius: float) -> tuple[int, float]:
    """Worlds with a Theta* path at 0.25 m clearance, and the largest excess [m] over the published length."""
    found, excess = 0, -math.inf
    for world in worlds.values():
        grid = Costmap(np.zeros(SIZE, dtype=np.uint8), RESOLUTION, *ORIGIN)
        iy, ix = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        points = grid.cells_to_world(np.column_stack([ix.ravel(), iy.ravel()]))
        near = np.full(len(points), np.inf)
        for cylinder in np.array(world["cylinders"], dtype=float):
            near = np.minimum(near, np.hypot(*(points - cylinder).T))
        grid.cells[(near < radius + 0.25).reshape(SIZE)] = 254
        costmap = GivenMap(grid)
        parameters = ThetaStarPlanner.Parameters(cost_factor=0.0)
        rng = np.random.default_rng(0)
        context = CostmapContext("barn", parameters, SimClock(), rng, None, costmap, costmap, costmap)
        plan = ThetaStarPlanner(context).make_plan(PlanRequest(START, GOAL))
        if plan.success:
            found += 1
            excess = max(excess, plan.path.length - reference_length(world))
    return found, excess


def reference_length(world: dict) -> float:
    """Length [m] of the world's published path."""
    return float(next(world[key] for key in world if "length" in key))


def controller_results(name: str, worlds: dict, radius: float) -> dict[str, float]:
    """Shares of the outcomes, mean time of the successes and mean score of one controller; failures are named."""
    runs = []
    for number, world in worlds.items():
        outcome, time = run_world(world, radius, name, seed=int(number))
        best = reference_length(world) / 2.0
        runs.append((outcome, time, (outcome == "success") * best / min(max(time, 4 * best), 8 * best)))
        if outcome != "success":
            print(f"  {name}: world {number} ends in {outcome} after {time:.1f} s", flush=True)
    result = {kind: float(np.mean([run[0] == kind for run in runs])) for kind in ("success", "collision", "timeout")}
    times = [run[1] for run in runs if run[0] == "success"]
    result |= {
        "time": float(np.mean(times)) if times else TIME_LIMIT,
        "score": float(np.mean([run[2] for run in runs])),
    }
    return {"worlds": len(runs), **result}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="six worlds, without DWA")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    parser.add_argument("--controllers", default="", help=f"some of {','.join(CONTROLLERS)}")
    parser.add_argument("--every", type=int, default=0, help="take every n-th world (default 1, quick 40)")
    parser.add_argument("--data", type=FilePath, default=FilePath(__file__).parents[2] / "shared" / "data")
    arguments = parser.parse_args()
    barn = json.loads((arguments.data / "barn" / "barn240.json").read_text())
    every = arguments.every or (40 if arguments.quick else 1)
    worlds = dict(list(barn["worlds"].items())[::every])
    chosen = arguments.controllers.split(",") if arguments.controllers else CONTROLLERS[: 2 if arguments.quick else 3]
    summary: dict[str, object] = {"published_dwa": PUBLISHED}
    print("controller                worlds  success  collision  timeout  mean time of successes  score")
    print("published DWA run             50    0.850      0.056    0.094                   33.15  0.158")
    for name in chosen:
        result = controller_results(name, worlds, barn["radius"])
        summary[name] = result
        print(
            f"{name:25s} {result['worlds']:6d} {result['success']:8.3f} {result['collision']:10.3f}"
            f" {result['timeout']:8.3f} {result['time']:23.2f} {result['score']:6.3f}",
            flush=True,
        )
    found, excess = planner_results(worlds, barn["radius"])
    print(f"Theta*, 0.25 m clearance: {found} of {len(worlds)} worlds, at most {excess:.2f} m over the published path")
    if arguments.json:
        summary["planner"] = {"worlds": len(worlds), "found": found, "largest_excess": excess}
        print(json.dumps(summary))


if __name__ == "__main__":
    main()
