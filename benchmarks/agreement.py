"""Do planners and controllers agree about what is free? Every installed pair, over small random worlds of both maps.

A path that a planner returns is driven without inertia on a map that does not change. A pair agrees if the outline fits
at every pose of the path, if the controller does not refuse the plans of one place twice, and if the robot arrives. So
a robot does not agree that stands, goes about until its time is over, or is led to where the planner knows no path any
more. A contact of the outline without padding ends a drive. Rooms of 6 m x 6 m with boxes and walls with gaps; on the
costmap a robot of 1.0 m x 0.5 m, on the mesh a disc of 0.25 m. With ``--open`` no walls stand around: the map ends in
free ground; that of a mesh always does, on two sides.
``--map long_mesh``: the robot of the costmap on the mesh, with ``check_footprint`` (decision 0137).
``--map car``: a car of 1.0 m x 0.5 m with a turning circle of 0.7 m in rooms of 9 m x 9 m, and what can drive it.

    python benchmarks/agreement.py [--quick] [--json] [--seeds 0:40] [--map costmap] [--planners a,b] [--controllers c]
                                   [--open] [--replan 2] [--robots drawn] [--results FILE]

``--replan`` plans anew so many times a second while the robot drives, as ``move_base`` does with ``planner_frequency``.

``--robots drawn`` draws another robot for each seed, see ``agreement_robots``: discs, rectangles, L-shapes, trapezoids
about any centre, with inertia, a rate of control and a delay of their own, in rooms as much wider as they are. Plugins
are given the robot's limits, and keep all other defaults. Each controller drives with one planner a seed, in turn, if
none is named. Commands beyond a limit are counted.

``--results`` keeps every finished drive as a JSON line; a drive that is in the file is not repeated.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from agreement_robots import drawn_robot
from agreement_worlds import WORLDS, World
from seeds import seed_list

from mbf_abstract.actions.manoeuvre_kept import goes_on, rest_of
from mbf_abstract.actions.move_base_machine import NO_REPLAN_WITHIN
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path as RobotPath
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.plugins import ControlRequest, PlanRequest, PluginKind
from mbf_abstract.time.program_end import interruptible
from terrain.sweeps.log import SweepLog

DIST_TOLERANCE, ANGLE_TOLERANCE = 0.1, 0.25
LONGEST, STANDING = 90.0, 20.0  # s, of a robot of 0.5 m/s in a room that is not scaled
USUAL_SPEED, USUAL_YAW_RATE = 0.5, 1.0  # m/s, rad/s
SAME_PLACE = 0.1  # m
NEEDS_PLANNER = {"mesh.vector_field": "cvp"}  # a controller that follows what only this planner adds to its path


@dataclass(frozen=True)
class Verdict:
    """How a drive ended, with what was said, and where.

    arrived, no path (from the start), stranded (no path any more), misfit, refused, touched, stands, or late.
    """

    ending: str
    message: str
    pose: Pose
    plan_ms: float
    """Milliseconds of CPU that the first plan took."""
    seconds: float = 0.0
    """Time of the drive."""

    @property
    def agrees(self) -> bool:
        """Whether the robot arrived on what the planner returned, if it returned anything."""
        return self.ending in ("arrived", "no path")


def is_taken(world: World, followed: PathTracker | None, path: RobotPath) -> bool:
    """Whether a new path is driven, as in ``move_base``, instead of the one that is followed."""
    if followed is None:
        return True
    to_go = followed.deviation + followed.remaining
    return not goes_on(followed.path, to_go, path) or not all(map(world.fits, rest_of(followed.path, to_go)))


def drive(world: World, planner: Any, controller: Any, replan: float = 0.0) -> Verdict:
    """Plan and drive from the world's start to its goal; plan again once where the controller refuses.

    With ``replan`` it is planned anew so many times a second besides.
    """
    pose, goal = world.ends
    period, longest = world.robot.period, longest_drive(world)
    path, refused_at, track, plan_ms = None, None, [pose], math.nan
    followed: PathTracker | None = None

    def ended(ending: str, message: str = "", at: Pose | None = None) -> Verdict:
        return Verdict(ending, message, at or pose, plan_ms, period * (len(track) - 1))

    for cycle in range(round(longest / period)):
        is_due = (
            replan > 0.0 and cycle % round(1.0 / (replan * period)) == 0 and pose.distance_to(goal) > NO_REPLAN_WITHIN
        )
        if path is None or is_due:
            begin = time.process_time()
            plan = planner.make_plan(PlanRequest(pose, goal))
            plan_ms = 1e3 * (time.process_time() - begin) if math.isnan(plan_ms) else plan_ms
            if not plan.success and path is None:
                return ended("no path" if len(track) == 1 else "stranded", f"{int(plan.outcome)} {plan.message}")
            if plan.success and is_taken(world, followed if path is not None else None, plan.path):
                path, followed = plan.path, PathTracker(plan.path)
                if (index := world.first_misfit(path)) >= 0:
                    return ended("misfit", f"pose {index} of {len(path)}", path[index])
                if not controller.set_plan(path):
                    return ended("refused", "set_plan")
        assert followed is not None
        followed.update(pose.position)
        if controller.is_goal_reached(pose, DIST_TOLERANCE, ANGLE_TOLERANCE):
            return ended("arrived")
        result = controller.compute_velocity_commands(ControlRequest(*world.when_it_acts(pose)))
        if result.success:
            world.motion.judge(result.command)
            pose, touched = world.moved(pose, result.command)
            track.append(pose)
            if touched:
                return ended("touched", text_of(result.command))
            continue
        why = f"{int(result.outcome)} {result.message}"
        pose, touched = world.stopped(pose)
        if touched:
            return ended("touched", why)
        if refused_at is not None and pose.distance_to(refused_at) < SAME_PLACE:
            return ended("refused", why)
        refused_at, path = pose, None
    since = track[-1 - min(round(STANDING / period), len(track) - 1) :]
    stands = all(pose.distance_to(one) < SAME_PLACE for one in since)
    return ended("stands" if stands else "late", f"after {longest:g} s")


def longest_drive(world: World) -> float:
    """Time [s] after which a drive is late."""
    robot = world.robot
    slowness = max(1.0, USUAL_SPEED / robot.max_vel_x, USUAL_YAW_RATE / robot.max_vel_theta)
    return round(LONGEST * robot.scale * slowness) if robot.is_drawn else LONGEST


def text_of(command: Twist) -> str:
    """A command, readable."""
    return f"by {command.vx:.2f} m/s, {command.vy:.2f} m/s, {command.wz:.2f} rad/s"


def installed(backend: str, kind: PluginKind) -> list[str]:
    """Short names of the plugins of a kind that a backend offers."""
    return list(PluginRegistry(backend).names(kind))


def pairs(backend: str) -> list[tuple[str, str]]:
    """All planners with all controllers, but for those controllers that follow one planner only, and for cars."""
    if backend == "car":
        return [("hybrid_astar", controller) for controller in ("mppi", "regulated_pure_pursuit")]
    of = WORLDS[backend].backend
    return [
        (planner, controller)
        for planner in installed(of, PluginKind.PLANNER)
        for controller in installed(of, PluginKind.CONTROLLER)
        if NEEDS_PLANNER.get(f"{of}.{controller}", planner) == planner
    ]


def planners_of(backend: str, seed: int, controller: str, robots: str) -> list[str]:
    """Planners that a controller drives with: all, or one in turn where robots are drawn."""
    able = [planner for planner, one in pairs(backend) if one == controller]
    order = sorted({one for _, one in pairs(backend)}).index(controller)
    return [able[(seed + order) % len(able)]] if robots else able


def run(backend: str, seeds: list[int], chosen: argparse.Namespace, log: SweepLog) -> Iterator[dict[str, Any]]:
    """Drive every chosen pair over all seeds, or read how it ended; one row for each drive."""
    for seed, (planner, controller) in product(seeds, pairs(backend)):
        if controller not in (chosen.controllers or [controller]):
            continue
        if planner not in (chosen.planners or planners_of(backend, seed, controller, chosen.robots)):
            continue
        key = "/".join((backend, planner, controller, str(seed), *["open"] * chosen.open))
        key += f"/{chosen.replan:g}" if chosen.replan else ""
        key += f"/{chosen.robots}" if chosen.robots else ""
        if key not in log.rows:
            robot = drawn_robot(seed, is_disc=backend == "mesh") if chosen.robots else None
            world = WORLDS[backend](seed, chosen.open, robot)
            if world.ends is None:
                continue
            made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, controller)
            verdict = drive(world, *made, chosen.replan)
            place = tuple(round(value, 2) for value in (verdict.pose.x, verdict.pose.y, verdict.pose.yaw))
            kept = {name: getattr(verdict, name) for name in ("ending", "message", "agrees", "plan_ms", "seconds")}
            kept |= {"excess": world.motion.excess} if chosen.robots else {}
            of = {"map": backend, "pair": f"{planner} + {controller}", "planner": planner, "seed": seed}
            log.append(key, {**of, **kept, "place": place})
        yield log.rows[key]


def names(text: str) -> list[str]:
    """Names between commas."""
    return [name for name in text.split(",") if name]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="five worlds")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seeds", type=seed_list, default="0:40")
    parser.add_argument("--map", choices=[*WORLDS], default=None)
    parser.add_argument("--planners", type=names, default=[])
    parser.add_argument("--controllers", type=names, default=[])
    parser.add_argument("--open", action="store_true", help="no walls around")
    parser.add_argument("--replan", type=float, default=0.0, help="plans a second while driving")
    parser.add_argument("--robots", choices=["drawn"], default="", help="a robot for each seed")
    parser.add_argument("--results", type=Path, default=None, help="file of finished drives")
    chosen = parser.parse_args()
    seeds = list(range(5)) if chosen.quick else chosen.seeds
    rows = []
    with tempfile.TemporaryDirectory() as folder, SweepLog(chosen.results or Path(folder) / "drives.jsonl") as log:
        for backend in [chosen.map] if chosen.map else ("costmap", "mesh"):
            for row in run(backend, seeds, chosen, log):
                rows.append(row)
                if not row["agrees"] and not chosen.json:
                    print("{seed} {pair}: {ending} at {place}: {message}".format_map(row), flush=True)
    if chosen.json:
        print(json.dumps(rows))
        return
    for backend, pair in dict.fromkeys((row["map"], row["pair"]) for row in rows):
        endings = Counter(row["ending"] for row in rows if (row["map"], row["pair"]) == (backend, pair))
        print(f"{backend:8} {pair:45} " + ", ".join(f"{ending} {count}" for ending, count in endings.most_common()))
    for backend, planner in dict.fromkeys((row["map"], row["planner"]) for row in rows):
        taken = [row["plan_ms"] for row in rows if (row["map"], row["planner"]) == (backend, planner)]
        print(f"{backend:8} {planner:45} median plan {statistics.median(taken):.2f} ms of CPU")
    for limit in ("speed", "yaw rate", "acceleration") if chosen.robots else ():
        over = Counter(row["pair"].split(" + ")[1] for row in rows if row["excess"][limit])
        print(f"drives with commands beyond the {limit}: " + (", ".join(f"{k} {n}" for k, n in over.items()) or "none"))
    print(f"{len(rows)} drives, {sum(not row['agrees'] for row in rows)} do not agree")


if __name__ == "__main__":
    with interruptible():
        main()
