"""Accuracy and cost of the tracker of moving objects, against the simulator's truth.

    python benchmarks/tracking.py [--quick] [--json] [--seed N]

Twenty people walk on random routes through the office; a robot stands, drives or turns among them with a planar lidar
of 720 beams at 10 Hz (noise 1 cm). The walls are known, the people are not. Reported for each motion of the robot:

- the velocity error [m/s] of all confirmed objects that are a person's, median and 90th percentile, at all times;
- the delay [s] of the velocity: that shift of the truth in time by which the errors are least;
- the delay [s] after turns by more than 45 degrees: until the velocity of a person who was known before, and is known
  for a second after, is nearer to the new one than to the old one; median and 90th percentile;
- the share of people in view (at least five hits within 6 m) that are tracked, and objects that are nobody;
- the time of one scan [ms]: taking it in, from the rays to the objects; thread time, median and 99th percentile.
"""

from __future__ import annotations

import argparse
import json
import math
from time import thread_time

import numpy as np

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.layers.layer_list import LayerEntry
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.time.program_end import interruptible
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from terrain.physics.actors import PERSON_RADIUS, RouteWalker
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.robot_models import ROBOTS
from terrain.scenarios.actors import random_route
from terrain.scenarios.world_types import OfficeWorld
from terrain.sensors.lidar import Lidar, LidarModel, planar_directions
from terrain.sensors.rays import StaticRays
from terrain.worlds.upright_solids import SolidRays

PEOPLE, BEAMS, RATE, RANGE = 20, 720, 10.0, 8.0
IN_VIEW, FEWEST_HITS, SAME = 6.0, 5, 0.5  # m, -, m
LAGS = np.arange(0, 16)  # scans
TURN, BEFORE, AFTER = 0.25 * math.pi, 3, 10  # rad, scans, scans
MOTIONS = {"stands": Twist(), "drives": Twist.planar(0.4, 0.0, 0.25), "turns": Twist.planar(0.0, 0.0, 1.0)}


