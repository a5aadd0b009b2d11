"""Who arrives on rough ground: planners on the mesh against a flat map of slopes and against the straight line.

    python benchmarks/outdoor_evaluation.py [--quick] [--json] [--workers 2] [--data ../shared/data]
        [--fresh 3] [--results FILE] [--replays DIR] [--report DIR]

Seeded terrains of rising difficulty and crops of real surveys (``outdoor_terrains.py``). On each, a simulated Husky
drives from one corner to the other, once per method, with the shipped outdoor configurations. Finished runs stand in
the results file and are never run again, so the evaluation can be stopped at any time.

Rates are over the terrains with a route: those where ``benchmarks.reachability`` finds that a robot with the Husky's
limits can get there at all. Its limits are near to those of the maps' tilt layer, so a second rate is over the terrains
that anybody drove, whatever the judge says, the flat map and the straight line included. Failures are of the planner
(no plan), of physics (tipped over, stuck, high-centred) or of the controller (the rest), or an error before the start;
``--replays`` drives one of each class again and keeps all. ``--fresh`` takes seeds and surveys nothing was chosen on,
from 5000 or a later ``--first-seed`` on: what has been looked at is not fresh any more.
"""

from __future__ import annotations

import argparse
import csv
import json
import tempfile
from collections import Counter
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import yaml
from outdoor_terrains import FRESH_SEED, LEVELS, SCALES, has_route, terrains

from mbf_abstract.geometry import Path, quaternion_from_yaw
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.plugins import MeshPlanner
from terrain.scenarios.scenario import SHIPPED, Scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.sweeps.log import SweepLog
from terrain.sweeps.sweep import Job, SweepRun, hash_of, run_once
from terrain.sweeps.worker_pool import run_in_workers
from terrain.viewer.results import write_results

SLOPE_ONLY = {  # what mesh_navigation's steepness and inflation layers know: slopes without a direction, no footprint
    "planner": "dijkstra",
    "mesh_map.steepness.threshold": "0.6",
    "mesh_map.layers": "[{name: border, type: border}, {name: tilt, type: tilt}, {name: steepness, type: steepness}, "
    "{name: ground, type: weighted_sum, inputs: [border, steepness]}, "
    "{name: inflation, type: inflation, inputs: [ground]}, "
    "{name: safe, type: max_combination, inputs: [inflation, steepness]}]",
}
_GRAPH = yaml.safe_load((SHIPPED / "config" / "outdoor_graph_mesh.yaml").read_text())
GRAPH = {  # the default of ``mbf run outdoor``: A* over slope, roughness and steps, tilt as the limit, string pulling
    "planner": "astar",
    "refiners": yaml.safe_dump(_GRAPH["refiners"]),
    "plan_refiner": _GRAPH["plan_refiner"],
    **{f"mesh_map.{key}": yaml.safe_dump(value) for key, value in _GRAPH["mesh_map"].items() if key != "mesh_file"},
}
FLAT = {  # the best of five variants of lethal slope, inflation and collision check on the seeds from 1000
    "backend": "costmap",
    "planner": "astar",
    "pursuit.max_vel_x": "0.8",  # the speed of the controller on the mesh
    "pursuit.cost_scaling_dist": "0.0",  # a slope is no obstacle to slow down for
    "pursuit.collision_check": "false",
}
METHODS = {
    "mesh vertex graph": GRAPH,
    "mesh cvp": {"planner": "cvp"},
    "mesh heading-aware": {"planner": "heading_astar"},
    "mesh dijkstra by slope": SLOPE_ONLY,
    "flat A*": FLAT,
    "straight line": {"planner": "outdoor_evaluation:StraightLinePlanner"},
    "mesh any-angle": {"planner": "any_angle"},
}
PLANNER_OUTCOMES = set(GetPathOutcome.__members__) - set(ExePathOutcome.__members__)
FAILURES = ("planner", "controller", "physics", "error")
PHYSICS = {"tipped_over", "stuck", "high_centred"}

Row = dict[str, Any]


