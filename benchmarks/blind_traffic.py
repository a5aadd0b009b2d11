"""People who do not look: how often our robot drives into one, on both maps, with and without looking ahead in time.

    python benchmarks/blind_traffic.py [--quick] [--json] [--seeds 2000:2040] [--drivers costmap/mppi,mesh/mppi,...]
                                       [--executive move_base] [--workers N] [--results FILE]

A hall with four pillars; three people walk at 0.7 m/s and two at 1.1 m/s on routes that the seed draws, keep their
speeds and push what is in their way. The robot drives through the hall and back, two legs a run. What counts is whether
our robot moved in a contact. "off" is a weight of 0 for ``moving_objects`` of the sampling controllers, which then only
stop before contact, as all others do. Parameters were chosen on seeds 100 to 199; report others.

``--results`` keeps every finished run as a JSON line; a run that is in the file is not repeated as long as the scenario
and the source code are what they were.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from margins import source_digest
from PIL import Image
from seeds import seed_list

from mbf_abstract.time.program_end import interruptible
from terrain.scenarios.scenario import Scenario, load_scenario
from terrain.scenarios.world_types import MapWorld
from terrain.session.runner import RunOptions, run_scenario
from terrain.sweeps.log import rows_of
from terrain.sweeps.sweep import hash_of

RESOLUTION, WIDTH, HEIGHT = 0.05, 16.0, 10.0  # m
PILLARS = ((4.5, 3.0), (4.5, 7.0), (10.5, 3.5), (11.0, 7.0))
DRIVERS = ("costmap/regulated_pure_pursuit", "costmap/dwa", "costmap/mppi", "mesh/path_follower", "mesh/mppi")
SAMPLING = ("dwa", "mppi")
QUICK_DRIVERS = ("costmap/dwa",)

Job = tuple[str, str, int]  # driver, "on", "off" or "none", seed


def scenario_in(folder: Path) -> Scenario:
    """Write the floor into a folder, and return the scenario on it."""
    free = np.zeros((round(HEIGHT / RESOLUTION), round(WIDTH / RESOLUTION)), dtype=bool)
    free[10:-10, 10:-10] = True
    for x, y in PILLARS:
        rows, columns = (slice(round((v - 0.4) / RESOLUTION), round((v + 0.4) / RESOLUTION)) for v in (y, x))
        free[rows, columns] = False
    Image.fromarray(np.where(free[::-1], 254, 0).astype(np.uint8)).save(folder / "floor.png")
    header = f"image: floor.png\nresolution: {RESOLUTION}\norigin: [0.0, 0.0, 0.0]\n"
    (folder / "floor.yaml").write_text(header + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    scenario = load_scenario(Path(__file__).with_suffix(".yaml").resolve())
    return scenario.model_copy(update={"world": MapWorld(type="map", file=folder / "floor.yaml")})


def run_job(job: Job, floor: Path, executive: str) -> dict[str, Any]:
    """Run one seed with one controller."""
    driver, looking, seed = job
    backend, controller = driver.split("/")
    settings = {"controller": controller}
    if looking == "off":
        settings[f"{controller}.moving_objects.weight"] = "0.0"
    with tempfile.TemporaryDirectory(prefix="mbf_blind_") as folder:
        options = RunOptions(Path(folder), seed=seed, backend=backend, settings=settings, executive=executive)
        numbers = run_scenario(scenario_in(floor), options).metrics
    return {
        "driver": driver,
        "looking": looking,
        "seed": seed,
        "legs": 2,
        "lost": 2 - len(numbers["arrivals"]),
        "contacts_while_moving": numbers["collisions_while_moving"],
        "contacts": numbers["collisions"],
        "time_s": round(numbers["time_s"], 2),
        "recoveries": numbers["recoveries"],
        "digest": numbers["digest"],
    }


def jobs_of(drivers: Iterable[str], seeds: Iterable[int]) -> list[Job]:
    """All runs: the sampling controllers twice, looking ahead in time or not."""
    looks = {driver: ("on", "off") if driver.split("/")[1] in SAMPLING else ("none",) for driver in drivers}
    return [(driver, looking, seed) for seed in seeds for driver, both in looks.items() for looking in both]


def run_jobs(jobs: list[Job], executive: str, workers: int, results: Path, floor: Path) -> Iterator[dict[str, Any]]:
    """Yield the row of every run: first those that the file holds, then the others as they finish."""
    head = f"{source_digest()}/{hash_of(scenario_in(floor))}/{executive}"
    keys = {job: "/".join([head, *map(str, job)]) for job in jobs}
    yield from (row for _, row in rows_of(keys, results, partial(run_job, floor=floor, executive=executive), workers))


def summarise(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One line for each controller, with and without looking ahead in time."""
    lines = []
    for driver, looking in dict.fromkeys((row["driver"], row["looking"]) for row in rows):
        own = [row for row in rows if (row["driver"], row["looking"]) == (driver, looking)]
        sums: Mapping[str, int] = {
            key: sum(row[key] for row in own)
            for key in ("legs", "lost", "contacts_while_moving", "contacts", "recoveries")
        }
        seconds = sorted(row["time_s"] for row in own)
        lines.append({"driver": driver, "looking": looking, **sums, "median_time_s": seconds[len(seconds) // 2]})
    return lines


def main() -> None:
    """Run what the command line asks for and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two seeds of one controller")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seeds", type=seed_list, default="2000:2040", help="first and one past the last, or a list")
    parser.add_argument("--drivers", default=",".join(DRIVERS), help="map/controller, comma-separated")
    parser.add_argument("--executive", default="move_base")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--results", type=Path, help="file of finished runs")
    asked = parser.parse_args()
    drivers, seeds = asked.drivers.split(","), asked.seeds
    if asked.quick:
        drivers, seeds = list(QUICK_DRIVERS), seeds[:2]
    if unknown := sorted(set(drivers) - set(DRIVERS)):
        parser.error(f"unknown drivers {unknown}, expected some of {', '.join(DRIVERS)}")
    with tempfile.TemporaryDirectory() as name:
        floor = Path(name)
        scenario_in(floor)
        results = asked.results or floor / "runs.jsonl"
        rows = []
        for row in run_jobs(jobs_of(drivers, seeds), asked.executive, asked.workers, results, floor):
            rows.append(row)
            if not asked.json and (row["contacts_while_moving"] or row["lost"]):
                print(
                    f"  {row['driver']} looking {row['looking']} seed {row['seed']}: lost {row['lost']}, contacts in "
                    f"which it moved {row['contacts_while_moving']}",
                    flush=True,
                )
    lines = summarise(rows)
    if asked.json:
        print(json.dumps(lines, indent=2))
        return
    print(f"{'controller':32} looking  legs  lost  contacts while moving  all contacts  recoveries  median time")
    for line in lines:
        print(
            f"{line['driver']:32} {line['looking']:>7} {line['legs']:5} {line['lost']:5} "
            f"{line['contacts_while_moving']:22} {line['contacts']:13} {line['recoveries']:11} "
            f"{line['median_time_s']:10.1f} s"
        )


if __name__ == "__main__":
    with interruptible():
        main()