class Office:
    """The office with its people and a robot."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        grid = OfficeWorld(type="office").grid()
        self.world = KinematicWorld(building=grid)
        self.people = [
            RouteWalker(
                self.world, random_route(grid, rng), float(rng.uniform(0.4, 1.4)), float(rng.uniform(0.0, 20.0))
            )
            for _ in range(PEOPLE)
        ]
        free = grid.free & (self.world._clearance > 1.0)
        row, column = np.argwhere(free)[rng.integers(free.sum())]
        x, y = grid.origin_x + column * grid.resolution, grid.origin_y + row * grid.resolution
        self.robot = KinematicRobot(self.world, ROBOTS["turtlebot"], self.world.pose_at(float(x), float(y), 0.0))
        model = LidarModel((0.0, 0.0, 0.3), planar_directions(BEAMS), RATE, RANGE)
        casters = [StaticRays(*self.world.static_surface()), SolidRays(self.world.solids)]
        self.lidar = Lidar(self.robot, "lidar", casters, model, rng)
        entries = tuple(LayerEntry(name=name, type=name) for name in ("static", "moving_obstacles"))
        cells = np.where(grid.occupied, LETHAL, 0).astype(np.uint8)
        self.map = build_layered_costmap(
            CostmapParameters(robot_radius=0.2, layers=entries),
            {"moving_obstacles": {"sources": ["lidar"]}},
            static_map=Costmap(cells, grid.resolution, grid.origin_x, grid.origin_y),
        )

    def places(self) -> np.ndarray:
        """Where the people are (n, 2) [m]."""
        return np.array([(pose.x, pose.y) for pose in (person.pose() for person in self.people)])

    def scan(self, command: Twist) -> tuple[tuple[TrackedObject, ...], np.ndarray, float]:
        """Drive until the next scan and take it in; return the objects, who is in view, and the time it took [s]."""
        due = self.world.time + 1.0 / RATE
        while self.world.time < due - 1e-9:
            self.robot.send_command(command)
            self.world.step()
        scan = self.lidar.measure(self.world.time)
        hits, places, pose = scan.points[:, :2], self.places(), self.robot.pose()
        near = np.hypot(*(hits[None] - places[:, None]).transpose(2, 0, 1)) < PERSON_RADIUS + 0.05
        away = np.hypot(places[:, 0] - pose.x, places[:, 1] - pose.y)
        in_view = (near.sum(axis=1) >= FEWEST_HITS) & (away < IN_VIEW)
        began = thread_time()
        self.map.insert_scan(scan)
        self.map.update(pose, self.world.time)
        return self.map.tracked_objects(self.world.time), in_view, thread_time() - began


def turn_delays(places: np.ndarray, known: dict[tuple[int, int], np.ndarray]) -> list[float]:
    """How late turns are noticed [s]; ``places`` (scans, n, 2) [m], ``known`` velocities by scan and person."""
    steps, delays = np.diff(places, axis=0) * RATE, []  # steps[k] leads from scan k to k + 1
    for person in range(places.shape[1]):
        for scan in range(BEFORE, len(steps) - AFTER):  # the turn is between the scans before and at this one
            old, new = steps[scan - 2, person], steps[scan, person]
            turn = math.atan2(old[0] * new[1] - old[1] * new[0], float(old @ new))
            seen = [known.get((scan + k, person)) for k in range(-BEFORE, AFTER)]
            steady = np.allclose(steps[scan - 3, person], old) and np.allclose(steps[scan + 1, person], new)
            if abs(turn) < TURN or not steady or any(one is None for one in seen):
                continue
            late = [np.hypot(*(one - new)) > 0.5 * np.hypot(*(new - old)) for one in seen[BEFORE:]]
            delays.append((late.index(False) if False in late else AFTER) / RATE + 0.5 / RATE)
    return delays


def measure(motion: str, seed: int, scans: int) -> dict[str, float]:
    """Numbers of one motion of the robot."""
    office = Office(seed)
    truth, estimates, times, seen, tracked, nobody = [], [], [], 0, 0, 0
    for number in range(scans):
        objects, in_view, seconds = office.scan(MOTIONS[motion])
        places = office.places()
        truth.append(places)
        times.append(seconds)
        found = set()
        for known in objects:
            gaps = np.hypot(places[:, 0] - known.x, places[:, 1] - known.y)
            person = int(np.argmin(gaps))
            if gaps[person] < SAME:
                found.add(person)
                estimates.append((number, person, known.vx, known.vy))
            else:
                nobody += 1
        seen += int(in_view.sum())
        tracked += sum(bool(in_view[person]) for person in found)
    velocities = np.gradient(np.array(truth), 1.0 / RATE, axis=0)
    known = {(number, person): np.array([vx, vy]) for number, person, vx, vy in estimates}
    delays = turn_delays(np.array(truth), known) or [math.nan]
    errors = np.array(
        [[math.hypot(vx - v[0], vy - v[1]) for lag in LAGS for v in [velocities[max(number - lag, 0), person]]]
         for number, person, vx, vy in estimates]
    )  # fmt: skip
    settled = times[20:]  # the first ones compile
    return {
        "velocity_error_median": float(np.median(errors[:, 0])),
        "velocity_error_90": float(np.quantile(errors[:, 0], 0.9)),
        "delay": float(LAGS[int(np.argmin(errors.mean(axis=0)))] / RATE),
        "turn_delay_median": float(np.median(delays)),
        "turn_delay_90": float(np.quantile(delays, 0.9)),
        "tracked_share": tracked / max(seen, 1),
        "nobody_share": nobody / max(nobody + len(estimates), 1),
        "scan_ms_median": 1e3 * float(np.median(settled)),
        "scan_ms_99": 1e3 * float(np.quantile(settled, 0.99)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="20 s of each motion instead of 120 s")
    parser.add_argument("--json", action="store_true", help="last line is one JSON object")
    parser.add_argument("--seed", type=int, default=100, help="of routes, places and noise")
    arguments = parser.parse_args()
    results = {}
    for motion in MOTIONS:
        results[motion] = measure(motion, arguments.seed, 200 if arguments.quick else 1200)
        print(f"robot {motion}: " + ", ".join(f"{name} {value:.3f}" for name, value in results[motion].items()))
    if arguments.json:
        print(json.dumps(results))


if __name__ == "__main__":
    with interruptible():
        main()