class StraightLinePlanner(MeshPlanner):
    """Projects the straight line from start to goal onto the surface, whatever is in the way."""

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Answer at once."""
        start, goal = (np.array(pose.position) for pose in (request.start, request.goal))
        points = np.linspace(start, goal, max(2, int(np.linalg.norm(goal - start) / 0.2)))
        for _ in range(20):  # the nearest surface point of the nearest surface point ... is straight below
            points[:, 2] = self.mesh_map.locate(points, np.inf).points[:, 2]
        heading = np.tile(quaternion_from_yaw(float(np.arctan2(*(goal - start)[1::-1]))), (len(points), 1))
        return PlanResult(0, "straight ahead", Path(points, heading, request.start.frame_id))


def evaluate(chosen: list[tuple[Scenario, int]], methods: list[str], workers: int, log: SweepLog) -> list[Row]:
    """Do every run that the log does not hold, then return the rows of all."""
    jobs = [(scenario, SweepRun(seed, METHODS[method])) for scenario, seed in chosen for method in methods]
    keys = [run.key(hash_of(scenario)) for scenario, run in jobs]
    left = [job for key, job in zip(keys, jobs, strict=True) if key not in log.rows]
    for (scenario, run), metrics in run_in_workers(run_once, left, workers):
        row = {**metrics, **describe(scenario, run), "failure": failure_of(metrics)}
        log.append(run.key(hash_of(scenario)), row)
        answer = (row["terrain"], f"seed {run.seed}", row["method"], "" if row["route"] else "no route", row["outcome"])
        print(" | ".join([*answer, row["failure"], row["message"]]), flush=True)
    return [log.rows[key] for key in keys]


def describe(scenario: Scenario, run: SweepRun) -> Row:
    """What a run's metrics leave out."""
    method = next(name for name, settings in METHODS.items() if settings == run.settings)
    return {"terrain": scenario.name, "seed": run.seed, "method": method, "route": has_route(scenario, run.seed)}


def failure_of(metrics: Row) -> str:
    """Class of a failure, empty for a success."""
    if metrics["success"]:
        return ""
    if "time_s" not in metrics:
        return "error"  # it could not even begin
    if PHYSICS & set(metrics["incidents"]):
        return "physics"
    no_plan = metrics["plans"] == 0  # planner and controller share some codes, such as BLOCKED_GOAL
    return "planner" if no_plan or metrics["outcome"] in PLANNER_OUTCOMES else "controller"


def driven_by_anybody(rows: list[Row]) -> set[tuple[str, int]]:
    """Terrains and seeds on which some method arrived."""
    return {(row["terrain"], row["seed"]) for row in rows if row["success"]}


def summarise(rows: list[Row], driven: set[tuple[str, int]]) -> Row:
    """Figures of one method over its terrains with a route, and over those ``driven`` by anybody."""
    driven_rows = [row for row in rows if (row["terrain"], row["seed"]) in driven]
    routed = [row for row in rows if row["route"]]
    arrived = [row for row in routed if row["success"]]
    share = 100.0 / max(1, len(routed))
    energy = [row["energy_j"] / row["path_length_m"] for row in arrived]
    slip = [row["slipped_m"] / row["path_length_m"] for row in arrived]
    return {
        "runs": len(rows),
        "with_route": len(routed),
        "success_percent": round(share * len(arrived), 1),
        "driven_by_anybody": len(driven_rows),
        "success_of_driven_percent": round(100.0 * float(np.mean([row["success"] for row in driven_rows] or [0.0])), 1),
        "tip_over_percent": round(share * sum("tipped_over" in row.get("incidents", ()) for row in routed), 1),
        "slipping_percent": round(share * sum("slipping" in row.get("incidents", ()) for row in routed), 1),
        "slip_m_per_m": round(float(np.mean(slip)), 3) if slip else None,
        "energy_j_per_m": round(float(np.mean(energy)), 1) if energy else None,
        "failures": dict(Counter(row["failure"] for row in routed if not row["success"])),
        "arrived_without_route": sum(row["success"] for row in rows if not row["route"]),
    }


def keep_replays(chosen: list[tuple[Scenario, int]], rows: list[Row], folder: FilePath) -> None:
    """Drive the first run of each method's classes of failure again and keep everything to look at."""
    jobs: dict[tuple[str, str], Job] = {}
    scenarios = {(scenario.name, seed): scenario for scenario, seed in chosen}
    for row in rows:
        if row["failure"] and row["route"]:
            run = SweepRun(row["seed"], METHODS[row["method"]])
            jobs.setdefault((row["method"], row["failure"]), (scenarios[row["terrain"], row["seed"]], run))
    for (method, failure), (scenario, run) in jobs.items():
        settings = dict(run.settings)
        target = folder / f"{method} {failure}".replace("*", "star").replace(",", "").replace(" ", "_")
        backend = settings.pop("backend", None)
        options = RunOptions(target, backend, run.seed, settings=settings, write_views=write_results)
        run_scenario(scenario, options)


def by_place(rows: list[Row]) -> list[Row]:
    """Count for every method and level or survey: terrains with a route, arrivals, tip-overs, failures by class."""
    places = [f"level {level}" for level in range(LEVELS)] + [FilePath(name).stem for name in SCALES]
    table = []
    for method in dict.fromkeys(row["method"] for row in rows):
        for place in places:
            here = [row for row in rows if (row["method"], row["terrain"]) == (method, place) and row["route"]]
            failures = Counter(row["failure"] for row in here)
            line = {"method": method, "terrain": place, "with_route": len(here), "arrived": failures.pop("", 0)}
            line["tipped_over"] = sum("tipped_over" in row.get("incidents", ()) for row in here)
            table.append({**line, **{name: failures[name] for name in FAILURES}})
    return table


def report(rows: list[Row], folder: FilePath) -> None:
    """Write the counts as a table, and success over difficulty as a picture with one line per method."""
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    table = by_place(rows)
    with (folder / "outdoor_evaluation.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for number, method in enumerate(dict.fromkeys(line["method"] for line in table)):
        lines = [line for line in table if line["method"] == method and line["with_route"]]
        share = [100.0 * line["arrived"] / line["with_route"] for line in lines]
        style = ("-", "--", ":", "-.")[number % 4]  # lines that lie upon each other show through
        axes.plot([line["terrain"] for line in lines], share, style, lw=2.5 - 0.2 * number, marker="o", label=method)
    axes.set(ylabel="arrived [%], where a route exists", ylim=(-3, 103))
    axes.tick_params(axis="x", rotation=60)
    axes.legend()
    figure.savefig(folder / "outdoor_evaluation.png", dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="ten generated terrains instead of 200")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=0, help="parameters were chosen on seeds from 1000")
    parser.add_argument("--fresh", type=int, default=0, help="instead so many seeds of every level and all surveys")
    parser.add_argument("--methods", default=",".join(METHODS), help="comma separated")
    parser.add_argument("--data", type=FilePath, default=FilePath("../shared/data"))
    parser.add_argument("--results", type=FilePath, help="file of finished runs, added to")
    parser.add_argument("--replays", type=FilePath, help="folder for one replay of each class of failure")
    parser.add_argument("--report", type=FilePath, help="folder for a table and a picture of success over difficulty")
    arguments = parser.parse_args()
    methods = arguments.methods.split(",")
    counts = (1, 0) if arguments.quick else (16, 10)
    chosen = terrains(arguments.data, arguments.first_seed, *counts)
    if arguments.fresh:
        first_seed = max(FRESH_SEED, arguments.first_seed)
        chosen = terrains(arguments.data, first_seed, arguments.fresh, arguments.fresh)
    with tempfile.TemporaryDirectory() as folder:
        with SweepLog(arguments.results or FilePath(folder) / "runs.jsonl") as log:
            rows = evaluate(chosen, methods, arguments.workers, log)
    driven = driven_by_anybody(rows)
    figures = {name: summarise([row for row in rows if row["method"] == name], driven) for name in methods}
    for name, line in figures.items():
        print(f"{name:26} {line}")
    if arguments.replays:
        keep_replays(chosen, rows, arguments.replays)
    if arguments.report:
        report(rows, arguments.report)
    if arguments.json:
        print(json.dumps({"figures": figures}))


if __name__ == "__main__":
    main()
